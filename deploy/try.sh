#!/bin/sh
# Installs packages, builds planish, and unwraps a mesh through a server, showing its progress.
set -eu
cd "$(dirname "$0")/.."
deploy/build.sh

cmake --install build/default --prefix build/planish --strip >/dev/null
progress=plain
[ ! -t 2 ] || progress=bar
echo >&2
build/planish/bin/planish unwrap tests/data/spot_seam.obj -o build/spot_flat.obj --progress=$progress
cat <<END

build/spot_flat.obj is tests/data/spot_seam.obj with texture coordinates: open it in any UV editor. Next:

  build/planish/bin/planish unwrap MESH.obj -o OUT.obj      a mesh of yours (OBJ, PLY, OFF, STL, glTF, Draco)
  build/planish/bin/planish unwrap --help                   solvers, precision, reports as JSON
  build/planish/bin/planishd --listen=127.0.0.1:7741        a server that stays; add --server=127.0.0.1:7741 above
  cmake --install build/default --prefix /usr/local         programs, C++ client library and its CMake package
END
