#include "core/base/command_pages.h"

#include <algorithm>
#include <utility>

#include "CLI/CLI.hpp"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"

namespace planish {
namespace {

constexpr std::size_t kWidth = 100;
constexpr std::size_t kTextColumn = 30;
constexpr char kCommonGroup[] = "Options";  // CLI11's name for flags in no group of their own

// A flag or a positional argument, as the pages show it.
struct Flag {
  std::vector<std::string> names;    // "-o", "--output"; "IN" for a positional argument
  std::string value;                 // "N", "auto|on"; empty if the flag takes no value
  std::vector<std::string> choices;  // allowed values
  std::string group;
  std::string text;

  // "-o, --output OUT"
  std::string Title() const { return absl::StrCat(absl::StrJoin(names, ", "), value.empty() ? "" : " ", value); }
};

struct Command {
  std::string name;   // "watch"
  std::string title;  // "planish jobs watch"
  std::string text;
  std::string footer;
  std::vector<Flag> positionals;
  std::vector<Flag> flags;
  std::vector<Command> commands;

  std::string Usage() const {
    std::string usage = title;
    if (!flags.empty()) usage += " [OPTIONS]";
    for (const Flag& flag : positionals) usage += " " + flag.names.front();
    return commands.empty() ? usage : usage + " COMMAND";
  }
  // The groups of all flags, in the order of their first flags; the common group is first.
  std::vector<std::string> Groups() const {
    std::vector<std::string> groups = {kCommonGroup};
    for (const Flag& flag : flags) {
      if (std::find(groups.begin(), groups.end(), flag.group) == groups.end()) groups.push_back(flag.group);
    }
    return groups;
  }
};

// Turns CLI11's "INT:INT in [1 - 9]" into the value N and the suffix ", 1 to 9", and "a|b" into choices.
void ReadValue(const CLI::Option& option, Flag* flag) {
  if (option.get_items_expected_max() == 0 || option.get_type_size() == 0) return;
  const std::string type = option.get_type_name();
  flag->value = type.substr(0, type.find(':'));
  if (flag->value == "INT" || flag->value == "UINT") flag->value = "N";
  if (flag->value == "FLOAT") flag->value = "X";
  if (flag->value.find('|') != std::string::npos) flag->choices = absl::StrSplit(flag->value, '|');
  const std::size_t limits = type.find(" in [");
  if (limits != std::string::npos) {
    const std::string range = type.substr(limits + 5, type.find(']', limits) - limits - 5);
    const std::size_t otherwise = flag->text.ends_with(']') ? flag->text.rfind(" [") : std::string::npos;
    flag->text.insert(std::min(otherwise, flag->text.size()), ", " + absl::StrReplaceAll(range, {{" - ", " to "}}));
  }
  std::string otherwise = option.get_default_str();
  if (otherwise.starts_with('[')) otherwise = otherwise.substr(1, otherwise.size() - 2);
  if (!otherwise.empty() && !flag->text.ends_with(']')) flag->text += " [" + otherwise + "]";
}

Flag ReadFlag(const CLI::Option& option) {
  Flag flag;
  flag.group = option.get_group();
  flag.text = option.get_description();
  if (option.get_positional()) {
    const bool several = option.get_expected_max() >= CLI::detail::expected_max_vector_size;
    const std::string name = option.get_single_name() + (several ? "..." : "");
    flag.names = {option.get_required() ? name : "[" + name + "]"};
    return flag;
  }
  for (const std::string& name : option.get_snames()) flag.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) flag.names.push_back("--" + name);
  ReadValue(option, &flag);
  if (!option.get_envname().empty()) flag.text += " (or " + option.get_envname() + " in the environment)";
  return flag;
}

Command ReadCommand(const CLI::App& app, const std::string& title) {
  Command command;
  command.name = app.get_name();
  command.title = title;
  command.text = app.get_description();
  command.footer = app.get_footer();
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_group().empty()) continue;
    (option->get_positional() ? command.positionals : command.flags).push_back(ReadFlag(*option));
  }
  for (const CLI::App* sub : app.get_subcommands(nullptr)) {
    if (!sub->get_group().empty()) command.commands.push_back(ReadCommand(*sub, title + " " + sub->get_name()));
  }
  return command;
}

// ---- Help

