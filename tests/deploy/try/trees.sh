# shellcheck shell=bash
# Fresh trees of Debian in which try_*.sh try what deploy/packages.sh made; they source this. Needs root, debootstrap and the mirrors that
# apt is configured with.
#
#   try_SOMETHING.sh [DIST] [TREES]      DIST: build/packages/dist; TREES: where fresh trees are kept for the next run
# shellcheck disable=SC2016,SC2034,SC2086  # text for shells inside and for apt; for those that source this; a list of words
set -euo pipefail
source_tree=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../.." && pwd)
dist=$(realpath "${1:-$source_tree/build/packages/dist}")
trees=$(realpath -m "${2:-$source_tree/build/packages/trees}")
mesh=$source_tree/tests/data/spot_seam.obj
work=$(mktemp -d /tmp/planish-try.XXXX)  # short: sockets are in it
pids=() mounts=()

clean_up() {
  local i
  for i in "${pids[@]}"; do kill "$i" 2>/dev/null || true; done
  wait 2>/dev/null || true
  for ((i = ${#mounts[@]} - 1; i >= 0; --i)); do umount "${mounts[i]}" || true; done
  # Never beyond a mount that is still there.
  rm -rf --one-file-system "$work"
}
trap clean_up EXIT
trap 'exit 130' INT TERM

step() { echo "== $*"; }
fail() {
  echo "FAILED: $*" >&2
  exit 1
}
# The mirrors of Debian in apt's configuration: lines "deb URI RELEASE COMPONENT".
sources() {
  apt-get indextargets --format 'deb $(REPO_URI) $(RELEASE) $(COMPONENT)' 'Created-By: Packages' 'Origin: Debian' | sort -u
}
# fresh_tree SUITE NAME: sets tree.
fresh_tree() {
  tree=$work/$2
  if [ ! -e "$trees/$1.tar" ]; then
    mkdir -p "$trees"
    debootstrap --variant=minbase "$1" "$work/new" "$(sources | awk '$3 !~ /-/ { print $2; exit }')" >"$work/debootstrap.log" ||
      fail "debootstrap $1: $(tail -n 3 "$work/debootstrap.log")"
    tar -C "$work/new" -cf "$trees/$1.tar" .
    rm -rf --one-file-system "$work/new"
  fi
  mkdir "$tree"
  tar -C "$tree" -xf "$trees/$1.tar"
  mount_into "$tree"
}
mount_into() {
  mkdir -p "$1/proc" "$1/dev" "$1/tmp"
  mount -t proc proc "$1/proc" && mounts+=("$1/proc")
  mount --bind /dev "$1/dev" && mounts+=("$1/dev")
}
inside() {
  env -i PATH="${inside_path:-/usr/sbin:/usr/bin:/sbin:/bin}" HOME=/root LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive ${inside_environment:-} \
    "$(command -v chroot)" "$tree" "$@"
}
# The UV of the corners of an OBJ file's faces, in order: what two ways to unwrap must agree in.
corner_uv() {
  awk '$1 == "vt" { uv[++n] = $2 " " $3 } $1 == "f" { for (i = 2; i <= NF; ++i) { split($i, c, "/"); print uv[c[2]] } }' "$1"
}
same_uv() {
  python3 - "$1" "$2" <<'END' || fail "the UV of $1 and $2 differ"
import struct, sys
a, b = ([struct.pack("2f", *map(float, line.split())) for line in open(name)] for name in sys.argv[1:])
assert a == b and len(a) > 0, (len(a), len(b))
print(f"   the same UV at {len(a)} corners")
END
}
wait_for() {
  local i
  for ((i = 0; i < 100; ++i)); do
    ! "$@" >/dev/null 2>&1 || return 0
    sleep 0.1
  done
  fail "waited in vain: $*"
}
# install PACKAGE...: from Debian, into the tree.
install() {
  inside sh -c "apt-get -qq install -y --no-install-recommends $*" >"$work/apt.log" 2>&1 || fail "apt-get: $(tail -n 20 "$work/apt.log")"
}
# Files that there are inside, but for those of temporary directories and of the system's own making.
all_files() {
  inside find / -xdev -not -path '/proc*' -not -path '/dev*' -not -path '/tmp*' -not -path '/var/*' -not -path '/root/.cache*' | sort
}
