#!/bin/sh
# Installs buf into the build tree, lints the proto files and compares them with those of the last release. Exit code
# 77: skipped, and why is printed.
#   run.sh WORK_DIR PROTO_DIR
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=$1
proto=$2

# shellcheck source=tests/npm/packages.sh
. "$here/../npm/packages.sh"
[ "$(uname -sm)" = "Linux x86_64" ] || skip "package.json names the buf for Linux on x86-64 only"
install_packages "$here" "$work"
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
sed 's/^  string filter = 3;/  string filter = 93;/' "$proto/planish/v1/planish.proto" >proto/planish/v1/planish.proto
if cmp -s "$proto/planish/v1/planish.proto" proto/planish/v1/planish.proto ||
  "$buf" breaking proto --against released >broken.log; then
  echo "a field that got another number went unnoticed"
  exit 1
fi
grep -q ListJobsRequest broken.log
echo "ok"
