#!/bin/sh
# Installs the Debian 12 packages that planish needs, unless they are there. All packages are listed here; the other
# scripts and the Dockerfile call this script.
#
#   deploy/install-packages.sh build|test|packaging|bench|clang|fuzz|runtime...
#
# Needs root or sudo only if packages are missing.
set -eu

# The compiler, the libraries that CMakeLists.txt looks for, and the code generators of gRPC.
build="
  g++ cmake ninja-build
  libgrpc++-dev protobuf-compiler-grpc protobuf-compiler libprotobuf-dev libabsl-dev
  libeigen3-dev libopenmesh-dev libdraco-dev libmeshoptimizer-dev
  libpng-dev libjpeg62-turbo-dev libwebp-dev zlib1g-dev libsqlite3-dev libpq-dev libseccomp-dev libcli11-dev libspdlog-dev nlohmann-json3-dev libssl-dev
  libyaml-cpp-dev prometheus-cpp-dev libcpp-httplib-dev libcurl4-openssl-dev libexpat1-dev
  libutf8proc-dev"

# For the tests. PROGRAM:PACKAGE means: install the package unless the program is already there, from any source.
# Blender, Node.js and kubectl are used if they are installed; tests/allowed_skips.txt says why they are not here.
test="
  libgtest-dev libgmock-dev postgresql-15
  python3-grpcio python3-protobuf python3-numpy python3-setuptools python3-wheel
  chromium:chromium haproxy:haproxy nginx:nginx promtool:prometheus sqlite3:sqlite3 zsh:zsh fish:fish man:man-db openssl:openssl"

# For tests/bench/run.sh: gnuplot draws its plots, and it compares planish with CGAL and Blender. If Blender is
# installed, a test of tests/files also has it read the files that planish writes; its glTF importer needs numpy.
# ImageMagick labels pictures in DejaVu Sans.
bench="gnuplot-nox libcgal-dev blender imagemagick fonts-dejavu-core python3-numpy"

# For the preset "clang" and deploy/each-source.sh.
clang="clang-14"

# For deploy/fuzz.sh: libFuzzer, and names of functions in its reports.
fuzz="$clang libclang-rt-14-dev llvm-14"

# For deploy/packages.sh: setuptools makes the wheel, dpkg-dev finds the dependencies of packages.
packaging="python3-setuptools python3-wheel dpkg-dev xz-utils"

# For the installed programs. `planish` needs the certificates for servers whose certificate is from a public authority.
runtime="
  libgrpc++1.51 libgrpc29 libprotobuf32 libabsl20220623 libopenmesh1 libdraco7 libmeshoptimizer2d
  libpng16-16 libjpeg62-turbo libwebp7 zlib1g libsqlite3-0 libpq5 libcurl4 libexpat1 libseccomp2 libspdlog1.10 libfmt9 libssl3
  libyaml-cpp0.7 libprometheus-cpp-core1.0 libcpp-httplib0.11 libutf8proc2 ca-certificates"

fail() {
  echo "install-packages: $*" >&2
  exit 1
}

[ $# -gt 0 ] || fail "usage: $0 build|test|packaging|bench|clang|fuzz|runtime..."
wanted=
for list in "$@"; do
  case $list in
    build) wanted="$wanted $build" ;;
    test) wanted="$wanted $test" ;;
    packaging) wanted="$wanted $packaging" ;;
    bench) wanted="$wanted $bench" ;;
    clang) wanted="$wanted $clang" ;;
    fuzz) wanted="$wanted $fuzz" ;;
    runtime) wanted="$wanted $runtime" ;;
    *) fail "no such list: $list (build, test, packaging, bench, clang, fuzz, runtime)" ;;
  esac
done

command -v dpkg-query >/dev/null && command -v apt-get >/dev/null ||
  fail "this is not a Debian system. planish is built on Debian 12; anywhere else, use the Dockerfile."

# Sets `missing` to those packages of `wanted` that are not installed.
find_missing() {
  installed=$(dpkg-query -W -f='${db:Status-Status} ${Package}\n' | sed -n 's/^installed //p')
  missing=
  for package in $wanted; do
    case $package in *:*) ! command -v "${package%:*}" >/dev/null || continue ;; esac
    package=${package#*:}
    printf '%s\n' "$installed" | grep -qxF "$package" || missing="$missing $package"
  done
}
find_missing
[ -n "$missing" ] || exit 0

release=$(. /etc/os-release && echo "${ID:-} ${VERSION_ID:-}")
[ "$release" = "debian 12" ] || echo "install-packages: written for Debian 12, this is: $release" >&2

sudo=
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || fail "neither root nor sudo. As root, run: apt-get install$missing"
  sudo=sudo
fi

# One run at a time, since the first to end would remove policy-rc.d, which the others need. The lock is on a directory
# that every Debian has, and ends with this process.
exec 9</var/lib/dpkg
flock 9
find_missing
[ -n "$missing" ] || exit 0

log=$(mktemp)
policy=/usr/sbin/policy-rc.d
mark="of planish's install-packages"
cluster=/etc/postgresql-common/createcluster.d/planish.conf
our_policy=''
our_cluster=''
before=''
enabled_services() {
  find /etc/systemd/system/multi-user.target.wants -name '*.service' 2>/dev/null | sort
}
# Runs when the script ends, also after a failure or a signal: services that were installed by then must not start at
# boot either.
clean_up() {
  if [ -n "$before" ]; then
    for unit in $(enabled_services); do
      ! printf '%s\n' "$before" | grep -qxF "$unit" || continue
      service=$(basename "$unit" .service)
      echo "The service stays off: $service (systemctl enable --now $service would start it)" >&2
      $sudo update-rc.d "$service" disable >"$log" 2>&1 || cat "$log" >&2
    done
  fi
  [ -z "$our_policy" ] || $sudo rm -f "$policy"
  [ -z "$our_cluster" ] || $sudo rm -f "$cluster"
  rm -f "$log"
}
trap clean_up EXIT
trap 'exit 129' HUP
trap 'exit 130' INT
trap 'exit 143' TERM
apt() {
  $sudo env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=300 -o Acquire::Retries=3 "$@" \
    </dev/null >"$log" 2>&1 9<&- || {
    cat "$log" >&2
    fail "apt-get $1 failed; it was to install:$missing"
  }
}

echo "Installing Debian packages:$missing" >&2
[ -z "$sudo" ] || $sudo -v  # asks for the password, if one is needed, while people can see it
apt update

# The tests need programs, but no running services. Packages ask policy-rc.d before they start a service; ours forbids
# it. An existing policy-rc.d is not touched, unless an earlier run of this script was killed and left it. PostgreSQL's
# package would also create a cluster; the tests create their own, in temporary folders.
before=$(echo "before:"; enabled_services)
if ! [ -e "$policy" ] || grep -qF "$mark" "$policy"; then
  our_policy=yes
  # shellcheck disable=SC2016  # for the inner shell
  $sudo sh -c 'printf "#!/bin/sh\n# %s\nexit 101\n" "$2" >"$1" && chmod 755 "$1"' sh "$policy" "$mark"
fi
case $missing in
  *postgresql*)
    our_cluster=yes
    $sudo mkdir -p "${cluster%/*}"
    echo "create_main_cluster = false" | $sudo tee "$cluster" >/dev/null
    ;;
esac
# shellcheck disable=SC2086  # a list of words
apt install -y --no-install-recommends $missing
