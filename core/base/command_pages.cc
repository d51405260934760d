#include "core/base/command_pages.h"

#include <algorithm>
#include <sstream>

#include "CLI/CLI.hpp"

namespace planish {
namespace {

constexpr std::size_t kWidth = 100;
constexpr std::size_t kTextColumn = 30;
constexpr char kCommonGroup[] = "Options";  // CLI11's name for flags in no group of their own

// A flag, or a positional argument, as people are told of it.
struct Flag {
  std::vector<std::string> names;    // "-o", "--output"; of a positional "IN"
  std::string value;                 // "N", "auto|on"; empty: takes none
  std::vector<std::string> choices;  // of the value
  std::string group;
  std::string text;

  // "-o, --output OUT"
  std::string Title() const { return CLI::detail::join(names, ", ") + (value.empty() ? "" : " " + value); }
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
  // In the order in which they first appear; the common one is first.
  std::vector<std::string> Groups() const {
    std::vector<std::string> groups = {kCommonGroup};
    for (const Flag& flag : flags) {
      if (std::find(groups.begin(), groups.end(), flag.group) == groups.end()) groups.push_back(flag.group);
    }
    return groups;
  }
};

// "INT:INT in [1 - 9]" is N, with ", 1 to 9" behind the text; "a|b" are choices.
void ReadValue(const CLI::Option& option, Flag* flag) {
  if (option.get_items_expected_max() == 0 || option.get_type_size() == 0) return;
  const std::string type = option.get_type_name();
  flag->value = type.substr(0, type.find(':'));
  if (flag->value == "INT" || flag->value == "UINT") flag->value = "N";
  if (flag->value == "FLOAT") flag->value = "X";
  if (flag->value.find('|') != std::string::npos) flag->choices = CLI::detail::split(flag->value, '|');
  const std::size_t limits = type.find(" in [");
  if (limits != std::string::npos) {
    std::string range = type.substr(limits + 5, type.find(']', limits) - limits - 5);
    const std::size_t dash = range.find(" - ");
    if (dash != std::string::npos) range.replace(dash, 3, " to ");
    const std::size_t otherwise = flag->text.ends_with(']') ? flag->text.rfind(" [") : std::string::npos;
    flag->text.insert(std::min(otherwise, flag->text.size()), ", " + range);
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

Command ReadCommand(const CLI::App& app, const std::string& parent) {
  Command command;
  command.name = app.get_name();
  command.title = parent + command.name;
  command.text = app.get_description();
  command.footer = app.get_footer();
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_group().empty()) continue;
    (option->get_positional() ? command.positionals : command.flags).push_back(ReadFlag(*option));
  }
  for (const CLI::App* sub : app.get_subcommands(nullptr)) {
    if (!sub->get_group().empty()) command.commands.push_back(ReadCommand(*sub, command.title + " "));
  }
  return command;
}

std::string ParentTitle(const CLI::App& app) {
  std::string title;
  for (const CLI::App* parent = app.get_parent(); parent != nullptr; parent = parent->get_parent()) {
    title = parent->get_name() + " " + title;
  }
  return title;
}

// ---- Help

// `text` broken at blanks, from `column` on, where it stands already.
std::string Wrapped(const std::string& text, std::size_t column) {
  std::istringstream words(text);
  std::string out, word;
  std::size_t at = column;
  while (words >> word) {
    if (at > column && at + 1 + word.size() > kWidth) {
      out += "\n" + std::string(column, ' ');
      at = column;
    } else if (at > column) {
      out += ' ';
      ++at;
    }
    out += word;
    at += word.size();
  }
  return out + "\n";
}

std::string Entry(const std::string& title, const std::string& text) {
  std::string line = "  " + title;
  const bool fits = line.size() + 2 <= kTextColumn;
  line += fits ? std::string(kTextColumn - line.size(), ' ') : "\n" + std::string(kTextColumn, ' ');
  return line + Wrapped(text, kTextColumn);
}

// Paragraphs are wrapped; headings, which end in a colon, and lines that begin with a blank stay as they are.
std::string Footer(const std::string& footer) {
  std::istringstream lines(footer);
  std::string out, paragraph;
  const auto end_paragraph = [&] {
    if (!paragraph.empty()) out += Wrapped(paragraph, 0);
    paragraph.clear();
  };
  for (std::string line; std::getline(lines, line);) {
    const bool stays = line.empty() || line.starts_with(' ') || line.ends_with(':');
    if (stays) {
      end_paragraph();
      out += line + "\n";
    } else {
      paragraph += line + " ";
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
  std::string names;
  for (const std::string& group : command.Groups()) {
    const bool shown = !is_short || group == kCommonGroup;
    if (shown) out += "\n" + group + ":\n";
    if (!shown) names += (names.empty() ? "" : ", ") + group;
    for (const Flag& flag : command.flags) {
      if (flag.group != group) continue;
      if (shown) out += Entry(flag.Title(), flag.text);
      if (!shown) ++left_out;
    }
  }
  if (!is_short) return command.footer.empty() ? out : out + "\n" + Footer(command.footer);
  if (left_out == 0 && command.footer.empty()) return out;
  std::string more = command.title + " --help says more";
  if (left_out > 0) more += ", with " + std::to_string(left_out) + " more flags: " + names;
  return out + "\n" + Wrapped(more + ".", 0);
}

// ---- Man page

std::string Roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else {
      if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n')) out += "\\&";
      out += c;
    }
  }
  return out;
}

std::string ManFlags(const std::vector<Flag>& flags, const std::string& group) {
  std::string out;
  for (const Flag& flag : flags) {
    if (flag.group != group) continue;
    out += ".TP\n\\fB" + Roff(CLI::detail::join(flag.names, ", ")) + "\\fR";
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
  std::string capitals = command.name;
  std::transform(capitals.begin(), capitals.end(), capitals.begin(), [](unsigned char c) { return std::toupper(c); });
  return ".TH " + capitals + " " + std::to_string(frame.section) + " \"\" \"planish " + version + "\" \"" +
         frame.manual + "\"\n.SH NAME\n" + command.name + " \\- " + Roff(command.text) + "\n" + frame.before +
         ".SH OPTIONS\n" + ManCommand(command, true) + frame.after;
}

// ---- Completion

void Walk(const Command& command, const auto& visit) {
  visit(command);
  for (const Command& sub : command.commands) Walk(sub, visit);
}

// In single quotes, for bash and zsh; fish takes the same but for its backslashes.
std::string Quoted(const std::string& text, const std::string& apostrophe = "'\\''") {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? apostrophe : std::string(1, c);
  return out + "'";
}

// "jobs list": the title without the program.
std::string Path(const Command& command) {
  const std::size_t blank = command.title.find(' ');
  return blank == std::string::npos ? "" : command.title.substr(blank + 1);
}

// case labels of all commands below the root: "planish jobs list" | ...
std::string Titles(const Command& root) {
  std::string out;
  Walk(root, [&](const Command& command) {
    if (!Path(command).empty()) out += (out.empty() ? "" : " | ") + ("\"" + command.title + "\"");
  });
  return out.empty() ? "\"\"" : out;
}

std::string ChoiceCases(const Command& root, const std::string& open) {
  std::string out;
  Walk(root, [&](const Command& command) {
    for (const Flag& flag : command.flags) {
      if (flag.choices.empty()) continue;
      std::string labels;
      for (const std::string& name : flag.names) {
        labels += (labels.empty() ? "" : " | ") + ("\"" + command.title + " " + name + "\"");
      }
      out += "    " + open + labels + ") choices=\"" + CLI::detail::join(flag.choices, " ") + "\" ;;\n";
    }
  });
  return out;
}

std::string Bash(const Command& root) {
  std::string cases;
  Walk(root, [&](const Command& command) {
    std::string commands, flags;
    for (const Command& sub : command.commands) commands += (commands.empty() ? "" : " ") + sub.name;
    for (const Flag& flag : command.flags) flags += (flags.empty() ? "" : " ") + CLI::detail::join(flag.names, " ");
    cases += "    \"" + command.title + "\")\n      commands=\"" + commands + "\"\n      flags=\"" + flags +
             "\"\n      ;;\n";
  });
  const std::string name = root.name;
  return "# Completion of " + name + " in bash: " + name + " --generate=bash\n_" + name + R"(() {
  local cur=${COMP_WORDS[COMP_CWORD]} command=)" +
         name + R"( flag= choices= commands= flags= i
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
      )" +
         Titles(root) + R"() command+=" ${COMP_WORDS[i]}" ;;
    esac
  done
  case $command in
)" + cases +
         R"(  esac
  case "$command $flag" in
)" + ChoiceCases(root, "") +
         R"(  esac
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

