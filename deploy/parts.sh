# shellcheck shell=bash
#
# Runs the parts of continuous integration, one after the other, and prints a table of the results. .ci/run sources this
# file and calls:
#
#   limit=MINUTES                          for all parts together
#   part NAME LEAST COMMAND [ARGUMENT...]  once for each part; LEAST: minutes
#   run_parts
#
# A part may take all remaining time. With less than LEAST left it does not start (NOT RUN). When no time is left, it is
# ended with all its processes (TIMED OUT). TIMED OUT fails the run like any other failure; NOT RUN does not.
#
# A command may write lines about its tests into the file $PLANISH_SUMMARY; the last line must be
# "N passed, N failed[, N skipped]". Lines that begin with REPEATED or FAILED, and the lines below them that begin with
# "  | ", are also printed under the table.

limit=56
minute=60  # seconds; shorter in tests/deploy/ci.sh

names=() least=() commands=() results=() minutes=() cpu_minutes=()
running=  # the index of the running part
began=    # when it began

part() {
  names+=("$1") least+=("$2") results+=("NOT RUN") minutes+=(-) cpu_minutes+=(-)
  shift 2
  commands+=("$(printf '%q ' "$@")")
}

# in_minutes SECONDS: prints the seconds as minutes. SECONDS is an awk expression.
in_minutes() {
  LC_ALL=C awk "BEGIN { printf \"%.1f\", ($1) / $minute }"
}
# Sets cpu_seconds: the CPU seconds of all children that were waited for. Do not call it in $(...): that is a subshell,
# which has no children.
take_cpu_seconds() {
  local LC_ALL=C
  times >"$parts_dir/times"
  cpu_seconds=$(awk -F '[ms ]+' 'NR == 2 { printf "%.2f", 60 * $1 + $2 + 60 * $3 + $4 }' "$parts_dir/times")
}

# Prints the ids of all processes of the running part, in any session: each has PLANISH_PART in its environment.
processes() {
  grep -lszxF "PLANISH_PART=$$.$running" /proc/[0-9]*/environ | cut -d / -f 3
}
# Ends the processes of the running part and prints their command lines.
end_processes() {
  local pid signal i
  for signal in TERM KILL; do
    for pid in $(processes); do
      echo "SIG$signal to what is left of ${names[running]}: $pid $(tr '\0' ' ' 2>/dev/null <"/proc/$pid/cmdline")"
      kill -"$signal" "$pid" 2>/dev/null || true
    done
    for ((i = 0; i < 50; ++i)); do
      [ -n "$(processes)" ] || return 0
      sleep 0.1
    done
  done
}

run_part() {
  local left=$((limit * minute - SECONDS)) code=0 before
  [ "$left" -ge $((least[$1] * minute)) ] || return 0
  running=$1 began=$SECONDS
  echo
  echo "== ${names[$1]}, at most $((left / minute)) minutes: ${commands[$1]}"
  take_cpu_seconds
  before=$cpu_seconds
  results[$1]="FAILED"  # in case this script is ended meanwhile
  # The part runs in the background, so that this script reacts to signals at once. `timeout` puts it into a process
  # group of its own.
  eval "PLANISH_PART=$$.$1 PLANISH_SUMMARY='$parts_dir/$1' timeout -k 20 $left ${commands[$1]} </dev/null &"
  wait $! || code=$?
  end_processes
  minutes[$1]=$(in_minutes $((SECONDS - began)))
  if [ $((SECONDS - began)) -ge "$left" ] && { [ "$code" -eq 124 ] || [ "$code" -eq 137 ]; }; then
    results[$1]="TIMED OUT"  # its CPU time is unknown: its processes were not waited for
  else
    take_cpu_seconds
    cpu_minutes[$1]=$(in_minutes "$cpu_seconds - $before")
    [ "$code" -ne 0 ] || results[$1]="passed"
  fi
  running=
}

# Prints the table and ends with the exit code of all parts.
finish() {
  local code=$? i passed failed skipped all_passed=0 all_failed=0 all_skipped=0 missing=0 bad=0
  local counts='^([0-9]+) passed, ([0-9]+) failed(, ([0-9]+) skipped)?$'
  trap - EXIT
  trap '' INT TERM HUP
  if [ -n "$running" ]; then
    echo "ENDED from outside while this part ran: ${names[running]}"
    end_processes
    minutes[running]=$(in_minutes $((SECONDS - began)))
  fi
  echo
  printf '%-20s %-10s %7s %7s %7s %9s %9s\n' part result passed failed skipped 'wall min' 'CPU min'
  for i in "${!names[@]}"; do
    passed=- failed=- skipped=-
    if [[ $(tail -n 1 "$parts_dir/$i" 2>/dev/null) =~ $counts ]]; then
      passed=${BASH_REMATCH[1]} failed=${BASH_REMATCH[2]} skipped=${BASH_REMATCH[4]:-0}
      all_passed=$((all_passed + passed)) all_failed=$((all_failed + failed)) all_skipped=$((all_skipped + skipped))
    fi
    printf '%-20s %-10s %7s %7s %7s %9s %9s\n' "${names[i]}" "${results[i]}" "$passed" "$failed" "$skipped" \
      "${minutes[i]}" "${cpu_minutes[i]}"
    case ${results[i]} in
      passed) ;;
      "NOT RUN") missing=$((missing + 1)) ;;
      *)
        bad=$((bad + 1))
        # A part that failed without a failed test counts as one failed test.
        case $failed in - | 0) all_failed=$((all_failed + 1)) ;; esac
        ;;
    esac
  done
  for i in "${!names[@]}"; do
    [ ! -e "$parts_dir/$i" ] || sed -n -e "s/^\(REPEATED\|FAILED\)/${names[i]}: &/p" -e '/^  | /p' "$parts_dir/$i"
  done
  echo
  if [ "$bad" -gt 0 ]; then
    echo "A PART DID NOT PASS: no issue may be closed on this commit."
  elif [ "$missing" -gt 0 ]; then
    echo "NOT EVERY PART RAN: no issue may be closed on this commit."
  else
    echo "Every part ran and passed."
  fi
  echo "$all_passed passed, $all_failed failed, $all_skipped skipped"
  rm -rf "$parts_dir"
  if [ "$code" -eq 0 ] && { [ "$bad" -gt 0 ] || [ "$missing" -eq "${#names[@]}" ]; }; then code=1; fi
  exit "$code"
}

run_parts() {
  local i
  parts_dir=$(mktemp -d)
  trap finish EXIT
  trap 'exit 129' HUP
  trap 'exit 130' INT
  trap 'exit 143' TERM
  for i in "${!names[@]}"; do run_part "$i"; done
  exit 0
}
