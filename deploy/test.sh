#!/bin/sh
# Installs what is needed, builds everything and runs all tests. Ends with "N passed, N failed[, N skipped]"
# and fails if a test failed or none ran. Further arguments go to ctest, e.g.: deploy/test.sh -R house_
# Of the preset PLANISH_PRESET, if that is set (deploy/sanitize.sh does).
set -eu
cd "$(dirname "$0")/.."
preset=${PLANISH_PRESET:-default}
deploy/build.sh --tests

report=$PWD/build/$preset/test-report.xml
rm -f "$report"
status=0
ctest --preset "$preset" --parallel "$(nproc)" --output-junit "$report" "$@" </dev/null || status=$?

# <testsuite name=".." tests="N" failures="N" disabled="N" skipped="N" ..>
count() {
  sed -n '/<testsuite/,/>/s/.*[[:space:]]'"$1"'="\([0-9]*\)".*/\1/p' "$report" | head -n 1
}
if [ ! -s "$report" ]; then
  echo "deploy/test.sh: no test ran" >&2
  exit 1
fi
tests=$(count tests) failed=$(count failures) disabled=$(count disabled) skipped=$(count skipped)
skipped=$((skipped + disabled))
passed=$((tests - failed - skipped))
echo
if [ "$skipped" -gt 0 ]; then
  echo "$passed passed, $failed failed, $skipped skipped"
else
  echo "$passed passed, $failed failed"
fi
if [ "$status" -eq 0 ] && { [ "$failed" -gt 0 ] || [ "$passed" -eq 0 ]; }; then
  status=1
fi
exit "$status"
