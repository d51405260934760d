#!/bin/bash
# What deploy/test-report.sh makes of reports, and what .ci/run says of its parts.
#   ci.sh SOURCE_DIR WORK_DIR
set -eu
source=$1
work=$2
rm -rf "$work"
mkdir -p "$work"
cd "$work"

failures=0
# `run COMMAND...`, and then `expect CODE TEXT...`: it ended with that code and printed each text, a pattern of bash.
run() {
  code=0
  "$@" >printed.txt 2>&1 </dev/null || code=$?
  printed=$(cat printed.txt)
}
expect() {
  local text wrong=
  [ "$code" -eq "$1" ] || wrong="exit code $code, not $1"
  for text in "${@:2}"; do
    # shellcheck disable=SC2053  # a pattern
    [[ $printed == *$text* ]] || wrong="$wrong; not printed: $text"
  done
  [ -n "$wrong" ] || return 0
  printf 'line %s: %s\n%s\n----\n' "${BASH_LINENO[0]}" "$wrong" "$printed"
  failures=$((failures + 1))
}

# --- Reports. case_of NAME STATUS [SKIPPED_BECAUSE], as ctest 3.25 writes it.
case_of() {
  printf '\t<testcase name="%s" classname="%s" time="0.1" status="%s">\n' "$1" "$1" "$2"
  [ -z "${3:-}" ] || printf '\t\t<skipped message="%s"/>\n' "$3"
  printf '\t\t<system-out>&lt;skipped message="SKIP_&gt; \n</system-out>\n\t</testcase>\n'
}
# try_of NAME Passed|Failed OUTPUT: one try in ctest's LastTest.log.
try_of() {
  printf '1/9 Testing: %s\n1/9 Test: %s\nCommand: "x"\nOutput:\n---\n%s\n<end of output>\nTest time = 1 sec\n---\nTest %s.\n' \
    "$1" "$1" "$3" "$2"
}
report() {
  { echo '<testsuite name="x" tests="9">'; cat; echo '</testsuite>'; } >report.xml
}
read_report() {
  run "$source/deploy/test-report.sh" report.xml log.txt allowed.txt "$@"
}
cat >allowed.txt <<'END'
# A comment.

