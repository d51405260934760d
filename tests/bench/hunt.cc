// planish_hunt [--first=N] [--seeds=N] [--faces=N] [--out=DIR] [FAMILY...]: unwraps random members of families of
// meshes (tests/testing/families.h) and says, a line each, which promises were broken: those of the result
// (tests/core/promises.h), and those of the estimate (core/unwrap/estimate.h). Each unwrap is a process of its own that
// can have no more memory than was estimated (--memory). Exit code 1 if any promise was broken.
#include <malloc.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <new>
#include <sstream>
#include <string>
#include <vector>

#include "CLI/CLI.hpp"
#include "core/base/timer.h"
#include "core/unwrap/estimate.h"
#include "core/unwrap/unwrap.h"
#include "tests/core/promises.h"
#include "tests/testing/families.h"

namespace planish::bench {
namespace {

constexpr std::int64_t kBytesPerFace = 8;  // of an encoded mesh, about
constexpr double kMostSeconds = 3;         // times the estimate, at most
constexpr double kLeastSeconds = 0.05;     // shorter jobs are not judged by their seconds
constexpr double kNear = 1.0 / 3;          // of the estimate, and it was a near one

void WriteObj(const std::string& path, const Mesh& mesh) {
  std::ofstream file(path);
  file.precision(17);
  for (const Vec3& p : mesh.positions) file << "v " << p.x() << ' ' << p.y() << ' ' << p.z() << '\n';
  for (const Face& f : mesh.faces) file << "f " << f[0] + 1 << ' ' << f[1] + 1 << ' ' << f[2] + 1 << '\n';
}

// A line "VmHWM:   1234 kB" of /proc/self/status, in bytes.
std::int64_t StatusBytes(const std::string& field) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(field + ":")) return 1024 * std::strtoll(line.c_str() + field.size() + 1, nullptr, 10);
  }
  return 0;
}

double CpuSeconds() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) + 1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
}

struct Outcome {
  std::vector<std::string> broken;
  double seconds = 0, bytes = 0;  // of CPU and of memory
  std::int64_t charts = 0, widened = 0;
};

// Numbers on the first line, then a sentence for each broken promise.
std::string UnwrapInThisProcess(const Mesh& given, const UnwrapOptions& options, std::int64_t most_bytes) {
  const std::int64_t held = StatusBytes("VmRSS");
  const rlim_t limit = StatusBytes("VmData") + most_bytes;
  const rlimit limits = {limit, RLIM_INFINITY}, none = {RLIM_INFINITY, RLIM_INFINITY};
  setrlimit(RLIMIT_DATA, &limits);
  std::ostringstream text;
  try {
    const double before = CpuSeconds();
    const Mesh mesh = given;  // as if it had been decoded
    const absl::StatusOr<UnwrapResult> result = Unwrap(mesh, options, {});
    const double seconds = CpuSeconds() - before;
    const std::int64_t bytes = StatusBytes("VmHWM") - held;
    setrlimit(RLIMIT_DATA, &none);
    text << seconds << ' ' << bytes << ' ' << (result.ok() ? result->charts.size() : 0) << ' '
         << (result.ok() ? result->widened.size() : 0) << '\n';
    for (const std::string& sentence : testing::BrokenPromises(mesh, options, result)) text << sentence << '\n';
  } catch (const std::bad_alloc&) {
    setrlimit(RLIMIT_DATA, &none);
    text << "0 0 0 0\nmore memory was needed than the " << most_bytes << " bytes that it may have\n";
  }
  return text.str();
}

Outcome UnwrapApart(const Mesh& mesh, const UnwrapOptions& options, std::int64_t most_bytes) {
  int ends[2] = {};
  Outcome outcome;
  malloc_trim(0);
  std::fflush(stdout);
  if (pipe(ends) != 0) return {{"there is no pipe"}};
  const pid_t child = fork();
  if (child == 0) {
    const std::string text = UnwrapInThisProcess(mesh, options, most_bytes);
    [[maybe_unused]] const ssize_t written = write(ends[1], text.data(), text.size());
    _exit(0);
  }
  close(ends[1]);
  std::string text;
  char buffer[4096];
  for (ssize_t n = 0; (n = read(ends[0], buffer, sizeof(buffer))) > 0;)
    text.append(buffer, static_cast<std::size_t>(n));
  close(ends[0]);
  int status = 0;
  if (child < 0 || waitpid(child, &status, 0) != child || status != 0 || text.empty()) {
    outcome.broken.push_back("the process died, status " + std::to_string(status));
    return outcome;
  }
  std::istringstream lines(text);
  lines >> outcome.seconds >> outcome.bytes >> outcome.charts >> outcome.widened;
  lines.ignore();
  for (std::string line; std::getline(lines, line);) outcome.broken.push_back(line);
  return outcome;
}

