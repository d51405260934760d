#!/bin/sh
# Installs what is needed, builds planish, and makes all packages in build/packages/dist: Debian packages, the
# relocatable tarball, the Python wheel and sdist, and the Blender add-on.
#
#   deploy/packages.sh
#
# tests/deploy/try_packages.sh installs and tries them in clean trees.
set -eu
cd "$(dirname "$0")/.."
deploy/install-packages.sh packaging
PLANISH_PRESET=packages deploy/build.sh
build=build/packages
cmake --build "$build" -t python_package blender_addon >&2

rm -rf "$build/dist" "$build/prefix"
cpack --config "$build/CPackConfig.cmake" -B "$build/dist" >"$build/cpack.log" 2>&1 || {
  cat "$build/cpack.log" >&2
  exit 1
}
rm -rf "$build/dist/_CPack_Packages"
cmake --install "$build" --prefix "$build/prefix" --strip >/dev/null
version=$(sed -n 's/^CMAKE_PROJECT_VERSION:STATIC=//p' "$build/CMakeCache.txt")
name=planish-$version-linux-$(uname -m)
rm -rf "${build:?}/$name"
deploy/relocatable.sh "$build" "$build/prefix" "$build/$name"
tar -C "$build" --owner=0 --group=0 --numeric-owner --sort=name -cJf "$build/dist/$name.tar.xz" "$name"
cp "$build"/client/python/dist/* "$build/client/blender/planish_blender.zip" "$build/dist/"
ls -l "$build/dist"
