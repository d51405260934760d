#!/bin/sh
# Installs the packages that the build needs, and builds a preset of CMakePresets.json into build/PRESET:
# $PLANISH_PRESET, or "default".
#
#   deploy/build.sh            server, command and library
#   deploy/build.sh --tests    the tests as well
set -eu
cd "$(dirname "$0")/.."

preset=${PLANISH_PRESET:-default}
tests=OFF
lists=build
if [ "${1:-}" = --tests ]; then
  tests=ON
  lists="build test"
elif [ $# -gt 0 ]; then
  echo "usage: $0 [--tests]" >&2
  exit 2
fi
# shellcheck disable=SC2086  # a list of words
deploy/install-packages.sh $lists

# As many compilers as cores, but not more than one for each 1.5 GB of free memory: gRPC's headers are heavy.
jobs=$(awk -v cores="$(nproc)" '/^MemAvailable:/ {
  fit = int($2 / 1572864); print (fit < 1 ? 1 : fit < cores ? fit : cores) }' /proc/meminfo)

if command -v ccache >/dev/null; then
  export CMAKE_CXX_COMPILER_LAUNCHER="${CMAKE_CXX_COMPILER_LAUNCHER-ccache}"
fi
echo "Building into build/$preset with $jobs jobs" >&2
mkdir -p build
cmake --preset "$preset" -DPLANISH_BUILD_TESTS=$tests >build/configure-"$preset".log 2>&1 || {
  cat build/configure-"$preset".log >&2
  exit 1
}
cmake --build --preset "$preset" --parallel "$jobs" >&2
