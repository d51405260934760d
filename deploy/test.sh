#!/bin/sh
# Installs packages, builds everything and runs all tests. Ends with "N passed, N failed[, N skipped]". Fails if a test
# failed, if no test ran, or if a test was skipped that tests/allowed_skips.txt does not list.
#
#   deploy/test.sh [CTEST-ARGUMENT...]    for instance: deploy/test.sh -R house_
#
# Uses the preset $PLANISH_PRESET if that is set (by deploy/sanitize.sh). Also writes the result lines to the file
# $PLANISH_SUMMARY if that is set (by .ci/run).
set -eu
cd "$(dirname "$0")/.."
preset=${PLANISH_PRESET:-default}
deploy/build.sh --tests

build=$PWD/build/$preset
report=$build/test-report.xml
log=$build/Testing/Temporary/LastTest.log
summary=$build/test-summary.txt
rm -f "$report" "$log"
status=0
# Runs one test more than there are cores at a time, since many tests wait for servers and disks.
ctest --preset "$preset" --parallel "$(($(nproc) + 1))" --output-junit "$report" "$@" </dev/null || status=$?

sanitized=
! grep -q '^PLANISH_SANITIZE:[A-Z]*=.' "$build/CMakeCache.txt" || sanitized=sanitized
deploy/test-report.sh "$report" "$log" tests/allowed_skips.txt $sanitized >"$summary" || status=$((status > 0 ? status : 1))
[ -z "${PLANISH_SUMMARY:-}" ] || cp "$summary" "$PLANISH_SUMMARY"
cat "$summary"
exit "$status"
