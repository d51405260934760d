// Starts programs. Linux only.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace planish {

struct NewProcess {
  std::string program;                 // its path
  std::vector<std::string> arguments;  // from argv[0] on
  std::vector<std::string> variables;  // its whole environment, "NAME=value"
  std::vector<int> descriptors;        // of ours; become its 0, 1, 2, ... (-1: /dev/null), and it has no others
  std::vector<int> blocked_signals;    // others are not blocked; all have their default actions
  bool own_group = false;              // a process group of its own: Ctrl-C at the terminal does not reach it
};

// Returns an errno, 0 for success. The caller reaps the process.
int Spawn(const NewProcess& process, pid_t* pid);

// In the words of a sentence, of what waitpid() says: "was killed by signal 9 (SIGKILL)", "exited with code 2".
std::string HowItEnded(int wait_status);

// "SIGKILL", ...
std::string SignalName(int number);

}  // namespace planish
