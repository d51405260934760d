#!/bin/bash
# What is in which package, and the directory of the relocatable tarball: that its programs find each other and their libraries wherever it is.
#
#   packages.sh BUILD SOURCE WORK
set -euo pipefail
build=$1 source=$2 work=$3
rm -rf "$work"
mkdir -p "$work"
fail() {
  echo "FAILED: $*"
  exit 1
}
files() { (cd "$1" && find . -type f -o -type l | sed 's/^\.//' | sort); }
has() { # PACKAGE PATTERN...: the files of a package are these and no others
  local package=$1 pattern
  shift
  DESTDIR=$work/$package cmake --install "$build" --component "$package" --prefix /usr >/dev/null
  files "$work/$package" >"$work/left"
  for pattern in "$@"; do
    grep -qE "^$pattern\$" "$work/left" || fail "$package has no $pattern"
    grep -vE "^$pattern\$" "$work/left" >"$work/rest" || true
    mv "$work/rest" "$work/left"
  done
  [ ! -s "$work/left" ] || fail "$package also has: $(cat "$work/left")"
}

has planish /usr/bin/planish /usr/share/man/man1/planish.1 '/usr/share/(bash-completion|zsh|fish)/.*/_?planish(\.fish)?' /usr/share/doc/planish/copyright
has planishd '/usr/bin/planishd(-farm)?' /usr/lib/systemd/system/planishd.service /etc/planish/planishd.yaml \
  /usr/share/man/man8/planishd.8 '/usr/share/(bash-completion|zsh|fish)/.*/_?planishd(\.fish)?' /usr/share/doc/planishd/copyright
has libplanish '/usr/lib/.*libplanish\.so\.[0-9.]+' '/usr/share/doc/libplanish[0-9]+/copyright'
has libplanish-dev '/usr/lib/.*libplanish\.so' '/usr/include/planish/[a-z_]+\.h' '/usr/lib/.*cmake/planish/[a-z-]+\.cmake' \
  '/usr/lib/.*pkgconfig/planish\.pc' '/usr/share/planish/proto/.*\.proto' /usr/share/doc/libplanish-dev/copyright
has python3-planish '/usr/lib/python3/dist-packages/planish/.*\.pyi?' '/usr/lib/python3/dist-packages/planish/py\.typed' \
  '/usr/lib/python3/dist-packages/planish-[0-9.]+\.dist-info/[A-Za-z_.]+' /usr/share/planish/planish_blender.zip \
  /usr/share/doc/python3-planish/copyright

# A plain `cmake --install` has nothing that is in no package, but for the unit and the configuration of machines without packages.
cmake --install "$build" --prefix "$work/prefix" >/dev/null
files "$work/prefix" | sed 's#^#/usr#' | grep -v '^/usr/share/planish/systemd/' >"$work/all"
for package in planish planishd libplanish libplanish-dev; do files "$work/$package"; done | sort >"$work/packaged"
[ -z "$(comm -23 "$work/all" "$work/packaged")" ] || fail "in no package: $(comm -23 "$work/all" "$work/packaged")"

# The unit is the sandboxed one, with the user that the package makes.
unit=$work/planishd/usr/lib/systemd/system/planishd.service
[ "$(grep -cxE 'User=planish|Group=planish|ExecStart=/usr/bin/planishd .*' "$unit")" = 3 ] || fail "the unit is not that of the package"
! grep -qE '^DynamicUser|cmake' "$unit" || fail "the unit is not that of the package"
diff <(grep -vE '^(#|DynamicUser=|ExecStart=)' "$source/deploy/systemd/planishd.service") \
  <(grep -vE '^(#|User=|Group=|ExecStart=)' "$unit") || fail "the units differ in more than the user"
for script in "$source"/deploy/packages/*/p*; do sh -n "$script"; done

# Nothing but the numbered namespace is visible.
library=$(find "$work/libplanish" -name 'libplanish.so.*' -type f)
exported=$(nm -DC --defined-only "$library" | cut -d ' ' -f 3-)
grep -q '^planish::abi[0-9]*::Client::Unwrap(' <<<"$exported" || fail "$library has no Client::Unwrap"
others=$(grep -vE '^((vtable|typeinfo|typeinfo name) for )?planish::abi[0-9]+::|^PLANISH_[0-9]+' <<<"$exported" || true)
[ -z "$others" ] || fail "also visible in $library: $others"
readelf -d "$library" | grep -qE "SONAME.*libplanish\.so\.$(sed -n 's/^set(PLANISH_ABI \([0-9]*\))/\1/p' "$source/CMakeLists.txt")\]" || fail "its soname"

# The tarball's directory. A thing in it that is missing would be taken from this machine: the loader says what it took.
"$source/deploy/relocatable.sh" "$build" "$work/prefix" "$work/made"
mv "$work/made" "$work/moved"
ln -s moved/bin/planish "$work/link"
version=$(PATH=/nowhere "$work/link" version)
[[ $version = *"($work/moved/bin/planishd;"* ]] || fail "planish does not find planishd: $version"
foreign=$(LD_DEBUG=libs "$work/moved/bin/planishd-farm" --version 2>&1 | sed -n 's/.*calling init: //p' | grep -v "^$work/moved/lib" || true)
[ -z "$foreign" ] || fail "libraries of this machine: $foreign"
env -u PLANISHD PATH=/nowhere "$work/link" unwrap "$source/tests/data/spot_seam.obj" -o "$work/out.obj" --progress=none
grep -q '^vt ' "$work/out.obj" || fail "no UV"
