#!/bin/sh
# Opens pages in chromium. Exit code 77: skipped, and why is printed.
#   page.sh WORK_DIR PLANISH PLANISHD TEST_DATA
set -eu
here=$(cd "$(dirname "$0")" && pwd)
export PLANISH="$2" PLANISHD="$3" PLANISH_TEST_DATA="$4"

# shellcheck source=tests/npm/packages.sh
. "$here/../npm/packages.sh"
CHROMIUM=$(command -v chromium) || skip "chromium is not installed"
export CHROMIUM
install_packages "$here" "$1"
put "$here"/*.mjs
exec node --test --test-concurrency=1 page.test.mjs
