#!/bin/sh
# Installs what is needed, builds planish, and makes all packages in build/packages/dist: Debian packages, the
# relocatable tarball, the Python wheels and sdist, the npm package, the Blender add-on. At the end it prints the use of
# each file.
#
#   deploy/packages.sh
#
# $PLANISH_BLENDER_WHEELS: a folder with wheels of grpcio and protobuf for Blender's Python, which become part of the
# Blender extension; without them the extension runs the command in planish's own wheel. tests/deploy/try_*.sh install
# and try everything in clean trees.
set -eu
cd "$(dirname "$0")/.."
deploy/install-packages.sh packaging
PLANISH_PRESET=packages deploy/build.sh
build=build/packages
cmake --build "$build" -t python_package javascript_package blender_addon >&2

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
cp "$build"/client/python/dist/* "$build/client/javascript/planish-$version.tgz" "$build/client/blender/planish_blender.zip" "$build/dist/"

rm -rf "$build/wheel-root"
deploy/relocatable.sh "$build" "$build/prefix" "$build/wheel-root" planish planishd
python3 client/python/build_package.py server "$build/client/python/dist/planish-$version-py3-none-any.whl" "$build/wheel-root" "$build/dist"
wheels=$(echo "$build"/dist/planish-*-manylinux_*.whl)
[ -z "${PLANISH_BLENDER_WHEELS:-}" ] || wheels="$wheels $(echo "$PLANISH_BLENDER_WHEELS"/*.whl)"
platform=linux-$(uname -m | sed 's/x86_64/x64/; s/aarch64/arm64/')
# shellcheck disable=SC2086  # a list of words
python3 client/blender/build_addon.py extension "$build/dist/planish_blender-$version-$platform.zip" "$version" LICENSE "$platform" $wheels

say() { # PATTERN USE...
  for file in "$build"/dist/$1; do
    [ ! -e "$file" ] || printf '%6s  %-58s %s\n' "$(du -h "$file" | cut -f 1)" "${file##*/}" "$2"
  done
}
echo "In $build/dist:"
say 'planish-*-manylinux_*.whl' 'Python on any Linux, with the server and the command: pip install'
say 'planish-*-none-any.whl' 'Python on any system, for those who have a server: pip install'
say "planish-$version.tar.gz" 'the sources of that'
say 'planish-*.tgz' 'JavaScript: npm install'
say 'planish_blender-*.zip' 'Blender 4.2 and later on Linux, with everything: Install from Disk'
say 'planish_blender.zip' 'Blender 3.4 and later: Install from Disk; needs a command or grpcio'
say 'planish-*-linux-*.tar.xz' 'any Linux: the programs with all their libraries'
say 'planish_*.deb' 'Debian 12: the command'
say 'planishd_*.deb' 'Debian 12: the server and its unit'
say 'libplanish[0-9]*.deb' 'Debian 12: the C++ library'
say 'libplanish-dev_*.deb' 'Debian 12: what compiling with it takes, and the protos'
say 'python3-planish_*.deb' 'Debian 12: the Python package'
