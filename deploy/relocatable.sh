#!/bin/sh
# Makes the directory of the relocatable tarball and of the wheel with the server: the programs with the dynamic loader
# and all libraries, the C library included, for Linux machines that lack these libraries or have older ones. `bin/NAME`
# starts `libexec/NAME` with the loader and the libraries in `lib` (deploy/packages/launcher.cc). The licences are in
# `share/doc`.
#
#   deploy/relocatable.sh BUILD PREFIX DIRECTORY [PROGRAM...]
#
# BUILD: a build folder; PREFIX: where cmake --install installed it; DIRECTORY: the directory to make. With PROGRAM, the
# directory has only these programs and their libraries: no man pages, no completion, no Python package.
set -eu
build=$1
prefix=$2
top=$3
shift 3
here=$(cd "${0%/*}/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$here/deploy/libraries.sh" "$prefix" "$work/root" "$@"

mkdir -p "$top/bin" "$top/lib" "$top/share/doc/planish"
mv "$work/root/usr/local/bin" "$top/libexec"
find "$work/root/usr/lib" "$work/root/usr/lib64" -type f -exec mv -t "$top/lib" {} +
mv "$top"/lib/ld-linux*.so* "$top/lib/loader"
cp "$build/deploy/packages/planish_launcher" "$work/launcher"
strip "$work/launcher"
for program in "$top"/libexec/*; do ln "$work/launcher" "$top/bin/${program##*/}"; done

cp -r "$work/root/usr/share/doc" "$top/share/doc/libraries"
cp -r "$work/root/usr/share/common-licenses" "$top/share/doc/libraries/common-licenses"
cp "$here/LICENSE" "$here/deploy/packages/three.js.LICENSE" "$top/share/doc/planish/"
{
  echo "The libraries in lib/ are those of these packages of Debian, unchanged; their sources are Debian's of the same versions."
  echo
  sed -n 's/^Package: //p; s/^Version: //p' "$work"/root/var/lib/dpkg/status.d/* | paste - - | sed '/^ca-certificates/d'
} >"$top/share/doc/libraries/PACKAGES"
[ $# -eq 0 ] || exit 0

# Man pages and completion. share/planish is left out: it has the systemd unit, and the protos for other languages.
mkdir "$top/python"
for directory in "$prefix"/share/*; do
  [ "${directory##*/}" = planish ] || cp -r "$directory" "$top/share/"
done
cp "$here/README.md" "$top/share/doc/planish/"
cp "$build"/client/python/dist/*-none-any.whl "$build/client/blender/planish_blender.zip" "$top/python/"
