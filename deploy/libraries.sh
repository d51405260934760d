#!/bin/sh
# Copies programs and all libraries that they load into a directory that becomes a root or part of one. Each library
# comes with its licence and with its package's record, by which scanners identify it.
#
#   deploy/libraries.sh PREFIX ROOT      PREFIX: where cmake --install installed planish
set -eu
prefix=$1
root=$2

mkdir -p "$root/usr/lib" "$root/usr/lib64" "$root/usr/local/bin" "$root/var/lib/dpkg/status.d"
ln -s usr/lib "$root/lib"
ln -s usr/lib64 "$root/lib64"
cp "$prefix/bin/planish" "$prefix/bin/planishd" "$prefix/bin/planishd-farm" "$root/usr/local/bin/"

libraries=$(ldd "$root"/usr/local/bin/* | sed -n 's/.*=> \(\/[^ ]*\) .*/\1/p; s/^[[:space:]]*\(\/[^ ]*\) (.*/\1/p' | sort -u)
files=
for library in $libraries; do
  target=$root/usr/${library#/}
  [ "${library#/usr/}" = "$library" ] || target=$root$library
  mkdir -p "${target%/*}"
  cp -L "$library" "$target"
  # Alternatives are links to files of packages.
  files="$files $(readlink -f "$library")"
done

# Packages from before the merge of /usr list /lib in place of /usr/lib, so each file is looked up by both names.
# shellcheck disable=SC2046,SC2086 # lists of words
owners=$(dpkg-query -S $files $(printf '%s\n' $files | sed 's/^\/usr//') 2>/dev/null || true)
for file in $files; do
  printf '%s\n' "$owners" | sed 's/.*: \(\/usr\)\{0,1\}//' | grep -qxF "${file#/usr}" || {
    echo "libraries.sh: no package has $file" >&2
    exit 1
  }
done
for package in ca-certificates $(printf '%s\n' "$owners" | cut -d : -f 1 | sort -u); do
  dpkg-query --status "$package" >"$root/var/lib/dpkg/status.d/$package"
  install -D -m 644 "/usr/share/doc/$package/copyright" "$root/usr/share/doc/$package/copyright"
done
