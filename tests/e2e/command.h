// Runs the real `planish` as people do: arguments in, exit code and streams out.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "planish/private_server.h"
#include "tests/testing/files.h"
#include "tests/testing/process.h"

namespace planish::testing {

// A running command.
class Command : public Process {
 public:
  // `environment` is added to ours; PLANISHD always names the planishd under test.
  explicit Command(std::vector<std::string> arguments, std::map<std::string, std::string> environment = {});
};

Outcome Planish(const std::vector<std::string>& arguments, const std::map<std::string, std::string>& environment = {});

// A test of the command with files in a directory of its own.
class CommandTest : public ::testing::Test {
 protected:
  // Writes a file and returns its path.
  std::string File(const std::string& name, const std::string& text) {
    PutFile(directory_.Path(name), text);
    return directory_.Path(name);
  }

  TempDir directory_;
};

// Of the planishd under test.
PrivateServerOptions ServerOptions(int workers, const std::vector<std::string>& more = {});

// Options with which a mesh of a few hundred squares a side takes minutes.
inline const std::vector<std::string> kSlowly = {"--solver=uzawa", "--system=full", "--preconditioner=none"};

}  // namespace planish::testing
