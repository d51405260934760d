#!/bin/sh
# Each line of tests/allowed_skips.txt names a test that exists, so that no line outlives the name it was written for.
#
#   allowed_skips.sh BUILD_DIRECTORY ALLOWED_SKIPS
set -eu
build=$1 allowed=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
ctest --test-dir "$build" --show-only=json-v1 >"$work/tests.json"
sed -n 's/^ *"name" : "\([^"]*_[^"]*\)",*$/\1/p' "$work/tests.json" >"$work/names"
# The cases of each GoogleTest program, as deploy/test-report.sh calls them.
sed -n 's/^ *"\(\/[^"]*_test\)",*$/\1/p' "$work/tests.json" | sort -u >"$work/programs"
while read -r program; do
  name=$(basename "$program" _test)
  "$program" --gtest_list_tests | awk -v name="$name" '
    /^[^ ].*\.( |$)/ { suite = $1 }
    /^  / { print name "_" suite $1 }' >>"$work/names"
done <"$work/programs"
[ -s "$work/programs" ] || { echo "ctest names no test program in $build" >&2; exit 1; }

status=0
set -f
while read -r pattern _; do
  case $pattern in '' | '#'*) continue ;; esac
  found=
  while read -r name; do
    # shellcheck disable=SC2254  # a pattern
    case $name in $pattern) found=yes; break ;; esac
  done <"$work/names"
  [ -n "$found" ] || { echo "$allowed: no test has the name $pattern" >&2; status=1; }
done <"$allowed"
exit $status
