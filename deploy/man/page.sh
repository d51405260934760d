#!/bin/sh
# Writes a man page: FRAME.in, with the options of all (sub)commands, as PROGRAM --help tells them, in place of the line
# "@OPTIONS@".
#
#   deploy/man/page.sh PROGRAM FRAME.in VERSION > PAGE
set -eu
here=$(cd "$(dirname "$0")" && pwd)
program=$1
frame=$2
version=$3
name=${program##*/}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# The subcommands in the help on standard input.
subcommands() {
  awk '/^[A-Z][a-z]*:$/ { here = ($1 == "Subcommands:") } here && /^  [a-z]/ { print $1 }'
}
# Prints the options of the command "$@" and of those below it. Environment must not change defaults that are shown.
describe() {
  env -i "$@" --help >"$work/help"
  if [ $# -eq 1 ]; then
    awk -v title= -v known=/dev/null -f "$here/help.awk" "$work/help"
    # Subcommands end with what the command itself ends with, unless they have something of their own to say.
    awk '/^Examples:$/ { on = 1 } on' "$work/help" >"$work/known"
  else
    shown=$name
    for word in "$@"; do [ "$word" = "$1" ] || shown="$shown $word"; done
    awk -v title="$shown" -v known="$work/known" -f "$here/help.awk" "$work/help"
  fi
  for subcommand in $(subcommands <"$work/help"); do describe "$@" "$subcommand"; done
}
describe "$program" >"$work/options"
# Defaults that are this machine's.
sed "s/\[$(nproc)\]/[as many as cores]/" "$work/options" >"$work/options.portable"
awk -v version="$version" -v options="$work/options.portable" '
  $0 == "@OPTIONS@" { while ((getline line < options) > 0) print line; next }
  { gsub(/@VERSION@/, version); print }' "$frame"
