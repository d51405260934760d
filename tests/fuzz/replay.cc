// Each target as tests: its corpus, and seeded mutations of it (PLANISH_FUZZ_MUTATIONS, default 2000). An input that
// ends the process is left in the tests' temporary folder as fuzz_TARGET.input, for a debugger or for libFuzzer.
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "core/base/sanitizers.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/fuzz/check.h"
#include "tests/fuzz/mutations.h"
#include "tests/testing/files.h"

namespace planish::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr rlim_t kMostAddresses = rlim_t{4} << 30;
constexpr rlim_t kMostSeconds = 100;  // of CPU

std::vector<std::string> CorpusOf(const std::string& target) {
  std::vector<fs::path> paths;
  for (const auto& entry : fs::directory_iterator(fs::path(PLANISH_FUZZ_CORPUS) / target))
    paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  std::vector<std::string> corpus;
  for (const fs::path& path : paths) corpus.push_back(ReadFile(path));
  return corpus;
}

// Set before the first input: the handler cannot make strings.
std::string input_path;
const std::string* present_input = nullptr;

void SaveInput(int number) {
  const int file = open(input_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (file >= 0 && present_input != nullptr) {
    [[maybe_unused]] const ssize_t written = write(file, present_input->data(), present_input->size());
  }
  raise(number);
}

class Replay : public ::testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    if (!kSanitized) Limit(RLIMIT_AS, kMostAddresses);
    Limit(RLIMIT_CPU, kMostSeconds);
    input_path = ::testing::TempDir() + "fuzz_" + GetParam() + ".input";
    struct sigaction once = {};
    once.sa_handler = SaveInput;
    once.sa_flags = SA_RESETHAND | SA_NODEFER;
    for (const int number : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGXCPU}) sigaction(number, &once, nullptr);
  }

  void Try(const std::string& input) {
    present_input = &input;
    Targets().at(GetParam())(input);
    present_input = nullptr;
  }

 private:
  static void Limit(int resource, rlim_t most) {
    rlimit limit = {};
    getrlimit(static_cast<__rlimit_resource>(resource), &limit);
    limit.rlim_cur = std::min(limit.rlim_cur, most);
    setrlimit(static_cast<__rlimit_resource>(resource), &limit);
  }
};

TEST_P(Replay, Corpus) {
  const std::vector<std::string> corpus = CorpusOf(GetParam());
  EXPECT_THAT(corpus, ::testing::SizeIs(::testing::Ge(10u)));
  for (const std::string& input : corpus) Try(input);
  Try("");
}

TEST_P(Replay, Mutations) {
  const char* const number = std::getenv("PLANISH_FUZZ_MUTATIONS");
  const int mutations = number == nullptr ? 2000 : std::atoi(number);
  const std::vector<std::string> corpus = CorpusOf(GetParam());
  ASSERT_FALSE(corpus.empty());
  std::mt19937 random(5);
  for (int i = 0; i < mutations; ++i) Try(Mutated(corpus, random));
}

std::vector<std::string> TargetNames() {
  std::vector<std::string> names;
  for (const auto& [name, target] : Targets()) names.push_back(name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Of, Replay, ::testing::ValuesIn(TargetNames()), [](const auto& of) { return of.param; });

}  // namespace
}  // namespace planish::fuzz
