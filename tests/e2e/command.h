// Runs the real `planish` as people do: arguments in, exit code and streams out.
#pragma once

#include <sys/types.h>

#include <map>
#include <string>
#include <vector>

namespace planish::testing {

struct Outcome {
  int exit_code = -1;  // 128 + signal if it was killed
  std::string out;
  std::string err;
  double seconds = 0;
};

// A running command. Its destructor kills it.
class Command {
 public:
  // `environment` is added to ours; PLANISHD always names the planishd under test.
  explicit Command(const std::vector<std::string>& arguments,
                   const std::map<std::string, std::string>& environment = {});
  ~Command();
  Command(const Command&) = delete;
  Command& operator=(const Command&) = delete;

  pid_t pid() const { return pid_; }
  void Signal(int signal) const;
  // What it wrote to stderr so far.
  std::string Err() const;
  // Whether stderr contains `text`, waiting up to so many seconds for it.
  bool WaitForErr(const std::string& text, double seconds) const;
  // Waits for its end. Once.
  Outcome Wait();

 private:
  pid_t pid_ = -1;
  int out_ = -1, err_ = -1;  // memory files
  double start_ = 0;
};

Outcome Planish(const std::vector<std::string>& arguments, const std::map<std::string, std::string>& environment = {});

// Monotonic seconds.
double Now();

// A directory that goes with its owner.
class TempDirectory {
 public:
  TempDirectory();
  ~TempDirectory();
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

std::string ReadFile(const std::string& path);
void WriteTextFile(const std::string& path, const std::string& text);
std::vector<std::string> Lines(const std::string& text);

}  // namespace planish::testing