// Wraps `text` at blanks. The text starts at `column` and later lines are indented to it.
std::string Wrapped(const std::string& text, std::size_t column) {
  std::string out;
  std::size_t at = column;
  const std::vector<std::string> words = absl::StrSplit(text, absl::ByAnyChar(" \n"), absl::SkipEmpty());
  for (const std::string& word : words) {
    const bool breaks = at > column && at + 1 + word.size() > kWidth;
    if (breaks) absl::StrAppend(&out, "\n", std::string(column, ' '));
    const bool is_first = at == column || breaks;
    absl::StrAppend(&out, is_first ? "" : " ", word);
    at = (breaks ? column : at) + (is_first ? 0 : 1) + word.size();
  }
  return out + "\n";
}

std::string Entry(const std::string& title, const std::string& text) {
  std::string line = "  " + title;
  const bool fits = line.size() + 2 <= kTextColumn;
  line += fits ? std::string(kTextColumn - line.size(), ' ') : "\n" + std::string(kTextColumn, ' ');
  return line + Wrapped(text, kTextColumn);
}

// Wraps paragraphs. Headings (which end in a colon) and lines that begin with a blank stay as they are.
std::string Footer(const std::string& footer) {
  std::string out, paragraph;
  const auto end_paragraph = [&] {
    if (!paragraph.empty()) out += Wrapped(std::exchange(paragraph, ""), 0);
  };
  const std::vector<std::string> lines = absl::StrSplit(absl::StripSuffix(footer, "\n"), '\n');
  for (const std::string& line : lines) {
    if (line.empty() || line.starts_with(' ') || line.ends_with(':')) {
      end_paragraph();
      absl::StrAppend(&out, line, "\n");
    } else {
      absl::StrAppend(&paragraph, line, " ");
    }
  }
  end_paragraph();
  return out;
}

std::string Help(const Command& command, bool is_short) {
  std::string out = Wrapped(command.text, 0) + "\nUsage: " + command.Usage() + "\n";
  if (!command.commands.empty()) {
    out += "\nCommands:\n";
    for (const Command& sub : command.commands) out += Entry(sub.name, sub.text);
  }
  if (!command.positionals.empty()) out += "\n";
  for (const Flag& flag : command.positionals) out += Entry(flag.Title(), flag.text);
  std::size_t left_out = 0;
  std::vector<std::string> groups_left_out;
  for (const std::string& group : command.Groups()) {
    const bool shown = !is_short || group == kCommonGroup;
    if (shown) absl::StrAppend(&out, "\n", group, ":\n");
    if (!shown) groups_left_out.push_back(group);
    for (const Flag& flag : command.flags) {
      if (flag.group != group) continue;
      if (shown) out += Entry(flag.Title(), flag.text);
      if (!shown) ++left_out;
    }
  }
  if (!is_short) return command.footer.empty() ? out : out + "\n" + Footer(command.footer);
  if (left_out == 0 && command.footer.empty()) return out;
  std::string more = command.title + " --help says more";
  if (left_out > 0) absl::StrAppend(&more, ", with ", left_out, " more flags: ", absl::StrJoin(groups_left_out, ", "));
  return out + "\n" + Wrapped(more + ".", 0);
}

// ---- Man page

std::string Roff(const std::string& text) {
  std::string out =
      absl::StrReplaceAll("\n" + text, {{"\\", "\\e"}, {"-", "\\-"}, {"\n.", "\n\\&."}, {"\n'", "\n\\&'"}});
  return out.substr(1);
}

std::string ManFlags(const std::vector<Flag>& flags, const std::string& group) {
  std::string out;
  for (const Flag& flag : flags) {
    if (flag.group != group) continue;
    out += ".TP\n\\fB" + Roff(absl::StrJoin(flag.names, ", ")) + "\\fR";
    if (!flag.value.empty()) out += " \\fI" + Roff(flag.value) + "\\fR";
    out += "\n" + Roff(flag.text) + "\n";
  }
  return out;
}

std::string ManCommand(const Command& command, bool is_root) {
  std::string out;
  if (!is_root)
    out += ".SS " + Roff(command.title) + "\n.B " + Roff(command.Usage()) + "\n.PP\n" + Roff(command.text) + "\n";
  for (const Flag& flag : command.positionals) out += ManFlags({flag}, flag.group);
  for (const std::string& group : command.Groups()) {
    if (group != kCommonGroup) out += ".PP\n.I " + Roff(group) + "\n";
    out += ManFlags(command.flags, group);
  }
  if (!command.footer.empty()) out += ".PP\n.nf\n" + Roff(command.footer) + "\n.fi\n";
  for (const Command& sub : command.commands) out += ManCommand(sub, false);
  return out;
}

