#!/usr/bin/env bash
# against_blender.sh PLANISH_SOLVE_TIME RUNS MESH...: solve and layout against Blender's ABF operator (Debian package
# `blender`), alternately (A B A B ...) on one core; prints a Markdown table of medians and their ratio.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
ours=$1 runs=$2
shift 2

median() { sort -g | awk '{v[NR] = $1} END {print (NR % 2) ? v[(NR + 1) / 2] : (v[NR / 2] + v[NR / 2 + 1]) / 2}'; }

echo "| mesh | planish (s) | Blender ABF (s) | ratio | ratios of the pairs |"
echo "|---|---|---|---|---|"
for mesh in "$@"; do
  a=() b=() ratios=()
  for _ in $(seq "$runs"); do
    x=$(taskset -c 0 "$ours" "$mesh" | sed -n 's/.*"solve_and_layout_seconds":\([0-9.e-]*\).*/\1/p')
    y=$(taskset -c 0 blender -b --factory-startup -t 1 -P "$here/blender_abf.py" -- "$mesh" 2>/dev/null |
      sed -n 's/^SECONDS //p')
    [ -n "$x" ] && [ -n "$y" ] || { echo "no time for $mesh (ours '$x', Blender '$y')" >&2; exit 1; }
    a+=("$x") b+=("$y") ratios+=("$(awk "BEGIN {printf \"%.1f\", $y / $x}")")
  done
  ma=$(printf '%s\n' "${a[@]}" | median) mb=$(printf '%s\n' "${b[@]}" | median)
  echo "| $(basename "$mesh") | $(printf %.3f "$ma") | $(printf %.2f "$mb") | $(awk "BEGIN {printf \"%.1f\", $mb / $ma}") | ${ratios[*]} |"
done