int Main(int argc, char** argv) {
  CLI::App app("Looks for meshes on which Unwrap() breaks a promise");
  std::uint64_t first = 1;
  int seeds = 100, faces = 2000;
  bool as_float = false;
  double memory = 1;
  std::string out;
  std::vector<std::string> families;
  app.add_option("--first", first, "the first seed");
  app.add_option("--seeds", seeds, "so many of each family");
  app.add_option("--faces", faces, "about so many triangles each");
  app.add_option("--out", out, "an existing folder, for the meshes on which promises were broken (OBJ)");
  app.add_flag("--float", as_float, "deliver float, even where only double keeps every triangle");
  app.add_option("--memory", memory, "a process may have so many times the memory that was estimated");
  app.add_option("families", families);
  CLI11_PARSE(app, argc, argv);
  if (families.empty()) families = testing::Families();
  UnwrapOptions options;
  if (as_float) options.precision = Precision::kFloat;
  int tried = 0, failed = 0;
  for (const std::string& family : families) {
    int of_family = 0, family_failed = 0, near_seconds = 0, near_bytes = 0;
    double most_seconds = 0, most_bytes = 0, slowest = 0;
    std::int64_t triangles = 0, charts = 0, widened = 0;
    for (std::uint64_t seed = first; seed < first + static_cast<std::uint64_t>(seeds); ++seed) {
      const Mesh mesh = testing::MakeFamily(family, seed, faces);
      if (mesh.faces.empty()) continue;
      const Estimate estimate =
          EstimateUnwrap(mesh.num_faces(), mesh.num_vertices(), kBytesPerFace * mesh.num_faces(), options);
      Outcome outcome =
          UnwrapApart(mesh, options, static_cast<std::int64_t>(memory * static_cast<double>(estimate.peak_bytes)));
      const double of_seconds = outcome.seconds / estimate.seconds;
      const double of_bytes = outcome.bytes / static_cast<double>(estimate.peak_bytes);
      if (of_seconds > kMostSeconds && outcome.seconds > kLeastSeconds) {
        outcome.broken.push_back(std::to_string(outcome.seconds) + " s, " + std::to_string(of_seconds) +
                                 " times the estimate");
      }
      if (of_bytes > 1) {
        outcome.broken.push_back(std::to_string(static_cast<std::int64_t>(outcome.bytes)) + " bytes, " +
                                 std::to_string(of_bytes) + " times the estimate");
      }
      near_seconds += of_seconds >= kNear;
      near_bytes += of_bytes >= kNear;
      most_seconds = std::max(most_seconds, of_seconds);
      most_bytes = std::max(most_bytes, of_bytes);
      slowest = std::max(slowest, outcome.seconds);
      ++of_family;
      triangles += mesh.num_faces();
      charts += outcome.charts;
      widened += outcome.widened;
      if (outcome.broken.empty()) continue;
      ++family_failed;
      const std::string name = family + "-" + std::to_string(seed) + "-" + std::to_string(faces);
      std::printf("%s (%lld triangles):", name.c_str(), static_cast<long long>(mesh.num_faces()));
      for (const std::string& sentence : outcome.broken) std::printf(" %s;", sentence.c_str());
      std::printf("\n");
      std::fflush(stdout);
      if (!out.empty()) WriteObj(out + "/" + name + ".obj", mesh);
    }
    std::printf(
        "%-16s %d of %d broke a promise; %lld triangles (%lld widened), %lld charts; the slowest %.2f s; of the "
        "estimates at most %.2f of seconds, %.2f of bytes; a third or more in %d and %d\n",
        family.c_str(), family_failed, of_family, static_cast<long long>(triangles), static_cast<long long>(widened),
        static_cast<long long>(charts), slowest, most_seconds, most_bytes, near_seconds, near_bytes);
    std::fflush(stdout);
    tried += of_family;
    failed += family_failed;
  }
  std::printf("%d of %d broke a promise\n", failed, tried);
  return failed > 0 ? 1 : 0;
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  return planish::bench::Main(argc, argv);
}
