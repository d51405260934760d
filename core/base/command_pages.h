// Help, man page and shell completion of a command, generated from its CLI11 flags.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace planish {

// The parts of a man page that are not generated. `before` goes between NAME and OPTIONS, `after` behind OPTIONS. Both
// are roff.
struct ManFrame {
  int section = 1;
  std::string manual;  // "User Commands"
  std::string before;
  std::string after;
};

// Adds --help, which lists every flag by group and ends with the footer, and -h, which lists only the flags that are in
// no group. Lines are at most 100 columns wide. Call this before adding subcommands, which inherit both flags.
void AddHelp(CLI::App& app);

// Adds --generate=man|bash|zsh|fish, which prints the man page or the shell completion of `app` and all its
// subcommands, and exits. Leaves out flags and subcommands in the group "".
void AddGenerate(CLI::App& app, const std::string& version, const ManFrame& frame);

}  // namespace planish
