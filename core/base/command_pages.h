// Help, man page and shell completion of a command, made from its flags as CLI11 knows them.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace planish {

// What a man page says beside the flags. `before` and `after` are roff, between NAME and OPTIONS and after OPTIONS.
struct ManFrame {
  int section = 1;
  std::string manual;  // "User Commands"
  std::string before;
  std::string after;
};

// Adds --help, with every flag, by group, and what follows them (the footer), and -h, with the flags that are in no
// group of their own. Lines are at most 100 columns wide. Comes before subcommands are added, which inherit it.
void AddHelp(CLI::App& app);

// Adds --generate=man|bash|zsh|fish, which prints the man page, or the completion for a shell, of `app` with all its
// subcommands, and ends. Flags and subcommands in the group "" are left out.
void AddGenerate(CLI::App& app, const std::string& version, const ManFrame& frame);

}  // namespace planish
