#!/bin/sh
# Installs packages, builds the fuzzers of tests/fuzz with clang and sanitizers, and runs each for some time from its
# corpus. Ends with a line for each target, and fails if any target had a finding.
#
#   deploy/fuzz.sh [SECONDS] [TARGET...]    by default 60 seconds of each target
#
# Findings are in build/fuzz/findings/TARGET; build/fuzz/bin/fuzz_TARGET FILE reproduces one. Inputs that reach new code
# are collected in build/fuzz/corpus/TARGET, from which the next run continues. Add the useful ones, minimized, to
# tests/fuzz/corpus/TARGET (fuzz_TARGET -merge=1 tests/fuzz/corpus/TARGET build/fuzz/corpus/TARGET). The environment
# variable JOBS sets the build's parallelism (default 1, since sanitized C++ takes much memory).
set -eu
cd "$(dirname "$0")/.."

seconds=60
case ${1:-} in
  "") ;;
  *[!0-9]*)
    echo "usage: $0 [SECONDS] [TARGET...]" >&2
    exit 2
    ;;
  *)
    seconds=$1
    shift
    ;;
esac
if [ $# -eq 0 ]; then
  for corpus in tests/fuzz/corpus/*; do set -- "$@" "${corpus##*/}"; done
fi
for target in "$@"; do
  [ -d "tests/fuzz/corpus/$target" ] || {
    echo "fuzz.sh: no such target: $target" >&2
    exit 2
  }
done

deploy/install-packages.sh build test fuzz
if command -v ccache >/dev/null; then
  export CMAKE_CXX_COMPILER_LAUNCHER="${CMAKE_CXX_COMPILER_LAUNCHER-ccache}"
fi
mkdir -p build
cmake --preset fuzz >build/configure-fuzz.log 2>&1 || {
  cat build/configure-fuzz.log >&2
  exit 1
}
cmake --build --preset fuzz --parallel "${JOBS:-1}" >&2

# -rss_limit_mb: targets limit their own allocations (tests/fuzz/memory_budget.h); this limit is for allocations that
# bypass that one. -timeout: an input may take 60 s, since Draco is slow on some inputs.
limits="-rss_limit_mb=2048 -timeout=60 -max_len=4096"
export UBSAN_OPTIONS=print_stacktrace=1
export ASAN_OPTIONS=detect_stack_use_after_return=0:allocator_may_return_null=1
ASAN_SYMBOLIZER_PATH=$(command -v llvm-symbolizer-14) && export ASAN_SYMBOLIZER_PATH

failed=0
summary=
for target in "$@"; do
  found=build/fuzz/findings/$target
  gathered=build/fuzz/corpus/$target
  log=build/fuzz/$target.log
  mkdir -p "$found" "$gathered"
  echo "$target: $seconds s" >&2
  # shellcheck disable=SC2086  # a list of flags
  if build/fuzz/bin/fuzz_"$target" $limits -max_total_time="$seconds" -print_final_stats=1 \
    -artifact_prefix="$found/" "$gathered" "tests/fuzz/corpus/$target" >"$log" 2>&1; then
    inputs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    covered=$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$log" | tail -n 1)
    summary="$summary$target: $inputs inputs, $covered places in the code reached, no finding
"
  else
    failed=1
    grep -aE '^broken promise|ERROR: |runtime error|SUMMARY|Test unit written' "$log" >&2 || tail -n 20 "$log" >&2
    summary="$summary$target: FINDING, see $log and $found
"
  fi
done
printf '\n%s' "$summary"
exit $failed
