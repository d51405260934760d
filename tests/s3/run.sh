#!/bin/sh
# Installs the packages into the build tree and becomes an S3 server, which ends with the process that started this one.
# Exit code 77: skipped, and why is printed.
#   run.sh WORK_DIR DATA_DIR
set -eu
here=$(cd "$(dirname "$0")" && pwd)
data=$2

# shellcheck source=tests/npm/packages.sh
. "$here/../npm/packages.sh"
mkdir -p "$1"
# Tests that run at the same time install one after the other.
exec 9>"$1/lock"
flock 9
install_packages "$here" "$1"
put "$here"/s3_server.mjs
exec 9<&-
exec setpriv --pdeathsig KILL node s3_server.mjs "$data"
