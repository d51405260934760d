#!/bin/bash
# Tries the wheel with the server as new users would, each in a fresh tree of Debian (debootstrap) that has neither compiler nor planish:
# pip installs it, ten lines work, a million triangles, a pool; pip removes it, and nothing is left. The Python packages that it needs are
# Debian's: those of Debian 11 (glibc 2.31; the oldest that there is a promise for), Debian 12, 13, and the newest that Debian has. Takes
# minutes, and so is no part of ctest.
#
#   tests/deploy/try_wheel.sh [DIST] [TREES] [SUITE...]      see try/trees.sh; SUITE: [bullseye bookworm trixie experimental]
# shellcheck disable=SC2016,SC2086  # text for shells inside; a list of words
set -euo pipefail
# shellcheck source=tests/deploy/try/trees.sh
source "$(dirname "${BASH_SOURCE[0]}")/try/trees.sh"
shift $(($# < 2 ? $# : 2))
[ $# -gt 0 ] || set -- bullseye bookworm trixie experimental

inside_path=/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
wheel=$(echo "$dist"/planish-*-manylinux_*.whl)
name=$(basename "$wheel")
[ "$(stat -c %s "$wheel")" -lt 35000000 ] || fail "$name has more than 35 MB"
for suite; do
  step "$name: Debian $suite"
  base=${suite/experimental/sid}
  fresh_tree "$base" "wheel-$suite"
  mirror=$(sources | awk '$3 !~ /-/ { print $2; exit }')
  echo "deb $mirror $base main" >"$tree/etc/apt/sources.list"
  from=
  if [ "$suite" = experimental ]; then
    echo "deb $mirror experimental main" >>"$tree/etc/apt/sources.list"
    from="-t experimental"
  fi
  # A mirror's copy of the newest may be some weeks old.
  echo 'Acquire::Check-Valid-Until "false";' >"$tree/etc/apt/apt.conf.d/valid"
  inside apt-get -qq update
  install python3-pip python3-grpcio python3-protobuf python3-numpy $from
  inside sh -c '! command -v cc planish planishd'
  inside python3 -c 'import importlib.metadata as m, platform as p
print("   glibc", p.libc_ver()[1], "Python", p.python_version(), *(name + " " + m.version(name) for name in ("grpcio", "protobuf", "numpy")))'
  all_files >"$work/before"

  # Debian asks for a virtual environment, or for this.
  rm -f "$tree"/usr/lib/python3*/EXTERNALLY-MANAGED
  cp "$wheel" "$source_tree/tests/deploy/try/wheel.py" "$mesh" "$tree/tmp/"
  inside pip install --no-index --root-user-action=ignore "/tmp/$name" >"$work/pip.log" 2>&1 ||
    inside pip install --no-index "/tmp/$name" >"$work/pip.log" 2>&1 || fail "pip: $(tail "$work/pip.log")"
  for what in ten million pool; do inside python3 -I /tmp/wheel.py "$what" || fail "$what"; done
  inside planish version
  inside sh -c "planish unwrap /tmp/${mesh##*/} -o /tmp/out.obj --progress=none --quiet && planishd --version >/tmp/version"
  grep -q '^vt ' "$tree/tmp/out.obj"
  licences=$(inside python3 -c 'import os, planish; print(os.path.dirname(planish.__file__))')/_server/share/doc
  for licence in planish/LICENSE libraries/libc6/copyright libraries/libgrpc29/copyright libraries/common-licenses/LGPL-2.1; do
    [ -s "$tree$licences/$licence" ] || fail "no $licence"
  done

  inside pip uninstall -y planish >"$work/pip.log" 2>&1 || fail "pip: $(tail "$work/pip.log")"
  all_files | grep -v EXTERNALLY-MANAGED >"$work/after"
  left=$(comm -13 <(grep -v EXTERNALLY-MANAGED "$work/before") "$work/after" | awk '!/__pycache__/ || /planish/')
  [ -z "$left" ] || fail "left behind: $left"
done
echo "All that was tried works."
