#!/bin/sh
# Puts programs and all the libraries that they load into a directory that is to be a root or a part of one, each library with its licence
# and its package's record, by which scanners know what is in there.
#
#   deploy/libraries.sh PREFIX ROOT      PREFIX: where cmake --install put planish
set -eu
prefix=$1
root=$2

mkdir -p "$root/usr/lib" "$root/usr/lib64" "$root/usr/local/bin" "$root/var/lib/dpkg/status.d"
ln -s usr/lib "$root/lib"
ln -s usr/lib64 "$root/lib64"
cp "$prefix/bin/planish" "$prefix/bin/planishd" "$prefix/bin/planishd-farm" "$root/usr/local/bin/"

libraries=$(ldd "$root"/usr/local/bin/* | sed -n 's/.*=> \(\/[^ ]*\) .*/\1/p; s/^[[:space:]]*\(\/[^ ]*\) (.*/\1/p' | sort -u)
packages=ca-certificates
for library in $libraries; do
  target=$root/usr/${library#/}
  [ "${library#/usr/}" = "$library" ] || target=$root$library
  mkdir -p "${target%/*}"
  cp -L "$library" "$target"
  # Alternatives are links to what a package has. Before the merge of /usr, packages called it /lib.
  real=$(readlink -f "$library")
  owner=$(dpkg-query -S "$real" 2>/dev/null || dpkg-query -S "${real#/usr}")
  packages="$packages ${owner%%:*}"
done

for package in $(printf '%s\n' $packages | sort -u); do
  dpkg-query --status "$package" >"$root/var/lib/dpkg/status.d/$package"
  install -D -m 644 "/usr/share/doc/$package/copyright" "$root/usr/share/doc/$package/copyright"
done
