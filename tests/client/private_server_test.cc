// Starting, failing and ending planishd, played by shell scripts.
#include "planish/private_server.h"

#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "planish/error.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

using ::testing::HasSubstr;

class PrivateServerTest : public ::testing::Test {
 protected:
  PrivateServerOptions Script(const std::string& body) {
    PrivateServerOptions options;
    options.executable = directory_.Path("planishd");
    PutFile(options.executable, "#!/bin/sh\n" + body);
    chmod(options.executable.c_str(), 0755);
    return options;
  }

  static std::string MessageOf(const PrivateServerOptions& options) {
    try {
      PrivateServer server(options);
    } catch (const Error& error) {
      EXPECT_EQ(error.reason(), "PRIVATE_SERVER_FAILED");
      EXPECT_EQ(error.code(), ErrorCode::kUnavailable);
      return error.what();
    }
    ADD_FAILURE() << "it started";
    return "";
  }

  TempDir directory_;
};

TEST_F(PrivateServerTest, StartsAndEndsWithItsOwner) {
  std::string socket_directory;
  int pid = 0;
  {
    const PrivateServer server(Script("echo \"$@\" >&2\necho ready >&3\nread end <&3\n"));
    socket_directory = server.directory();
    pid = server.pid();
    EXPECT_EQ(server.target(), "unix:" + socket_directory + "/socket");
    EXPECT_THAT(server.log(), HasSubstr("--listen=" + server.target() + " --supervisor-fd=3 --workers=1"));
    EXPECT_EQ(kill(pid, 0), 0);
    EXPECT_EQ(getpgid(pid), pid);
    struct stat info;
    ASSERT_EQ(stat(socket_directory.c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777, 0700u);
  }
  EXPECT_EQ(kill(pid, 0), -1) << "neither running nor a zombie";
  EXPECT_FALSE(std::filesystem::exists(socket_directory));
}

TEST_F(PrivateServerTest, PassesItsLimitOfThreadsOn) {
  PrivateServerOptions options = Script("echo \"$@\" >&2\necho ready >&3\nread end <&3\n");
  EXPECT_THAT(PrivateServer(options).log(), ::testing::Not(HasSubstr("--threads")));
  options.threads = 5;
  EXPECT_THAT(PrivateServer(options).log(), HasSubstr("--threads=5"));
}

TEST_F(PrivateServerTest, IsNotConfiguredByWhatIsForAService) {
  setenv("PLANISHD_DATA_DIR", "/var/lib/planish", 1);
  setenv("PLANISH_TEST_OTHER", "stays", 1);
  const std::string log = PrivateServer(Script("env >&2\necho ready >&3\nread end <&3\n")).log();
  unsetenv("PLANISHD_DATA_DIR");
  unsetenv("PLANISH_TEST_OTHER");
  EXPECT_THAT(log, ::testing::Not(HasSubstr("PLANISHD_DATA_DIR")));
  EXPECT_THAT(log, HasSubstr("PLANISH_TEST_OTHER=stays"));
}

TEST_F(PrivateServerTest, DeathAtTheStartTellsItsLastWords) {
  EXPECT_THAT(MessageOf(Script("echo 'cannot listen: no luck' >&2\nexit 7\n")),
              ::testing::AllOf(HasSubstr("exited with code 7"), HasSubstr("cannot listen: no luck")));
  EXPECT_THAT(MessageOf(Script("kill -KILL $$\n")), HasSubstr("killed by signal 9"));
}

TEST_F(PrivateServerTest, SilenceIsNotWaitedForForever) {
  PrivateServerOptions options = Script("echo hm >&2\nread end <&3\n");
  options.start_timeout = Seconds(0.3);
  EXPECT_THAT(MessageOf(options), ::testing::AllOf(HasSubstr("did not become ready"), HasSubstr("hm")));
}

TEST_F(PrivateServerTest, MissingProgram) {
  PrivateServerOptions options;
  options.executable = directory_.Path("nothing");
  EXPECT_THAT(MessageOf(options), HasSubstr("nothing is not a program"));
}

TEST_F(PrivateServerTest, FoundBesideTheProgramThenByNameThenInPath) {
  const PrivateServerOptions options = Script("");
  const std::string path = getenv("PATH");
  setenv("PATH", ("/nonexistent:" + directory_.Path()).c_str(), 1);
  EXPECT_EQ(FindPlanishd("/nonexistent"), options.executable);
  setenv("PLANISHD", "/nonexistent/planishd", 1);
  EXPECT_EQ(FindPlanishd(directory_.Path()), options.executable);
  EXPECT_EQ(FindPlanishd("/nonexistent"), "") << "a wrong name is not papered over";
  setenv("PLANISHD", options.executable.c_str(), 1);
  EXPECT_EQ(FindPlanishd("/nonexistent"), options.executable);
  unsetenv("PLANISHD");
  setenv("PATH", path.c_str(), 1);
}

}  // namespace
}  // namespace planish
