#!/bin/sh
# Installs the Debian 12 packages that planish needs, and only those that are missing. The one place where
# they are listed: the scripts beside this one and the Dockerfile call it.
#
#   deploy/install-packages.sh build|test|bench|fuzz|runtime...
#
# Needs root or sudo when something is missing, and nothing at all when everything is there.
set -eu

# The compiler, the libraries that CMakeLists.txt looks for, and the code generators of gRPC.
# OpenBLAS without threads: a worker is one thread wide, and CHOLMOD factorizes two to three times as fast on it
# as on the reference BLAS that libsuitesparse-dev would bring.
build="
  g++ cmake ninja-build
  libgrpc++-dev protobuf-compiler-grpc protobuf-compiler libprotobuf-dev libabsl-dev
  libeigen3-dev libdraco-dev libsuitesparse-dev libopenblas-serial-dev
  libpng-dev libsqlite3-dev libseccomp-dev libcli11-dev libspdlog-dev nlohmann-json3-dev libssl-dev
  libyaml-cpp-dev prometheus-cpp-dev libcpp-httplib-dev"

# What only the tests need. tests/interop also uses node and npm where they are installed already.
test="libgtest-dev libgmock-dev"

# What only tests/bench/run.sh needs: plots, and the programs of others that it measures. tests/io reads its files with
# Blender as well where that is installed (its glTF importer needs numpy).
bench="gnuplot-nox libcgal-dev blender python3-numpy"

# What only deploy/fuzz.sh needs: a compiler with libFuzzer, its OpenMP, and names of functions in its reports.
fuzz="clang-14 libclang-rt-14-dev libomp-14-dev llvm-14"

# What the installed programs need; the certificates are for `planish` and servers that have one of a public authority.
runtime="
  libgrpc++1.51 libgrpc29 libprotobuf32 libabsl20220623 libdraco7 libcholmod3 libopenblas0-serial
  libpng16-16 libsqlite3-0 libseccomp2 libgomp1 libspdlog1.10 libfmt9 libssl3
  libyaml-cpp0.7 libprometheus-cpp-core1.0 libcpp-httplib0.11 ca-certificates"

fail() {
  echo "install-packages: $*" >&2
  exit 1
}

[ $# -gt 0 ] || fail "usage: $0 build|test|bench|fuzz|runtime..."
wanted=
for list in "$@"; do
  case $list in
    build) wanted="$wanted $build" ;;
    test) wanted="$wanted $test" ;;
    bench) wanted="$wanted $bench" ;;
    fuzz) wanted="$wanted $fuzz" ;;
    runtime) wanted="$wanted $runtime" ;;
    *) fail "no such list: $list (build, test, bench, fuzz, runtime)" ;;
  esac
done

command -v dpkg-query >/dev/null && command -v apt-get >/dev/null ||
  fail "this is not a Debian system. planish is built on Debian 12; anywhere else, use the Dockerfile."

installed=$(dpkg-query -W -f='${db:Status-Status} ${Package}\n' | sed -n 's/^installed //p')
missing=
for package in $wanted; do
  printf '%s\n' "$installed" | grep -qxF "$package" || missing="$missing $package"
done
[ -n "$missing" ] || exit 0

release=$(. /etc/os-release && echo "${ID:-} ${VERSION_ID:-}")
[ "$release" = "debian 12" ] || echo "install-packages: written for Debian 12, this is: $release" >&2

sudo=
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || fail "neither root nor sudo. As root, run: apt-get install$missing"
  sudo=sudo
fi

log=$(mktemp)
trap 'rm -f "$log"' EXIT
apt() {
  $sudo env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=300 -o Acquire::Retries=3 "$@" \
    </dev/null >"$log" 2>&1 || {
    cat "$log" >&2
    fail "apt-get $1 failed; it was to install:$missing"
  }
}
echo "Installing Debian packages:$missing" >&2
[ -z "$sudo" ] || $sudo -v  # asks for the password, if one is needed, while people can see it
apt update
# shellcheck disable=SC2086  # a list of words
apt install -y --no-install-recommends $missing
