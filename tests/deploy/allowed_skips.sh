#!/bin/sh
# Each line of tests/allowed_skips.txt names a test that exists, so that no line outlives the name it was written for.
#
#   allowed_skips.sh BUILD_DIRECTORY ALLOWED_SKIPS
set -eu
build=$1 allowed=$2
tests=$(ctest --test-dir "$build" --show-only | sed -n 's/^ *Test *#[0-9]*: //p')
[ -n "$tests" ] || { echo "ctest names no tests in $build" >&2; exit 1; }

status=0
set -f
while read -r pattern _; do
  case $pattern in '' | '#'*) continue ;; esac
  found=
  while read -r name; do
    # shellcheck disable=SC2254  # a pattern
    case $name in $pattern) found=yes; break ;; esac
  done <<EOF
$tests
EOF
  [ -n "$found" ] || { echo "$allowed: no test has the name $pattern" >&2; status=1; }
done <"$allowed"
exit $status
