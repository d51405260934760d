#!/bin/sh
# Copies programs and all libraries that they load into a directory that becomes a root or part of one. Each library
# comes with its licence and with its package's record, by which scanners identify it.
#
#   deploy/libraries.sh PREFIX ROOT [PROGRAM...]      PREFIX: where cmake --install installed planish; PROGRAM: [all three]
set -eu
prefix=$1
root=$2
shift 2
[ $# -gt 0 ] || set -- planish planishd planishd-farm
# Header-only libraries, which are compiled into the programs.
headers="libeigen3-dev libcli11-dev nlohmann-json3-dev"

mkdir -p "$root/usr/lib" "$root/usr/lib64" "$root/usr/local/bin" "$root/var/lib/dpkg/status.d"
ln -s usr/lib "$root/lib"
ln -s usr/lib64 "$root/lib64"
for program in "$@"; do cp "$prefix/bin/$program" "$root/usr/local/bin/"; done

libraries=$(ldd "$root"/usr/local/bin/* | sed -n 's/.*=> \(\/[^ ]*\) .*/\1/p; s/^[[:space:]]*\(\/[^ ]*\) (.*/\1/p' | sort -u)
files=
for library in $libraries; do
  target=$root/usr/${library#/}
  [ "${library#/usr/}" = "$library" ] || target=$root$library
  mkdir -p "${target%/*}"
  cp -L "$library" "$target"
  # Libraries that update-alternatives chose are links to files of packages.
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
for package in ca-certificates $headers $(printf '%s\n' "$owners" | cut -d : -f 1 | sort -u); do
  case " $headers " in *" $package "*) ;; *) dpkg-query --status "$package" >"$root/var/lib/dpkg/status.d/$package" ;; esac
  install -D -m 644 "/usr/share/doc/$package/copyright" "$root/usr/share/doc/$package/copyright"
done
# Debian's copyright files name long licences instead of quoting them, so the licences are copied too.
mkdir -p "$root/usr/share/common-licenses"
grep -rhoE '/usr/share/common-licenses/[A-Za-z0-9.-]*[A-Za-z0-9]' "$root/usr/share/doc" | sort -u | while read -r licence; do
  [ ! -f "$licence" ] || cp -L "$licence" "$root/usr/share/common-licenses/"
done
