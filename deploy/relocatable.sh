#!/bin/sh
# Makes the directory of the relocatable tarball: the programs with the dynamic loader and all libraries, the C library
# included, for Linux machines that lack these libraries or have older ones. `bin/NAME` starts `libexec/NAME` with the
# loader and the libraries in `lib` (deploy/packages/launcher.cc).
#
#   deploy/relocatable.sh BUILD PREFIX DIRECTORY      BUILD: a build folder; PREFIX: where it is installed; DIRECTORY: to be made
set -eu
build=$1
prefix=$2
top=$3
here=$(cd "${0%/*}/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$here/deploy/libraries.sh" "$prefix" "$work/root"

mkdir -p "$top/bin" "$top/lib" "$top/python" "$top/share/doc/planish"
mv "$work/root/usr/local/bin" "$top/libexec"
find "$work/root/usr/lib" "$work/root/usr/lib64" -type f -exec mv -t "$top/lib" {} +
mv "$top"/lib/ld-linux*.so* "$top/lib/loader"
cp "$build/deploy/packages/planish_launcher" "$top/bin/planish"
strip "$top/bin/planish"
for program in planishd planishd-farm; do ln "$top/bin/planish" "$top/bin/$program"; done

# Man pages and completion. share/planish is left out: it is for units and other languages.
for directory in "$prefix"/share/*; do
  [ "${directory##*/}" = planish ] || cp -r "$directory" "$top/share/"
done
cp -r "$work/root/usr/share/doc" "$top/share/doc/libraries"
cp "$here/LICENSE" "$here/README.md" "$top/share/doc/planish/"
cp "$build"/client/python/dist/*.whl "$build/client/blender/planish_blender.zip" "$top/python/"
