#!/bin/sh
# Installs buf into the build tree, lints the proto files and compares them with those of the last release. Exit code
# 77: skipped, and why is printed.
#   run.sh WORK_DIR PROTO_DIR
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=$1
proto=$2

skip() {
  echo "SKIPPED: $*"
  exit 77
}
command -v node >/dev/null || skip "node is not installed (18 or newer is needed)"
command -v npm >/dev/null || skip "npm is not installed"
[ "$(node -p 'process.versions.node.split(".")[0]')" -ge 18 ] || skip "node $(node --version) is older than 18"
[ "$(uname -sm)" = "Linux x86_64" ] || skip "package.json names the buf for Linux on x86-64 only"

mkdir -p "$work"
cp "$here"/package.json "$here"/package-lock.json "$work"
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
buf=$work/node_modules/@bufbuild/buf-linux-x64/bin/buf

echo "buf lint"
"$buf" lint "$proto"
echo "buf breaking"
# A copy: where the two are in different directories buf wants both under the one it runs in.
rm -rf proto released
cp -r "$proto" proto
cp -r "$here/released" released
"$buf" breaking proto --against released

# And it would say so if something were broken.
sed 's/^  JobState state = 3;/  JobState state = 93;/' "$proto/planish/v1/planish.proto" >proto/planish/v1/planish.proto
if cmp -s "$proto/planish/v1/planish.proto" proto/planish/v1/planish.proto ||
  "$buf" breaking proto --against released >broken.log; then
  echo "a field that got another number went unnoticed"
  exit 1
fi
grep -q ListJobsRequest broken.log
echo "ok"
