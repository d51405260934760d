#!/bin/sh
# Reports the result of a run of ctest. Fails if a test failed, if no test passed, or if a test was skipped that may not
# be. Ends with "N passed, N failed[, N skipped]". deploy/test.sh calls it.
#
#   deploy/test-report.sh REPORT LOG ALLOWED_SKIPS [sanitized]
#
# REPORT is ctest's JUnit file, which has the last try of each test. LOG is its LastTest.log, which has every try. If a
# test of ctest runs several cases of a GoogleTest program NAME_test, each case counts, under the name NAME_Suite.Case.
# The report names tests that failed and then passed (ctest --repeat). A test counts as failed if a sanitizer's report
# is in the output of any try, from the test or from a process it started, even if it passed. Faults that
# server/worker/failpoints.cc injects do not count. Below the name of a failed test are lines of its output in the last
# try: those from GoogleTest's first "Failure" on, or the last ones. ALLOWED_SKIPS is tests/allowed_skips.txt, which
# explains itself. `sanitized`: the programs were built with a sanitizer.
set -eu
report=$1 log=$2 allowed=$3 sanitized=${4:-}
tab=$(printf '\t')

fail() {
  echo "test-report: $*" >&2
  exit 1
}
[ -s "$report" ] || fail "no test ran: there is no $report"
[ -s "$log" ] || fail "there is no $log"
[ -r "$allowed" ] || fail "there is no $allowed"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Prints STATUS, a tab and NAME of every test of ctest. The status "notrun" means a skipped test, or a test that could
# not run (a missing program or file), which counts as failed.
awk '
  function flush() { if (name != "") print result "\t" name; name = "" }
  /^[[:space:]]*<testcase / {
    flush()
    match($0, / name="[^"]*"/)
    name = substr($0, RSTART + 7, RLENGTH - 8)
    gsub(/&lt;/, "<", name); gsub(/&gt;/, ">", name); gsub(/&quot;/, "\"", name); gsub(/&apos;/, "\047", name)
    gsub(/&amp;/, "\\&", name)
    result = / status="run"/ ? "passed" : / status="disabled"/ ? "skipped" : "failed"
  }
  /^[[:space:]]*<skipped message="SKIP_/ { result = "skipped" }
  END { flush() }' "$report" >"$work/tests"

