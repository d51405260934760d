#!/bin/sh
# Installs what is needed, builds with sanitizers and runs tests under them; a finding fails the test it is found by.
#
#   deploy/sanitize.sh address    address and undefined-behaviour sanitizers over everything, programs included
#   deploy/sanitize.sh thread     thread sanitizer over core and jobs: Debian's gRPC is not instrumented, and would
#                                 give false reports by the hundred
#
# Without tests of scripts, pages, packages and clients in other languages, which run little of our own code; without those of
# the shared meshes, as generated ones do the same to it; and without shares of time, of which slow code says nothing.
# Further arguments go to ctest. Ends like deploy/test.sh.
set -eu
cd "$(dirname "$0")/.."

case ${1:-} in
  address) preset=asan ;;
  thread) preset=tsan ;;
  *)
    echo "usage: $0 address|thread [CTEST-ARGUMENT...]" >&2
    exit 2
    ;;
esac
shift
export PLANISH_PRESET=$preset
exec deploy/test.sh -E '^(blender|deploy|house|interop|proto|python|report)_|SharedMeshes|TenantFlood.Shares' "$@"
