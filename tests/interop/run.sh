#!/bin/sh
# Installs the packages into the build tree and runs the test. Exit code 77: skipped, and why is printed.
#   run.sh WORK_DIR PLANISHD PROTO_DIR
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=$1
export PLANISHD="$2" PLANISH_PROTO="$3"

skip() {
  echo "SKIPPED: $*"
  exit 77
}
command -v node >/dev/null || skip "node is not installed (18 or newer is needed)"
command -v npm >/dev/null || skip "npm is not installed"
[ "$(node -p 'process.versions.node.split(".")[0]')" -ge 18 ] || skip "node $(node --version) is older than 18"

mkdir -p "$work"
cp "$here"/package.json "$here"/package-lock.json "$here"/*.mjs "$here"/*.proto "$work"
cd "$work"
if ! cmp -s package-lock.json node_modules/.installed-lock; then
  if ! npm ci --ignore-scripts --no-audit --no-fund --prefer-offline --fetch-retries=1 >npm.log 2>&1; then
    cat npm.log
    # What is wrong with the lock file or the packages is a failure; a registry that does not answer is not.
    ! grep -Eq 'code (EUSAGE|EINTEGRITY|EJSONPARSE|ERESOLVE)' npm.log || exit 1
    skip "npm could not fetch the packages"
  fi
  cp package-lock.json node_modules/.installed-lock
fi
exec node --test unwrap.test.mjs