complete -F _)" +
         name + " " + name + "\n";
}

std::string Zsh(const Command& root) {
  std::string cases;
  Walk(root, [&](const Command& command) {
    cases += "    (\"" + command.title + "\")\n      commands=(";
    for (const Command& sub : command.commands) cases += " " + Quoted(sub.name + ":" + sub.text);
    cases += ")\n      flags=(\n";
    for (const Flag& flag : command.flags) {
      for (const std::string& name : flag.names) cases += "        " + Quoted(name + ":" + flag.text) + "\n";
    }
    cases += "      )\n      ;;\n";
  });
  const std::string name = root.name;
  return "#compdef " + name + "\n# Completion of " + name + " in zsh: " + name + " --generate=zsh\n_" + name + R"(() {
  local -a commands flags
  local word command=)" +
         name + R"( flag= choices= current=$words[CURRENT]
  for word in $words[2,CURRENT-1]; do
    case "$command $word" in
      ()" +
         Titles(root) + R"() command+=" $word" ;;
    esac
  done
  if [[ $current == --*=* ]]; then
    flag=${current%%=*}
    compset -P '*='
  elif [[ $words[CURRENT-1] == -* ]]; then
    flag=$words[CURRENT-1]
  fi
  case $command in
)" + cases +
         R"(  esac
  case "$command $flag" in
)" + ChoiceCases(root, "(") +
         R"(  esac
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

_)" + name +
         " \"$@\"\n";
}

