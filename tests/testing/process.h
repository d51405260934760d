// Programs that a test starts and waits for.
#pragma once

#include <sys/types.h>

#include <functional>
#include <map>
#include <string>
#include <vector>

namespace planish {

// How a program ended.
struct Outcome {
  int exit_code = -1;  // minus the signal if one killed it
  std::string out;
  std::string err;
  double seconds = 0;
};

struct ProcessOptions {
  std::map<std::string, std::string> environment;  // beside ours
  std::string without;                             // prefix of those variables of ours that it does not get
  int inherited_fd = -1;                           // stays open in it, under the same number
  bool merged = false;                             // what it writes to stdout stands among what it writes to stderr
};

// A child process without input. Its destructor kills it.
class Process {
 public:
  // Starts the program `arguments[0]`. Throws std::runtime_error if that cannot be.
  explicit Process(std::vector<std::string> arguments, const ProcessOptions& options = {});
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t pid() const { return pid_; }
  void Signal(int signal) const;
  bool IsRunning();
  // What it wrote so far.
  std::string Out() const;
  std::string Err() const;
  // Whether stderr contains `text`; waits for it until the process has ended, or as WaitUntil() does.
  bool WaitForErr(const std::string& text, double seconds);
  // Waits for its end.
  Outcome Wait();

 private:
  void Reap(int options);

  pid_t pid_ = -1;
  int out_ = -1, err_ = -1;  // memory files
  double start_ = 0;
  bool ended_ = false;
  int exit_code_ = -1;
};

// A line for the shell.
Outcome RunShell(const std::string& command);

// Processes that `pid` started, dead ones that it has not waited for among them.
std::vector<pid_t> ChildrenOf(pid_t pid);
// The letter of /proc/PID/stat: 'Z' for one that is dead and not waited for. '?' if there is no such process.
char StateOf(pid_t pid);
// CPU that it took so far, in steps of some milliseconds, its children's left out. 0 if there is no such process.
double CpuSecondsOf(pid_t pid);

// A TCP port of loopback that nobody has, and nobody gets who does not ask for that number.
int FreePort();

// Monotonic seconds.
double Now();

// Looks again and again, for so many seconds, five times as long with sanitizers; whether `condition` became true.
bool WaitUntil(const std::function<bool()>& condition, double seconds = 30);

}  // namespace planish
