# Completion for planish and planishd in bash. What there is to complete, the programs say themselves (--help), so it is
# that of the version that is installed.

# Prints the flags of the command "$@", one a line: "--flag" and a tab and the values to choose from, apart by blanks.
_planish_flags() {
  "$@" --help 2>/dev/null | awk '
    /^  -/ {
      names = $1; value = $2
      spec = $0; sub(/^  [^ ]+ ?/, "", spec); sub(/   *[^ ].*$/, "", spec)
      choices = ""
      if (match(spec, /\{[^}]*\}/)) {          # TEXT:{a,b} and ENUM:value in {a->0,b->1} OR {0,1}
        choices = substr(spec, RSTART + 1, RLENGTH - 2)
        gsub(/->[^,]*/, "", choices); gsub(/,/, " ", choices)
      } else if (value ~ /^[a-z0-9]+(\|[a-z0-9]+)+(=[a-z0-9]+)?$/) {  # a|b=a
        choices = value; sub(/=.*/, "", choices); gsub(/\|/, " ", choices)
      }
      count = split(names, each, ",")
      for (i = 1; i <= count; ++i) print each[i] "\t" choices
    }'
}

# Prints the subcommands of the command "$@", one a line.
_planish_subcommands() {
  "$@" --help 2>/dev/null | awk '/^[A-Z][a-z]*:$/ { here = ($1 == "Subcommands:") } here && /^  [a-z]/ { print $1 }'
}

_planish() {
  local cur=${COMP_WORDS[COMP_CWORD]} flag= i word
  COMPREPLY=()
  # "=" is a word of its own.
  if [ "$cur" = "=" ]; then
    flag=${COMP_WORDS[COMP_CWORD - 1]} cur=
  elif [ "${COMP_WORDS[COMP_CWORD - 1]}" = "=" ]; then
    flag=${COMP_WORDS[COMP_CWORD - 2]}
  elif [[ ${COMP_WORDS[COMP_CWORD - 1]} == -* ]]; then
    flag=${COMP_WORDS[COMP_CWORD - 1]}
  fi

  local -a command=("${COMP_WORDS[0]/#\~/$HOME}")
  local subcommands
  subcommands=$(_planish_subcommands "${command[@]}")
  for ((i = 1; i < COMP_CWORD; ++i)); do
    word=${COMP_WORDS[i]}
    if [ -n "$subcommands" ] && grep -qxF -- "$word" <<<"$subcommands"; then
      command+=("$word")
      subcommands=$(_planish_subcommands "${command[@]}")
    fi
  done

  local flags choices
  flags=$(_planish_flags "${command[@]}")
  if [ -n "$flag" ]; then
    choices=$(awk -F '\t' -v flag="$flag" '$1 == flag { print $2; exit }' <<<"$flags")
    if [ -n "$choices" ]; then
      COMPREPLY=($(compgen -W "$choices" -- "$cur"))
      return
    fi
  fi
  if [[ $cur == -* ]]; then
    COMPREPLY=($(compgen -W "$(cut -f 1 <<<"$flags")" -- "$cur"))
  elif [ -n "$subcommands" ] && [ -z "$flag" ]; then
    COMPREPLY=($(compgen -W "$subcommands" -- "$cur"))
  else
    compopt -o filenames 2>/dev/null
    local IFS=$'\n'
    COMPREPLY=($(compgen -f -- "$cur"))
  fi
}

complete -F _planish planish planishd