std::string ManPage(const Command& command, const std::string& version, const ManFrame& frame) {
  return ".TH " + absl::AsciiStrToUpper(command.name) + " " + std::to_string(frame.section) + " \"\" \"planish " +
         version + "\" \"" + frame.manual + "\"\n.SH NAME\n" + command.name + " \\- " + Roff(command.text) + "\n" +
         frame.before + ".SH OPTIONS\n" + ManCommand(command, true) + frame.after;
}

// ---- Completion

void Walk(const Command& command, const auto& visit) {
  visit(command);
  for (const Command& sub : command.commands) Walk(sub, visit);
}

// `text` in single quotes. `apostrophe` replaces each apostrophe in it.
std::string Quoted(const std::string& text, const std::string& apostrophe = "'\\''") {
  return "'" + absl::StrReplaceAll(text, {{"'", apostrophe}}) + "'";
}

// "jobs list": the title without the program.
std::string Path(const Command& command) {
  const std::size_t blank = command.title.find(' ');
  return blank == std::string::npos ? "" : command.title.substr(blank + 1);
}

// The case labels of all commands below the root: "planish jobs list" | ...
std::string Titles(const Command& root) {
  std::vector<std::string> titles;
  Walk(root, [&](const Command& command) {
    if (!Path(command).empty()) titles.push_back("\"" + command.title + "\"");
  });
  return titles.empty() ? "\"\"" : absl::StrJoin(titles, " | ");
}

std::string ChoiceCases(const Command& root, const std::string& open) {
  std::string out;
  Walk(root, [&](const Command& command) {
    const auto label = [&](std::string* to, const std::string& flag) {
      absl::StrAppend(to, "\"", command.title, " ", flag, "\"");
    };
    for (const Flag& flag : command.flags) {
      if (flag.choices.empty()) continue;
      absl::StrAppend(&out, "    ", open, absl::StrJoin(flag.names, " | ", label), ") choices=\"",
                      absl::StrJoin(flag.choices, " "), "\" ;;\n");
    }
  });
  return out;
}

std::string Bash(const Command& root) {
  std::string cases;
  Walk(root, [&](const Command& command) {
    const auto name = [](std::string* to, const Command& sub) { *to += sub.name; };
    const auto names = [](std::string* to, const Flag& flag) { *to += absl::StrJoin(flag.names, " "); };
    absl::StrAppend(&cases, "    \"", command.title, "\")\n      commands=\"",
                    absl::StrJoin(command.commands, " ", name), "\"\n      flags=\"",
                    absl::StrJoin(command.flags, " ", names), "\"\n      ;;\n");
  });
  constexpr char kScript[] = R"(# Completion of @name in bash: @name --generate=bash
_@name() {
  local cur=${COMP_WORDS[COMP_CWORD]} command=@name flag= choices= commands= flags= i
  COMPREPLY=()
  # "=" is a word of its own.
  if [ "$cur" = "=" ]; then
    flag=${COMP_WORDS[COMP_CWORD - 1]} cur=
  elif [ "${COMP_WORDS[COMP_CWORD - 1]}" = "=" ]; then
    flag=${COMP_WORDS[COMP_CWORD - 2]}
  elif [[ ${COMP_WORDS[COMP_CWORD - 1]} == -* ]]; then
    flag=${COMP_WORDS[COMP_CWORD - 1]}
  fi
  for ((i = 1; i < COMP_CWORD; ++i)); do
    case "$command ${COMP_WORDS[i]}" in
      @titles) command+=" ${COMP_WORDS[i]}" ;;
    esac
  done
  case $command in
@cases  esac
  case "$command $flag" in
@choices  esac
  if [ -n "$choices" ]; then
    COMPREPLY=($(compgen -W "$choices" -- "$cur"))
  elif [[ $cur == -* ]]; then
    COMPREPLY=($(compgen -W "$flags" -- "$cur"))
  elif [ -n "$commands" ] && [ -z "$flag" ]; then
    COMPREPLY=($(compgen -W "$commands" -- "$cur"))
  else
    compopt -o filenames 2>/dev/null
    local IFS=$'\n'
    COMPREPLY=($(compgen -f -- "$cur"))
  fi
}

complete -F _@name @name
)";
  return absl::StrReplaceAll(
      kScript,
      {{"@name", root.name}, {"@titles", Titles(root)}, {"@cases", cases}, {"@choices", ChoiceCases(root, "")}});
}

