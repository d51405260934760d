#!/bin/bash
# Tries the npm package as new users would: npm installs it in an empty folder, beside glTF-Transform, and the lines of its README run against
# the server of the relocatable tarball. Needs node, npm and its registry, and so is no part of ctest.
#
#   tests/deploy/try_npm.sh [DIST]      DIST: build/packages/dist
set -euo pipefail
source_tree=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
dist=$(realpath "${1:-$source_tree/build/packages/dist}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tar -C "$work" -xf "$dist"/planish-*-linux-*.tar.xz
mkdir "$work/empty"
cd "$work/empty"
npm install --no-audit --no-fund "$dist"/planish-*.tgz @gltf-transform/core
unset PLANISHD PLANISH_SERVER
PATH=$(echo "$work"/planish-*/bin):$PATH
planish unwrap "$source_tree/tests/data/spot_seam.obj" -o in.glb --quiet
awk '/^```js$/ { ++n; next } /^```$/ { inside = 0 } { if (n > last) { inside = 1; last = n } if (inside) print >("block" n ".mjs") }' \
  "$source_tree/client/javascript/README.md"
for block in block*.mjs; do node "$block"; done
[ -s out.glb ]
echo "All that was tried works."