a_Suite.*  any  nobody has it
b_Case/*   no:no-such-program-anywhere  the program is rare
c_Case     no:sh  a shell is rare
d_Case     no:./allowed.txt  the file is rare
e_Case     sanitized  too slow then
END
try_of x Passed "" >log.txt

{
  case_of good run
  case_of "a_Suite.X/0  # GetParam() = &quot;x&quot;" notrun SKIP_RETURN_CODE=77
  case_of "b_Case/&lt;int&gt;" notrun SKIP_REGULAR_EXPRESSION_MATCHED
} | report
read_report
expect 0 "1 nobody has it" "1 the program is rare" $'\n1 passed, 0 failed, 2 skipped'
{ case_of good run; case_of other notrun SKIP_RETURN_CODE=77; case_of off disabled; } | report
read_report
expect 1 "other was skipped" "off was skipped" $'\n1 passed, 2 failed'
{ case_of good run; case_of c_Case notrun SKIP_RETURN_CODE=77; case_of d_Case notrun SKIP_RETURN_CODE=77; } | report
read_report
expect 1 "c_Case was skipped" "d_Case was skipped" $'\n1 passed, 2 failed'
{ case_of good run; case_of e_Case notrun SKIP_RETURN_CODE=77; } | report
read_report
expect 1 "e_Case was skipped"
read_report sanitized
expect 0 "1 too slow then" $'\n1 passed, 0 failed, 1 skipped'
{ case_of good run; case_of a_Suite.X notrun "Unable to find executable"; case_of "a&amp;b" fail; } | report
read_report
expect 1 "FAILED: a_Suite.X" $'FAILED: a&b\n' $'\n1 passed, 2 failed'
case_of a_Suite.X notrun SKIP_RETURN_CODE=77 | report
read_report
expect 1 "No test passed" $'\n0 passed, 0 failed, 1 skipped'

# Tries that failed before one that passed.
{ case_of good run; case_of late run; case_of leaky run; } | report
on_purpose=$'2==ERROR: AddressSanitizer: SEGV on unknown address\nSUMMARY: AddressSanitizer: SEGV /x/server/worker/failpoints.cc:3 in F'
{ try_of late Failed "too late"; try_of late Passed ""; try_of good Passed "$on_purpose"; } >log.txt
read_report
expect 0 "REPEATED: late failed" $'\n3 passed, 0 failed'
{ try_of leaky Failed "1==ERROR: LeakSanitizer: detected"; try_of leaky Passed ""; } >>log.txt
read_report
expect 1 "REPEATED: late failed" "FAILED: leaky passed, but a sanitizer's report" $'\n2 passed, 1 failed'
# Reports of processes that a test started and whose end it did not mind.
{ try_of late Passed "3==ERROR: AddressSanitizer: heap-use-after-free"; try_of good Passed "$on_purpose"; try_of leaky Passed ""; } >log.txt
read_report
expect 1 "FAILED: late passed, but a sanitizer's report" $'\n2 passed, 1 failed'
{ try_of late Passed ""; try_of good Passed "$on_purpose"$'\n4==ERROR: AddressSanitizer: SEGV'; try_of leaky Passed ""; } >log.txt
read_report
expect 1 "FAILED: good passed, but a sanitizer's report" $'\n2 passed, 1 failed'
# What a test printed that failed: its last try, from GoogleTest's "Failure" on, or the last lines.
{ case_of good run; case_of bad fail; case_of worse fail; } | report
{
  try_of bad Failed "of the first try"
  try_of bad Failed "$(seq 100 130; echo 'a.cc:7: Failure'; seq 1 30)"
  try_of good Passed "said by good"
  try_of worse Failed "$(seq 201 230)"
} >log.txt
read_report
expect 1 $'\nFAILED: bad\n  | a.cc:7: Failure\n  | 1\n*  | 15\nFAILED: worse\n  | 215\n*  | 230\n1 passed, 2 failed'
for text in "  | 16"$'\n' "  | 130" "of the first try" "said by good"; do
  [[ $printed != *"$text"* ]] || expect 1 "nothing else than that"
done
# A GoogleTest program of several cases, each of which counts: one prints without ending its line, one may be skipped.
{ case_of good run; case_of quick_b fail; case_of quick_c run; } | report
cases='[ RUN      ] S.One
no end of line[       OK ] S.One (3 ms)
[ RUN      ] S.Two
b.cc:9: Failure
[  FAILED  ] S.Two, where GetParam() = 4 (1 ms)
[ RUN      ] _Case/2
[  SKIPPED ] _Case/2 (0 ms)'
{
  try_of quick_b Failed "$cases" | sed 's#^Command: .*#Command: "/x/b_test" "--gtest_filter=-A.*"#'
  try_of quick_c Failed "[ RUN      ] S.One"$'\n'"[  FAILED  ] S.One (1 ms)"
  try_of quick_c Passed "[ RUN      ] S.One"$'\n'"[       OK ] S.One (1 ms)"
} >log.txt
printf 'b__Case/* any too rare\n' >>allowed.txt
read_report
expect 1 $'\nFAILED: b_S.Two\n  | b.cc:9: Failure\n  *REPEATED: quick_c failed' "1 too rare" $'\n3 passed, 1 failed, 1 skipped'
# Without the case that failed, and with one during which the program ended.
{ try_of quick_b Failed "${cases/b.cc*ms)$'\n'\[ RUN/[       OK ] S.Two (1 ms)$'\n'[ RUN}"; } | sed 's#^Command: .*#Command: "/x/b_test"#' >log.txt
read_report
expect 1 $'\nFAILED: quick_b\n' $'\n4 passed, 1 failed, 1 skipped'
try_of quick_b Failed "[ RUN      ] S.Three"$'\n'"[       OK ] S.Three (1 ms)"$'\n'"[ RUN      ] S.Ended" |
  sed 's#^Command: .*#Command: "/x/b_test"#' >log.txt
read_report
expect 1 $'\nFAILED: b_S.Ended\n' $'\n3 passed, 1 failed'
try_of x Passed "" >log.txt

# The list itself.
case_of good run | report
run "$source/deploy/test-report.sh" report.xml log.txt "$source/tests/allowed_skips.txt"
expect 0 "1 passed, 0 failed"
echo "x_Case  any" >allowed.txt
read_report
expect 1 "a line without a reason: x_Case"
echo "x_Case  sometimes  why not" >allowed.txt
read_report
expect 1 "no such condition: sometimes"
rm report.xml
read_report
expect 1 "no test ran"

# --- Parts. Minutes of one second.
cat >says <<'END'
#!/bin/sh
printf '%s\n' "$@" >"$PLANISH_SUMMARY"
END
cat >orphan <<'END'
#!/bin/sh
setsid sleep 100 &
echo $! >"$1"
END
cat >hangs <<'END'
#!/bin/sh
"${0%/*}/orphan" "$1"
sleep 100
END
cat >ends <<'END'
#!/bin/sh
echo "5 passed, 0 failed" >"$PLANISH_SUMMARY"
END
chmod +x says orphan hangs ends
# gone FILE: the process with the number in that file is no more, or only waits for its parent.
gone() {
  [ -s "$1" ] || return 1
  ! grep -qz . "/proc/$(cat "$1")/cmdline" 2>/dev/null
}
# parts LINE...: a script as .ci/run is one.
parts() {
  printf '%s\n' "set -euo pipefail" "source '$source/deploy/parts.sh'" "minute=1" "$@" run_parts >script
  run bash script
}
parts limit=30 'part "one two" 1 ./says "REPEATED: x failed" "3 passed, 0 failed, 2 skipped"' 'part build 1 true' \
  'part more 1 ./says "4 passed, 0 failed"'
expect 0 $'one two * passed * 3 * 0 * 2 *\nbuild * passed * - * - * -*\nmore * passed * 4 *' "one two: REPEATED: x failed" \
  "Every part ran and passed."
[[ $printed == *$'\n7 passed, 0 failed, 2 skipped' ]] || expect 0 "the closing line at the end"

parts limit=30 'part one 1 false' 'part two 1 ./says "3 passed, 0 failed"' \
  'part three 1 sh -c "./says \"FAILED: x\" \"  | too late\" \"3 passed, 2 failed\"; exit 8"'
expect 1 $'\none * FAILED *\ntwo * passed *\nthree * FAILED *' $'\nthree: FAILED: x\n  | too late\n' "no issue may be closed" $'\n6 passed, 3 failed, 0 skipped'

parts limit=2 'part one 1 ./says "3 passed, 0 failed"' 'part two 1 ./hangs two.pid' 'part three 1 true'
expect 1 $'\none * passed *\ntwo * TIMED OUT *\nthree * NOT RUN *' "no issue may be closed" $'\n3 passed, 1 failed, 0 skipped'
gone two.pid || expect 1 "the child of a part that timed out is ended"

parts limit=30 'part one 1 ./orphan one.pid' 'part two 31 true' 'part three 1 ./says "1 passed, 0 failed"'
expect 0 $'\none * passed *\ntwo * NOT RUN *\nthree * passed *' "NOT EVERY PART RAN: no issue may be closed" \
  $'\n1 passed, 0 failed, 0 skipped'
gone one.pid || expect 0 "what a part leaves behind is ended"

# CPU time: that of programs that were waited for, also by others. Starting programs takes some, too.
parts limit=30 'part idle 1 true' 'part busy 1 sh -c "awk \"BEGIN { while (++i < 4e7); }\"; true"' 'part late 1 true'
expect 0 $'\nidle *\nbusy *\nlate *\n'
cpu_of() { awk -v part="$1" '$1 == part && $2 == "passed" { print $NF }' <<<"$printed"; }
awk -v idle="$(cpu_of idle)" -v busy="$(cpu_of busy)" -v late="$(cpu_of late)" \
  'BEGIN { exit !(busy > 2 * idle && busy > 2 * late) }' || expect 0 "the busy part's CPU time"

parts limit=1 'part one 2 true'
expect 1 $'\none * NOT RUN *'

# Ended from outside.
printf '%s\n' "set -euo pipefail" "source '$source/deploy/parts.sh'" "part one 1 ./hangs three.pid" "part two 1 true" \
  run_parts >script
bash script >printed.txt 2>&1 &
until [ -s three.pid ]; do sleep 0.05; done
kill $!
code=0
wait $! || code=$?
printed=$(cat printed.txt)
expect 143 "ENDED from outside" $'\none * FAILED *\ntwo * NOT RUN *' "no issue may be closed" $'\n0 passed, 1 failed, 0 skipped'
gone three.pid || expect 143 "the child of a part that was ended is ended"

# .ci/run itself, with other commands under the names of its own.
mkdir -p tree/.ci tree/deploy
cp "$source/.ci/run" tree/.ci
cp "$source/deploy/parts.sh" tree/deploy
for script in "$source"/deploy/*.sh; do
  [ "${script##*/}" = parts.sh ] || cp ends "tree/deploy/${script##*/}"
done
run tree/.ci/run
expect 0 $'\ntests * passed *\naddress sanitizer * passed *\nthread sanitizer * passed *\neach source alone * passed *' "Every part ran and passed."

[ "$failures" -eq 0 ] || exit 1
echo ok
