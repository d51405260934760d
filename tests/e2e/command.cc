#include "tests/e2e/command.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "client/src/process.h"

extern char** environ;

namespace planish::testing {

double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Command::Command(const std::vector<std::string>& arguments, const std::map<std::string, std::string>& environment) {
  out_ = memfd_create("out", MFD_CLOEXEC);
  err_ = memfd_create("err", MFD_CLOEXEC);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, out_, 1);
  posix_spawn_file_actions_adddup2(&actions, err_, 2);
  // Whoever started the tests in the background has made SIGINT ignored; the command must not inherit that.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t all;
  sigfillset(&all);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);

  std::vector<std::string> words = {PLANISH_COMMAND};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::map<std::string, std::string> variables = {{"PLANISHD", PLANISHD_COMMAND}};
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string text = *variable;
    const std::size_t equals = text.find('=');
    if (text.rfind("PLANISH", 0) != 0) variables[text.substr(0, equals)] = text.substr(equals + 1);
  }
  for (const auto& [name, value] : environment) variables[name] = value;
  std::vector<std::string> definitions;
  for (const auto& [name, value] : variables) definitions.push_back(name + "=" + value);
  const auto pointers = [](std::vector<std::string>& texts) {
    std::vector<char*> result;
    for (std::string& text : texts) result.push_back(text.data());
    result.push_back(nullptr);
    return result;
  };
  start_ = Now();
  const int error =
      posix_spawn(&pid_, PLANISH_COMMAND, &actions, &attributes, pointers(words).data(), pointers(definitions).data());
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  if (error != 0) throw std::runtime_error("cannot start " PLANISH_COMMAND);
}

Command::~Command() {
  if (pid_ > 0) {
    kill(pid_, SIGKILL);
    ReapWithin(pid_, 10);
  }
  close(out_);
  close(err_);
}

void Command::Signal(int signal) const {
  kill(pid_, signal);
}

std::string Command::Err() const {
  return ReadAll(err_);
}

bool Command::WaitForErr(const std::string& text, double seconds) const {
  for (const double end = Now() + seconds; Now() < end;) {
    if (Err().find(text) != std::string::npos) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return false;
}

Outcome Command::Wait() {
  Outcome outcome;
  int status = 0;
  if (ReapWithin(pid_, 100, &status)) {
    pid_ = -1;
    outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  outcome.seconds = Now() - start_;
  outcome.out = ReadAll(out_);
  outcome.err = ReadAll(err_);
  return outcome;
}

Outcome Planish(const std::vector<std::string>& arguments, const std::map<std::string, std::string>& environment) {
  return Command(arguments, environment).Wait();
}

TempDirectory::TempDirectory() {
  path_ = (std::filesystem::temp_directory_path() / "planish-e2e-XXXXXX").string();
  if (mkdtemp(path_.data()) == nullptr) throw std::runtime_error("mkdtemp " + path_);
}

TempDirectory::~TempDirectory() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::string ReadFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

void WriteTextFile(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

}  // namespace planish::testing
