#!/bin/sh
# Installs what the npm package needs into the build tree, unpacks the package beside that, and runs the tests. Exit code 77: skipped, and
# why is printed.
#   run.sh WORK_DIR PLANISHD PACKAGE_TGZ README
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=$1 package=$3
export PLANISHD="$2" PLANISH_README="$4"
unset PLANISH_SERVER

# shellcheck source=tests/npm/packages.sh
. "$here/../../npm/packages.sh"
mkdir -p "$work"
install_packages "$here" "$work"
rm -rf node_modules/planish
mkdir node_modules/planish
tar -C node_modules/planish --strip-components=1 -xf "$package"
cp "$here"/*.mjs "$here"/*.ts "$here/tsconfig.json" .
node node_modules/typescript/bin/tsc -p .
exec node --test client.test.mjs gltf.test.mjs readme.test.mjs
