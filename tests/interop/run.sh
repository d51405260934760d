#!/bin/sh
# Installs the packages into the build tree and runs the test. Exit code 77: skipped, and why is printed.
#   run.sh WORK_DIR PLANISHD PROTO_DIR EXAMPLE
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=$1
export PLANISHD="$2" PLANISH_PROTO="$3"

# shellcheck source=tests/npm/packages.sh
. "$here/../npm/packages.sh"
install_packages "$here" "$work"
cp "$here"/*.mjs "$here"/*.proto "$4" .
exec node --test unwrap.test.mjs example.test.mjs
