#!/bin/bash
# Tries what deploy/packages.sh made as new users would, each in a fresh tree of Debian (debootstrap): the Debian packages in Debian 12; the
# tarball in Debian 12 without any of its libraries, in Debian 11 (glibc 2.31) and in a tree with nothing else in it at all. Needs root,
# debootstrap and the mirrors that apt is configured with. Takes minutes, and so is no part of ctest.
#
#   tests/deploy/try_packages.sh [DIST] [TREES]      see try/trees.sh
#
# Blender is that of this machine, if it has one, with the packaged add-on, command and server.
# shellcheck disable=SC2016,SC2086  # text for shells inside and for apt; a list of words
set -euo pipefail
# shellcheck source=tests/deploy/try/trees.sh
source "$(dirname "${BASH_SOURCE[0]}")/try/trees.sh"

step "Debian 12: the packages"
fresh_tree bookworm debian
sources >"$tree/etc/apt/sources.list"
mkdir "$tree/packages"
cp "$dist"/*.deb "$tree/packages/"
inside apt-get -qq update
inside sh -c 'apt-get -qq install -y --no-install-recommends /packages/*.deb' >"$work/apt.log" 2>&1 || fail "apt-get: $(tail -n 20 "$work/apt.log")"
inside dpkg --verify planish planishd libplanish0 libplanish-dev python3-planish
inside sh -c '[ "$(stat -c "%U %a" /var/lib/planish)" = "planish 700" ] && test -f /etc/planish/planishd.yaml' || fail "user or files"
inside planish version
inside planishd --check-config --config=/etc/planish/planishd.yaml
cp "$mesh" "$tree/tmp/mesh.obj"

step "Debian 12: planish unwrap, with a private server"
inside planish unwrap /tmp/mesh.obj -o /tmp/private.obj --precision=float --progress=none

step "Debian 12: planishd as its unit starts it, and planish unwrap against it"
(exec env -i PATH="$PATH" LANG=C.UTF-8 chroot --userspec=planish:planish "$tree" /usr/bin/planishd --config=/etc/planish/planishd.yaml --data-dir=/var/lib/planish \
  --listen=unix:/var/lib/planish/socket --log-level=warn) &
pids+=($!)
wait_for test -S "$tree/var/lib/planish/socket"
inside planish unwrap /tmp/mesh.obj -o /tmp/served.obj --precision=float --server=unix:/var/lib/planish/socket --progress=none
cmp "$tree/tmp/private.obj" "$tree/tmp/served.obj"
corner_uv "$tree/tmp/served.obj" >"$work/expected"

step "Debian 12: import planish, ten lines, live progress"
cp "$source_tree/tests/deploy/try/unwrap_arrays.py" "$tree/tmp/"
inside_environment=PLANISH_SERVER=unix:/var/lib/planish/socket inside python3 /tmp/unwrap_arrays.py /tmp/mesh.obj /tmp/python.txt >"$work/said"
[ "$(grep -c '^progress: solve' "$work/said")" -ge 3 ] || fail "no progress: $(cat "$work/said")"
tail -n 1 "$work/said"
same_uv "$work/expected" "$tree/tmp/python.txt"
# The packages of Debian are what pip sees.
inside python3 -c 'import importlib.metadata as m; assert m.version("planish") == __import__("planish").__version__'

step "Debian 12: a program in C++, by pkg-config and by CMake"
inside sh -c 'apt-get -qq install -y --no-install-recommends g++ cmake make pkgconf' >"$work/apt.log" 2>&1 || fail "apt-get: $(tail -n 20 "$work/apt.log")"
cp -r "$source_tree/tests/e2e/consumer" "$tree/tmp/"
inside sh -c 'c++ -std=c++20 /tmp/consumer/main.cc -o /tmp/by_pkg_config $(pkg-config --cflags --libs planish) && /tmp/by_pkg_config /usr/bin/planishd'
inside sh -c 'cmake -S /tmp/consumer -B /tmp/build >/dev/null && cmake --build /tmp/build >/dev/null && /tmp/build/consumer /usr/bin/planishd'

if command -v blender >/dev/null; then
  step "Blender of this machine: the packaged add-on, on the packaged server"
  mkdir -p "$work/shared" "$tree$work/shared"
  mount --bind "$work/shared" "$tree$work/shared" && mounts+=("$tree$work/shared")
  printf '#!/bin/sh\nexec chroot %s /usr/bin/planishd "$@"\n' "$tree" >"$work/planishd"
  printf '#!/bin/sh\nexec env -u PLANISHD chroot %s /usr/bin/planish "$@"\n' "$tree" >"$work/planish"
  chmod 755 "$work/planishd" "$work/planish"
  TMPDIR=$work/shared PLANISHD=$work/planishd PLANISH_COMMAND=$work/planish PLANISH_SOURCE_TREE=$source_tree PYTHONDONTWRITEBYTECODE=1 \
    PLANISH_ADDON=$tree/usr/share/planish/planish_blender.zip \
    "$source_tree/tests/client/blender/run.sh" "$source_tree/tests/client/blender/test_addon.py" \
    AddOn.test_marked_seams_are_kept_exactly AddOn.test_uv_are_those_of_the_command_for_the_same_triangles >"$work/blender.log" 2>&1 ||
    fail "$(tail -n 40 "$work/blender.log")"
  grep -E '^(Ran|OK)' "$work/blender.log"
else
  echo "NOT TRIED: there is no blender on this machine"
fi

step "Debian 12: the same packages again, and removal of the programs"
inside sh -c 'apt-get -qq install -y --reinstall --no-install-recommends /packages/*.deb' >"$work/apt.log" 2>&1 || fail "apt-get: $(tail -n 20 "$work/apt.log")"
kill "${pids[-1]}"
wait "${pids[-1]}" || true
inside apt-get -qq purge -y planish planishd >"$work/apt.log" 2>&1 || fail "$(tail -n 20 "$work/apt.log")"

step "Debian 12: PrivateServer finds the tarball in PATH, in C++ and Python"
tarball=$(echo "$dist"/planish-*-linux-*.tar.xz)
name=$(basename "$tarball" .tar.xz)
tar -C "$tree/opt" -xf "$tarball"
inside_path=/opt/$name/bin:/usr/bin:/bin
inside /tmp/build/consumer ""
inside python3 /tmp/unwrap_arrays.py /tmp/mesh.obj /tmp/python.txt | tail -n 1
same_uv "$work/expected" "$tree/tmp/python.txt"
unset inside_path

step "Debian 12: purge"
inside apt-get -qq purge -y libplanish0 libplanish-dev python3-planish >"$work/apt.log" 2>&1 || fail "$(tail -n 20 "$work/apt.log")"
left=$(inside find / -xdev -path '*planish*' -not -path '/packages*' -not -path '/tmp*' -not -path '/opt*' -not -path '/proc*' -not -path '/dev*' | head)
[ -z "$left" ] || fail "left behind: $left"

for suite in bookworm bullseye; do
  step "The tarball in Debian $suite, without any of its libraries"
  fresh_tree $suite "tarball-$suite"
  ! inside ldconfig -p | grep -E 'grpc|protobuf|draco|OpenMesh|abseil' || fail "this tree has libraries of planish"
  inside getconf GNU_LIBC_VERSION
  mkdir -p "$tree/opt"
  tar -C "$tree/opt" -xf "$tarball"
  mv "$tree/opt/$name" "$tree/opt/moved"
  cp "$mesh" "$tree/tmp/mesh.obj"
  inside /opt/moved/bin/planish unwrap /tmp/mesh.obj -o /tmp/out.obj --precision=float --progress=none
  corner_uv "$tree/tmp/out.obj" >"$work/actual"
  same_uv "$work/expected" "$work/actual"
  # By a link, by PATH, and by workers that are processes of their own (a mesh of their own each).
  ln -s /opt/moved/bin/planish "$tree/usr/local/bin/planish"
  inside /usr/local/bin/planish unwrap /tmp/mesh.obj -o /tmp/linked.obj --precision=float --progress=none
  inside /opt/moved/bin/planishd-farm --version
done

step "The tarball alone: no C library, no shell"
tree=$work/alone
mkdir -p "$tree/opt"
mount_into "$tree"
tar -C "$tree/opt" -xf "$tarball"
cp "$mesh" "$tree/tmp/mesh.obj"
inside "/opt/$name/bin/planish" unwrap /tmp/mesh.obj -o /tmp/out.obj --precision=float --progress=none
corner_uv "$tree/tmp/out.obj" >"$work/actual"
same_uv "$work/expected" "$work/actual"

echo "All that was tried works."