std::string Fish(const Command& root) {
  const auto quoted = [](const std::string& text) { return Quoted(text, "\\'"); };
  std::string paths, lines;
  Walk(root, [&](const Command& command) {
    if (!Path(command).empty()) paths += " " + quoted(Path(command));
    const std::string begin =
        "complete -c " + root.name + " -n " + quoted("__" + root.name + "_is \"" + Path(command) + "\"");
    for (const Command& sub : command.commands)
      lines += begin + " -f -a " + sub.name + " -d " + quoted(sub.text) + "\n";
    for (const Flag& flag : command.flags) {
      lines += begin;
      for (const std::string& name : flag.names) {
        lines += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
      }
      if (!flag.choices.empty()) {
        lines += " -x -a " + quoted(CLI::detail::join(flag.choices, " "));
      } else if (!flag.value.empty()) {
        lines += " -r";
      }
      lines += " -d " + quoted(flag.text) + "\n";
    }
  });
  return "# Completion of " + root.name + " in fish: " + root.name + " --generate=fish\nfunction __" + root.name +
         R"(_is
    set -l path
    for word in (commandline -opc)[2..-1]
        set -l longer (string trim -- "$path $word")
        if contains -- "$longer")" +
         paths + R"(
            set path $longer
        end
    end
    test "$path" = "$argv[1]"
end

)" + lines;
}

}  // namespace

void AddHelp(CLI::App& app) {
  app.set_help_flag("-h", "Print the most used flags and exit");
  app.set_help_all_flag("--help", "Print all flags and exit");
  app.formatter_fn([](const CLI::App* asked, std::string, CLI::AppFormatMode mode) {
    return Help(ReadCommand(*asked, ParentTitle(*asked)), mode == CLI::AppFormatMode::Normal);
  });
}

void AddGenerate(CLI::App& app, const std::string& version, const ManFrame& frame) {
  app.add_option_function<std::string>(
         "--generate",
         [&app, version, frame](const std::string& page) {
           const Command root = ReadCommand(app, "");
           // What ends the parsing with something to print, whatever else is asked for.
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
