#!/bin/sh
# What the completion in bash, zsh or fish offers. Exit code 77: skipped, and why is printed.
#   completion.sh bash|zsh|fish BIN_DIR
set -eu
shell=$1
export PATH="$2:$PATH"
command -v "$shell" >/dev/null || {
  echo "SKIPPED: $shell is not installed"
  exit 77
}

# Prints what "$@" can go on with, apart by blanks; the last word is the one under the cursor.
case $shell in
bash)
  complete() {
    bash -c '
      source <("$1" --generate=bash)
      COMP_WORDS=("$@") COMP_CWORD=$(($# - 1))
      _$1
      echo "${COMPREPLY[*]}"' bash "$@"
  }
  ;;
zsh)
  # Without a terminal there is no completion system, so what the function tells it is caught.
  complete() {
    zsh -f -c '
      offer() { for each; do [[ $each == ${words[CURRENT]#*=}* ]] && print -r -- $each; done }
      compadd() { shift; offer "$@" }
      compset() { }
      _files() { print files }
      _describe() { [[ $1 == -o ]] && shift; for entry in "${(@P)2}"; do offer ${entry%%:*}; done }
      local -a words
      words=("$@") CURRENT=$#
      source <("$1" --generate=zsh)' zsh "$@" | tr '\n' ' '
  }
  ;;
fish)
  # Lines of a word, a tab and what it is about.
  complete() {
    HOME=/nonexistent fish --no-config -c '
      source ($argv[1] --generate=fish | psub)
      complete --do-complete "$argv"' "$@" | cut -f 1 | tr '\n' ' '
  }
  ;;
esac

failed=0
# expect "WORDS that must be offered" "WORDS that must not" COMMAND...
expect() {
  wanted=$1
  unwanted=$2
  shift 2
  offered=" $(complete "$@") "
  for word in $wanted; do
    case $offered in *[\ =]"$word"[\ ]*) ;; *) echo "$*: '$word' is missing in:$offered"; failed=1 ;; esac
  done
  for word in $unwanted; do
    case $offered in *" $word "*) echo "$*: '$word' is in:$offered"; failed=1 ;; esac
  done
}
expect "unwrap pack inspect estimate jobs version" "--json" planish ""
expect "list show watch stop cancel delete" "unwrap" planish jobs ""
expect "--solver --system" "--limit" planish unwrap --s
expect "--limit --label" "--solver" planish jobs list --l
expect "auto uzawa minres direct" "--solver" planish unwrap --solver ""
expect "--listen --log-level" "--sandbox" planishd --l
expect "auto off require" "process" planishd --sandbox ""
if [ "$shell" = fish ]; then
  expect "--solver=auto --solver=uzawa" "--solver=pack" planish unwrap --solver=
  expect "" "unwrap list" planish unwrap ""
  expect "--generate" "--solver" planish --gen
elif [ "$shell" = bash ]; then
  expect "auto uzawa minres direct" "" planish unwrap --solver =
  expect "minres" "uzawa" planish unwrap --solver = m
else
  expect "auto uzawa minres direct" "--solver" planish unwrap --solver=
  expect "files" "unwrap" planish unwrap ""
fi
[ $failed -eq 0 ] && echo ok
exit $failed
