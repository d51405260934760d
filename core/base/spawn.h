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
  std::vector<int> descriptors;        // of this process; become 0, 1, 2, ... of the new one (-1: /dev/null)
  std::vector<int> blocked_signals;    // all other signals are unblocked; all have default actions
  bool own_group = false;              // run in a new process group, so that Ctrl-C at the terminal does not reach it
};

// Starts the process and sets `pid`. Returns an errno, 0 for success. The caller must reap the process.
int Spawn(const NewProcess& process, pid_t* pid);

// Describes a status of waitpid() within a sentence: "was killed by signal 9 (SIGKILL)", "exited with code 2".
std::string HowItEnded(int wait_status);

// The name of a signal, "SIGKILL"; "signal N" for a number without one.
std::string SignalName(int number);

}  // namespace planish