# Prints RESULT, NAME, the test of ctest and the case of GoogleTest, separated by tabs, for every test and case. A case
# that began and did not end has failed.
awk -F '\t' '
  FNR == 1 { ++file }
  file == 1 && /^[0-9]+\/[0-9]+ Test: / {
    test = $0; sub(/^[0-9]+\/[0-9]+ Test: /, "", test)
    count[test] = 0
  }
  file == 1 && /^Command: / {
    program = $0; sub(/^Command: "/, "", program); sub(/".*/, "", program); sub(/.*\//, "", program)
    sub(/_test$/, "", program)
  }
  file == 1 && match($0, /\[ RUN      \] [^ ,]+/) {
    cases[test, ++count[test]] = substr($0, RSTART + 13, RLENGTH - 13)
    results[test, count[test]] = "failed"
    programs[test] = program
  }
  # The result need not begin its line: the case may have printed text without a line break before it.
  file == 1 && count[test] && match($0, /\[(       OK |  SKIPPED )\] [^ ,]+/) && substr($0, RSTART + 13, RLENGTH - 13) == cases[test, count[test]] {
    results[test, count[test]] = substr($0, RSTART, 12) ~ /OK/ ? "passed" : "skipped"
  }
  file == 2 {
    bad = 0
    for (i = 1; i <= count[$2]; ++i) {
      print results[$2, i] "\t" programs[$2] "_" cases[$2, i] "\t" $2 "\t" cases[$2, i]
      if (results[$2, i] == "failed") bad = 1
    }
    if (!count[$2] || ($1 == "failed" && !bad)) print $1 "\t" $2 "\t" $2 "\t"
  }' "$log" "$work/tests" >"$work/results"

# Prints "finding", a tab and NAME for every try that printed a sanitizer's report, and "failed", a tab and NAME for
# every other try that failed.
awk '
  /^[0-9]+\/[0-9]+ Test: / { name = $0; sub(/^[0-9]+\/[0-9]+ Test: /, "", name); reports = 0; over = 0 }
  /ERROR: (Address|Leak|Thread)Sanitizer|WARNING: ThreadSanitizer|runtime error: / { ++reports }
  /^SUMMARY: AddressSanitizer: .*\/server\/worker\/failpoints\.cc:/ { --reports }
  $0 == "<end of output>" { over = 1 }
  over && reports > 0 { print "finding\t" name; over = 0 }
  over && /^Test Fail/ { print "failed\t" name; over = 0 }' "$log" >"$work/tries"

# print_output TEST [CASE]: prints at most 16 lines of the output of TEST's last try (with CASE, of that case only),
# each after "  | ".
print_output() {
  NAME=$1 CASE=${2:-} awk -v most=16 '
    /^[0-9]+\/[0-9]+ Test: / {
      name = $0; sub(/^[0-9]+\/[0-9]+ Test: /, "", name)
      ours = name == ENVIRON["NAME"]; inside = 0
      if (ours) { count = 0; failure = 0 }
    }
    $0 == "<end of output>" { inside = 0 }
    ours && inside > 1 && match($0, /\[ RUN      \] [^ ,]+/) {
      other = ENVIRON["CASE"] != "" && substr($0, RSTART + 13, RLENGTH - 13) != ENVIRON["CASE"]
    }
    ours && inside > 1 && !other { lines[++count] = $0; if (!failure && / Failure$/) failure = count }
    ours && inside == 1 { inside = 2; other = ENVIRON["CASE"] != "" }  # the line under "Output:"
    ours && /^Output:$/ && !inside { inside = 1 }
    END {
      first = failure ? failure : count - most + 1
      for (i = first; i < first + most; ++i) if (i in lines && i <= count) print "  | " substr(lines[i], 1, 300)
    }' "$log"
}

# holds WHEN: succeeds if the condition WHEN of tests/allowed_skips.txt is true, and returns 2 if there is no such one.
holds() {
  case $1 in
    any) ;;
    sanitized) [ -n "$sanitized" ] ;;
    root) [ "$(id -u)" -eq 0 ] ;;
    user) [ "$(id -u)" -ne 0 ] ;;
    no:*/*) [ ! -e "${1#no:}" ] ;;
    no:?*) ! command -v "${1#no:}" >/dev/null ;;
    *) return 2 ;;
  esac
}
grep -v -e '^[[:space:]]*#' -e '^[[:space:]]*$' "$allowed" >"$work/allowed" || true
while read -r pattern when reason; do
  [ -n "$reason" ] || fail "$allowed: a line without a reason: $pattern $when"
  code=0
  holds "$when" || code=$?
  [ "$code" -lt 2 ] || fail "$allowed: no such condition: $when"
done <"$work/allowed"

# find_reason NAME: sets `reason` from the line that allows the test NAME to be skipped here and now. Fails if there is
# none.
find_reason() {
  while read -r pattern when reason; do
    # shellcheck disable=SC2254  # a pattern
    case $1 in $pattern) if holds "$when"; then return 0; fi ;; esac
  done <"$work/allowed"
  return 1
}

passed=0 failed=0 skipped=0 unlisted=
: >"$work/reasons"
echo
while IFS=$tab read -r result name test case; do
  case $result in
    passed) passed=$((passed + 1)) ;;
    failed)
      failed=$((failed + 1))
      echo "FAILED: $name"
      print_output "$test" "$case"
      ;;
    skipped)
      if find_reason "$name"; then
        skipped=$((skipped + 1))
        echo "$reason" >>"$work/reasons"
      else
        failed=$((failed + 1))
        unlisted=yes
        echo "FAILED: $name was skipped, and tests/allowed_skips.txt does not allow that here"
      fi
      ;;
  esac
done <"$work/results"
while IFS=$tab read -r result name; do
  [ "$result" = passed ] || continue
  if grep -qxF "finding$tab$name" "$work/tries"; then
    passed=$((passed - 1)) failed=$((failed + 1))
    echo "FAILED: $name passed, but a sanitizer's report was printed meanwhile (see $log)"
  elif grep -qxF "failed$tab$name" "$work/tries"; then
    echo "REPEATED: $name failed, and passed when it was repeated"
  fi
done <"$work/tests"
if [ -n "$unlisted" ]; then
  echo "$log has what a skipped test printed. Make it run: deploy/install-packages.sh has the packages that tests need."
  echo "Or put it and the reason into tests/allowed_skips.txt."
fi
if [ "$skipped" -gt 0 ]; then
  echo "Skipped, as tests/allowed_skips.txt allows:"
  sort "$work/reasons" | uniq -c
fi
[ "$passed" -gt 0 ] || echo "No test passed."
if [ "$skipped" -gt 0 ]; then
  echo "$passed passed, $failed failed, $skipped skipped"
else
  echo "$passed passed, $failed failed"
fi
[ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