std::string Zsh(const Command& root) {
  std::string cases;
  Walk(root, [&](const Command& command) {
    absl::StrAppend(&cases, "    (\"", command.title, "\")\n      commands=(");
    for (const Command& sub : command.commands) absl::StrAppend(&cases, " ", Quoted(sub.name + ":" + sub.text));
    cases += ")\n      flags=(\n";
    for (const Flag& flag : command.flags) {
      for (const std::string& name : flag.names)
        absl::StrAppend(&cases, "        ", Quoted(name + ":" + flag.text), "\n");
    }
    cases += "      )\n      ;;\n";
  });
  constexpr char kScript[] = R"(#compdef @name
# Completion of @name in zsh: @name --generate=zsh
_@name() {
  local -a commands flags
  local word command=@name flag= choices= current=$words[CURRENT]
  for word in $words[2,CURRENT-1]; do
    case "$command $word" in
      (@titles) command+=" $word" ;;
    esac
  done
  if [[ $current == --*=* ]]; then
    flag=${current%%=*}
    compset -P '*='
  elif [[ $words[CURRENT-1] == -* ]]; then
    flag=$words[CURRENT-1]
  fi
  case $command in
@cases  esac
  case "$command $flag" in
@choices  esac
  if [[ -n $choices ]]; then
    compadd -- ${=choices}
  elif [[ $current == -* && $current != *=* ]]; then
    _describe -o flag flags
  elif [[ -n $commands && -z $flag ]]; then
    _describe command commands
  else
    _files
  fi
}

_@name "$@"
)";
  return absl::StrReplaceAll(
      kScript,
      {{"@name", root.name}, {"@titles", Titles(root)}, {"@cases", cases}, {"@choices", ChoiceCases(root, "(")}});
}

std::string Fish(const Command& root) {
  const auto quoted = [](const std::string& text) { return Quoted(text, "\\'"); };
  std::string paths, lines;
  Walk(root, [&](const Command& command) {
    if (!Path(command).empty()) absl::StrAppend(&paths, " ", quoted(Path(command)));
    const std::string begin =
        absl::StrCat("complete -c ", root.name, " -n ", quoted("__" + root.name + "_is \"" + Path(command) + "\""));
    for (const Command& sub : command.commands) {
      absl::StrAppend(&lines, begin, " -f -a ", sub.name, " -d ", quoted(sub.text), "\n");
    }
    for (const Flag& flag : command.flags) {
      lines += begin;
      for (const std::string& name : flag.names) {
        lines += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
      }
      const std::string choices = absl::StrJoin(flag.choices, " ");
      absl::StrAppend(&lines,
                      !choices.empty()     ? " -x -a " + quoted(choices)
                      : flag.value.empty() ? ""
                                           : " -r",
                      " -d ", quoted(flag.text), "\n");
    }
  });
  constexpr char kScript[] = R"(# Completion of @name in fish: @name --generate=fish
function __@name_is
    set -l path
    for word in (commandline -opc)[2..-1]
        set -l longer (string trim -- "$path $word")
        if contains -- "$longer"@paths
            set path $longer
        end
    end
    test "$path" = "$argv[1]"
end

)";
  return absl::StrReplaceAll(kScript, {{"@name", root.name}, {"@paths", paths}}) + lines;
}

}  // namespace

void AddHelp(CLI::App& app) {
  app.set_help_flag("-h", "Print the most used flags and exit");
  app.set_help_all_flag("--help", "Print all flags and exit");
  app.formatter_fn([](const CLI::App* asked, const std::string& title, CLI::AppFormatMode mode) {
    return Help(ReadCommand(*asked, title), mode == CLI::AppFormatMode::Normal);
  });
}

void AddGenerate(CLI::App& app, const std::string& version, const ManFrame& frame) {
  app.add_option_function<std::string>(
         "--generate",
         [&app, version, frame](const std::string& page) {
           const Command root = ReadCommand(app, app.get_name());
           // CLI11 stops parsing and prints this, whatever the other flags are.
           throw CLI::CallForVersion(page == "man"    ? ManPage(root, version, frame)
                                     : page == "bash" ? Bash(root)
                                     : page == "zsh"  ? Zsh(root)
                                                      : Fish(root),
                                     0);
         },
         "Print the man page, or the completion for a shell, and exit")
      ->check(CLI::IsMember({"man", "bash", "zsh", "fish"}).description(""))
      ->type_name("man|bash|zsh|fish")
      ->configurable(false);
}

}  // namespace planish
