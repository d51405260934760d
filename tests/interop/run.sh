#!/bin/sh
# Installs the packages into the build tree and runs the test, or another program of this folder. Exit code 77: skipped,
# and why is printed.
#   run.sh WORK_DIR PLANISHD PROTO_DIR EXAMPLE [PROGRAM ARGUMENT...]
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=$1
export PLANISHD="$2" PLANISH_PROTO="$3"

# shellcheck source=tests/npm/packages.sh
. "$here/../npm/packages.sh"
mkdir -p "$work"
# Tests that run at the same time install one after the other.
exec 9>"$work/lock"
flock 9
install_packages "$here" "$work"
install -C -m 644 "$here"/*.mjs "$here"/*.proto "$4" .
exec 9<&-
shift 4
[ $# -gt 0 ] || set -- --test unwrap.test.mjs example.test.mjs
exec node "$@"
