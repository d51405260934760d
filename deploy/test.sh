#!/bin/sh
# Installs what is needed, builds everything and runs all tests. Ends with "N passed, N failed[, N skipped]"
# and fails if a test failed, if none ran or if one was skipped that tests/allowed_skips.txt does not have.
# Further arguments go to ctest, e.g.: deploy/test.sh -R house_
# Of the preset PLANISH_PRESET, if that is set (deploy/sanitize.sh does). The file PLANISH_SUMMARY, if that is set, gets
# the lines about the run as well (.ci/run does).
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
ctest --preset "$preset" --parallel "$(nproc)" --output-junit "$report" "$@" </dev/null || status=$?

sanitized=
! grep -q '^PLANISH_SANITIZE:[A-Z]*=.' "$build/CMakeCache.txt" || sanitized=sanitized
deploy/test-report.sh "$report" "$log" tests/allowed_skips.txt $sanitized >"$summary" || status=$((status > 0 ? status : 1))
[ -z "${PLANISH_SUMMARY:-}" ] || cp "$summary" "$PLANISH_SUMMARY"
cat "$summary"
exit "$status"
