# Turns the output of `COMMAND --help` (CLI11's) into roff. Variables: title, the name of the section (".SS title"), or
# empty for none. What follows the options is left out where it is the same as in the file `known`.
function roff(text) {
  gsub(/\\/, "\\e", text)
  gsub(/-/, "\\-", text)
  sub(/^[.']/, "\\\\\\&&", text)
  return text
}
# "INT:INT in [1 - 9]=4", "ENUM:value in {a->0,b->1} OR {0,1}=a", "TEXT:{a,b}=a" as people would write them.
function tidy(spec,    preset, choices) {
  preset = ""
  if (match(spec, /=[^=]*$/) && spec !~ /\(Env:/) {
    preset = substr(spec, RSTART + 1)
    spec = substr(spec, 1, RSTART - 1)
    gsub(/[\[\]]/, "", preset)
    sub(/ \.\.\.$/, "", preset)
  }
  if (match(spec, /\{[^}]*\}/)) {
    choices = substr(spec, RSTART + 1, RLENGTH - 2)
    gsub(/->[^,]*/, "", choices)
    gsub(/,/, "|", choices)
    spec = choices
  } else if (match(spec, / in \[.*\]/)) {
    limits = substr(spec, RSTART + 5, RLENGTH - 6)
    sub(/ - /, " to ", limits)
    spec = "N (" limits ")"
  }
  sub(/ \(Env:[A-Z_]*\)/, "", spec)
  return preset == "" ? spec : spec " [" preset "]"
}
function tell() {
  if (names == "") return
  gsub(/,/, ", ", names)
  print ".TP\n\\fB" roff(names) "\\fR" (spec == "" ? "" : " \\fI" roff(spec) "\\fR")
  print roff(text)
  names = ""
}
BEGIN {
  while ((getline line < known) > 0) is_known[line] = 1
  part = "summary"
}
part != "after" && /^Usage: / {
  if (title != "") print ".SS " roff(title)
  print ".B " roff(substr($0, 8))
  if (summary != "") print ".PP\n" roff(summary)
  next
}
part == "summary" && !/^$/ && !/^[A-Z][a-z]*:$/ { summary = $0; next }
# The last blank line before what follows the tables ends them.
part != "after" && /^(Positionals|Options|Subcommands):$/ { part = $1; next }
part ~ /:$/ && /^$/ { tell(); next }
part ~ /:$/ && /^  [^ ]/ {
  tell()
  rest = $0
  sub(/^  /, "", rest)
  match(rest, /^[^ ]+/)
  names = substr(rest, 1, RLENGTH)
  rest = substr(rest, RLENGTH + 1)
  # Texts begin in column 31, after one blank where the option just fits.
  if (rest !~ /  +[^ ]/ && substr($0, 30, 2) ~ /^ [A-Z]/) {
    spec = substr($0, 1, 29)
    sub(/^  [^ ]+/, "", spec)
    text = substr($0, 31)
  } else if (match(rest, /  +[^ ]/)) {
    text = substr(rest, RSTART)
    spec = substr(rest, 1, RSTART - 1)
    sub(/^ */, "", text)
  } else if (rest ~ /^  /) {
    text = rest
    spec = ""
    sub(/^ */, "", text)
  } else {
    text = ""
    spec = rest
  }
  sub(/^ */, "", spec)
  spec = tidy(spec)
  next
}
part ~ /:$/ && names != "" && text == "" && /^          / { text = $0; sub(/^ */, "", text); next }
part ~ /:$/ { tell(); part = "after" }
part == "after" { after[++lines] = $0 }
END {
  tell()
  fresh = 0
  for (i = 1; i <= lines; ++i) if (after[i] != "" && !(after[i] in is_known)) fresh = 1
  if (!fresh) exit
  print ".PP\n.nf"
  for (i = 1; i <= lines; ++i) print after[i] == "" ? "" : roff(after[i])
  print ".fi"
}
