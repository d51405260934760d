#!/bin/sh
# Installs packages, builds with sanitizers and runs the tests. A sanitizer's finding fails its test.
#
#   deploy/sanitize.sh address    address and undefined-behaviour sanitizers over everything, programs included, but the
#                                 code that protoc makes
#   deploy/sanitize.sh thread     thread sanitizer over core and jobs: Debian's gRPC is not instrumented, and would
#                                 give false reports by the hundred
#
# Leaves out tests of scripts, pages, packages and clients in other languages, which run little of our own code; tests
# of the shared meshes, since generated ones run the same code; suites that run once more on PostgreSQL; and tests of
# figures and time ratios, which mean nothing in slow code. Further arguments go to ctest. Ends like deploy/test.sh.
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
exec deploy/test.sh -E '^quick_house$|^(blender|deploy|farm|house|interop|javascript|proto|python|report)_|^blobs_S3|SharedMeshes|TenantFlood|Ratchet|IsTheSameForASeed|Postgres/JobQueueStoreTest|Postgres/SharedUploads' "$@"
