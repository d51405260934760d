#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <thread>

#include "client/files/file_io.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/files/sample_meshes.h"

namespace planish {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

int Mode(const std::string& path) {
  struct stat status;
  EXPECT_EQ(::stat(path.c_str(), &status), 0) << path;
  return status.st_mode & 07777;
}

std::size_t FilesBeside(const std::string& path) {
  return std::distance(fs::directory_iterator(fs::path(path).parent_path()), fs::directory_iterator());
}

TEST(WriteFile, NewAndOldFiles) {
  const std::string path = TemporaryPath("out.obj");
  const std::string bytes("a\0b\r\n", 5);
  ASSERT_TRUE(WriteFile(path, bytes).ok());
  EXPECT_EQ(ReadFile(path), bytes);
  const mode_t mask = ::umask(0);
  ::umask(mask);
  EXPECT_EQ(Mode(path), static_cast<int>(0666 & ~mask));

  ASSERT_EQ(::chmod(path.c_str(), 0640), 0);
  ASSERT_TRUE(WriteFile(path, "").ok());
  EXPECT_EQ(ReadFile(path), "");
  EXPECT_EQ(Mode(path), 0640);
  EXPECT_EQ(FilesBeside(path), 1u) << "a temporary file was left";
}

TEST(WriteFile, AReaderKeepsTheFileItOpened) {
  const std::string path = TemporaryPath("out.obj");
  PutFile(path, "the old file");
  const int descriptor = ::open(path.c_str(), O_RDONLY);
  ASSERT_GE(descriptor, 0);
  ASSERT_TRUE(WriteFile(path, "new").ok());
  char buffer[32];
  EXPECT_EQ(std::string(buffer, ::read(descriptor, buffer, sizeof(buffer))), "the old file");
  ::close(descriptor);
  EXPECT_EQ(ReadFile(path), "new");
}

TEST(WriteFile, FollowsLinks) {
  const std::string target = TemporaryPath("target.obj");
  const std::string link = TemporaryPath("link.obj");
  PutFile(target, "old");
  fs::create_symlink("target.obj", link);
  fs::create_symlink(link, TemporaryPath("second.obj"));
  ASSERT_TRUE(WriteFile(TemporaryPath("second.obj"), "new").ok());
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_TRUE(fs::is_symlink(TemporaryPath("second.obj")));
  EXPECT_EQ(ReadFile(target), "new");

  fs::remove(target);
  ASSERT_TRUE(WriteFile(link, "made").ok());
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_EQ(ReadFile(target), "made");

  fs::create_symlink("circle", TemporaryPath("circle"));
  EXPECT_THAT(std::string(WriteFile(TemporaryPath("circle"), "x").message()), HasSubstr("symbolic links"));
}

TEST(WriteFile, PipesAndDevicesAreWrittenInPlace) {
  EXPECT_TRUE(WriteFile("/dev/null", "gone").ok());
  EXPECT_TRUE(fs::is_character_file("/dev/null"));

  const std::string pipe = TemporaryPath("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  std::string received;
  std::thread reader([&] { received = ReadFile(pipe); });
  const std::string bytes(200000, 'x');  // more than a pipe holds
  EXPECT_TRUE(WriteFile(pipe, bytes).ok());
  reader.join();
  EXPECT_EQ(received, bytes);
  EXPECT_TRUE(fs::is_fifo(pipe));
}

// Runs WriteFile with the file `out` as stdout, as a shell does for "> out".
void WriteToStdout(const std::string& path, const std::string& out) {
  const int saved = ::dup(STDOUT_FILENO);
  const int descriptor = ::open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  ASSERT_GE(descriptor, 0);
  std::fflush(stdout);
  ::dup2(descriptor, STDOUT_FILENO);
  const absl::Status first = WriteFile(path, "one ");
  const absl::Status second = WriteFile(path, "two");
  ::dup2(saved, STDOUT_FILENO);
  ::close(saved);
  ::close(descriptor);
  EXPECT_TRUE(first.ok()) << first;
  EXPECT_TRUE(second.ok()) << second;
}

TEST(WriteFile, StdoutIsNeverReplaced) {
  for (const std::string path : {"-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"}) {
    const std::string out = TemporaryPath("out");
    WriteToStdout(path, out);
    EXPECT_EQ(ReadFile(out), "one two") << path;
  }
}

TEST(WriteFile, ErrorsSayWhy) {
  const absl::Status missing = WriteFile(TemporaryPath("no/such/folder/out.obj"), "x");
  EXPECT_EQ(Reason(missing), "FILE_UNWRITABLE");
  EXPECT_EQ(missing.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(missing.message()), HasSubstr("out.obj: cannot write: No such file or directory"));

  const absl::Status folder = WriteFile(::testing::TempDir(), "x");
  EXPECT_EQ(Reason(folder), "FILE_UNWRITABLE");
  EXPECT_THAT(std::string(folder.message()), HasSubstr("Is a directory"));

  EXPECT_EQ(Reason(WriteFile("", "x")), "FILE_UNWRITABLE");
  EXPECT_THAT(std::string(WriteFile("/dev/full", "x").message()), HasSubstr("No space left"));
}

TEST(WriteFile, RespectsReadOnly) {
  const std::string path = TemporaryPath("out.obj");
  PutFile(path, "old");
  ASSERT_EQ(::chmod(path.c_str(), 0444), 0);
  // Root may write everywhere.
  const uid_t user = ::geteuid();
  if (user == 0) {
    ASSERT_EQ(::chmod(fs::path(path).parent_path().c_str(), 0777), 0);
    ASSERT_EQ(::seteuid(65534), 0);
  }
  const absl::Status status = WriteFile(path, "new");
  ASSERT_EQ(::seteuid(user), 0);
  EXPECT_EQ(status.code(), absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(Reason(status), "FILE_UNWRITABLE");
  EXPECT_EQ(ReadFile(path), "old");
}

}  // namespace
}  // namespace planish
