// planish_hunt [--first=N] [--seeds=N] [--faces=N] [--most-faces=N] [--out=DIR] [--cases=FILE] [FAMILY...]: unwraps
// random members of families of meshes (tests/testing/families.h) and says, a line each, which promises were broken:
// those of the result (tests/core/promises.h; of --seams=auto alone), and those of the estimate
// (core/unwrap/estimate.h). Each unwrap is a process of its own that can have twice the memory that was estimated
// (--memory), and that is ended long after the seconds estimated. One that takes more than was estimated is listed as
// repeated, since a server would run it again with twice the memory; it breaks no promise. Exit code 1 if any promise
// was broken. With --mesh=FILE (repeatable): of these mesh files instead, with --seams=uv along the borders of their
// UV. With --cases=FILE: a line for each unwrap there, with what it took and the estimates, separated by tabs.
#include <malloc.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <new>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "CLI/CLI.hpp"
#include "core/base/timer.h"
#include "core/unwrap/estimate.h"
#include "core/unwrap/unwrap.h"
#include "tests/bench/bench_meshes.h"
#include "tests/core/promises.h"
#include "tests/testing/dice.h"
#include "tests/testing/families.h"

namespace planish::bench {
namespace {

constexpr std::int64_t kBytesPerFace = 8;  // of an encoded mesh, about
constexpr double kMostSeconds = 3;         // times the estimate, at most
constexpr double kLeastSeconds = 0.05;     // shorter jobs are not judged by their seconds
constexpr double kMostBytes = 2;           // likewise
constexpr double kNear = 1.0 / 3;          // of the estimate, and it was a near one
// CPU seconds after which a process is ended: it hangs.
constexpr double kHangs = 60, kHangsTimes = 60;

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
  double efficiency = 0;
};

// Numbers on the first line, then a sentence for each broken promise.
std::string UnwrapInThisProcess(const Mesh& given, const UnwrapOptions& options, std::int64_t most_bytes,
                                double seconds_estimated) {
  const std::int64_t held = StatusBytes("VmRSS");
  const rlimit cpu = {static_cast<rlim_t>(kHangs + kHangsTimes * seconds_estimated), RLIM_INFINITY};
  setrlimit(RLIMIT_CPU, &cpu);
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
         << (result.ok() ? result->widened.size() : 0) << ' ' << (result.ok() ? result->quality.packing_efficiency : 0)
         << '\n';
    if (options.seams.policy != SeamPolicy::kAuto) return text.str();
    for (const std::string& sentence : testing::BrokenPromises(mesh, options, result)) text << sentence << '\n';
  } catch (const std::bad_alloc&) {
    setrlimit(RLIMIT_DATA, &none);
    text << "0 0 0 0 0\nmore memory was needed than the " << most_bytes << " bytes that it may have\n";
  }
  return text.str();
}

Outcome UnwrapApart(const Mesh& mesh, const UnwrapOptions& options, std::int64_t most_bytes, double seconds_estimated) {
  int ends[2] = {};
  Outcome outcome;
  malloc_trim(0);
  std::fflush(stdout);
  if (pipe(ends) != 0) return {{"there is no pipe"}};
  const pid_t child = fork();
  if (child == 0) {
    const std::string text = UnwrapInThisProcess(mesh, options, most_bytes, seconds_estimated);
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
    const bool hung = WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU;
    outcome.broken.push_back(hung ? "the process hung" : "the process died, status " + std::to_string(status));
    return outcome;
  }
  std::istringstream lines(text);
  lines >> outcome.seconds >> outcome.bytes >> outcome.charts >> outcome.widened >> outcome.efficiency;
  lines.ignore();
  for (std::string line; std::getline(lines, line);) outcome.broken.push_back(line);
  return outcome;
}

// Of the mesh of this seed: as many sizes between one and ten times `least` as between ten and a hundred times.
int SizeOf(std::uint64_t seed, int least, int most) {
  if (most <= least) return least;
  testing::Dice dice(seed + 77);
  return static_cast<int>(least * std::pow(1.0 * most / least, dice.In(0, 1)));
}

// What was found so far.
class Hunt {
 public:
  Hunt(const UnwrapOptions& options, double memory, const std::string& out, const std::string& cases)
      : options_(options), memory_(memory), out_(out) {
    if (cases.empty()) return;
    cases_.open(cases);
    cases_ << "name\tfaces\tvertices\tcharts\tseconds\testimated\tbytes\testimated\n";
  }

  void Try(const std::string& name, const Mesh& mesh) {
    const Estimate estimate =
        EstimateUnwrap(mesh.num_faces(), mesh.num_vertices(), kBytesPerFace * mesh.num_faces(), options_);
    Outcome outcome =
        UnwrapApart(mesh, options_, static_cast<std::int64_t>(memory_ * static_cast<double>(estimate.peak_bytes)),
                    estimate.seconds);
    if (outcome.charts == 0 && outcome.broken.empty()) return;  // refused
    const double of_seconds = outcome.seconds / estimate.seconds;
    const double of_bytes = outcome.bytes / static_cast<double>(estimate.peak_bytes);
    if (of_seconds > kMostSeconds && outcome.seconds > kLeastSeconds) {
      outcome.broken.push_back(std::to_string(outcome.seconds) + " s, " + std::to_string(of_seconds) +
                               " times the estimate");
    }
    const std::string bytes =
        std::to_string(static_cast<std::int64_t>(outcome.bytes)) + " bytes, " + std::to_string(of_bytes);
    if (of_bytes > kMostBytes) {
      outcome.broken.push_back(bytes + " times the estimate");
    } else if (of_bytes > 1) {
      ++repeated_;
      std::printf("%s (%lld triangles): repeated, %s times the estimate\n", name.c_str(),
                  static_cast<long long>(mesh.num_faces()), bytes.c_str());
    }
    cases_ << name << '\t' << mesh.num_faces() << '\t' << mesh.num_vertices() << '\t' << outcome.charts << '\t'
           << outcome.seconds << '\t' << estimate.seconds << '\t' << outcome.bytes << '\t' << estimate.peak_bytes
           << std::endl;
    near_seconds_ += of_seconds >= kNear;
    near_bytes_ += of_bytes >= kNear;
    most_seconds_ = std::max(most_seconds_, of_seconds);
    most_bytes_ = std::max(most_bytes_, of_bytes);
    slowest_ = std::max(slowest_, outcome.seconds);
    ++of_family_;
    triangles_ += mesh.num_faces();
    charts_ += outcome.charts;
    widened_ += outcome.widened;
    efficiency_ += outcome.efficiency;
    if (outcome.broken.empty()) return;
    ++family_failed_;
    std::printf("%s (%lld triangles):", name.c_str(), static_cast<long long>(mesh.num_faces()));
    for (const std::string& sentence : outcome.broken) std::printf(" %s;", sentence.c_str());
    std::printf("\n");
    std::fflush(stdout);
    if (!out_.empty()) WriteObj(out_ + "/" + name + ".obj", mesh);
  }

  // Prints the figures since the last call.
  void EndFamily(const std::string& family) {
    std::printf(
        "%-16s %d of %d broke a promise; %lld triangles (%lld widened), %lld charts, efficiency %.2f; the slowest %.2f "
        "s; of the "
        "estimates at most %.2f of seconds, %.2f of bytes; a third or more in %d and %d; %d repeated\n",
        family.c_str(), family_failed_, of_family_, static_cast<long long>(triangles_),
        static_cast<long long>(widened_), static_cast<long long>(charts_), efficiency_ / std::max(of_family_, 1),
        slowest_, most_seconds_, most_bytes_, near_seconds_, near_bytes_, repeated_);
    std::fflush(stdout);
    tried_ += of_family_;
    failed_ += family_failed_;
    of_family_ = family_failed_ = near_seconds_ = near_bytes_ = repeated_ = 0;
    most_seconds_ = most_bytes_ = slowest_ = efficiency_ = 0;
    triangles_ = charts_ = widened_ = 0;
  }

  int End() const {
    std::printf("%d of %d broke a promise\n", failed_, tried_);
    return failed_ > 0 ? 1 : 0;
  }

 private:
  const UnwrapOptions& options_;
  const double memory_;
  const std::string& out_;
  std::ofstream cases_;
  int tried_ = 0, failed_ = 0;
  int of_family_ = 0, family_failed_ = 0, near_seconds_ = 0, near_bytes_ = 0, repeated_ = 0;
  double most_seconds_ = 0, most_bytes_ = 0, slowest_ = 0, efficiency_ = 0;
  std::int64_t triangles_ = 0, charts_ = 0, widened_ = 0;
};

int Main(int argc, char** argv) {
  CLI::App app("Looks for meshes on which Unwrap() breaks a promise");
  std::uint64_t first = 1;
  int seeds = 100, faces = 2000, most_faces = 0;
  bool as_float = false;
  double memory = kMostBytes;
  std::string out, cases, seams = "auto";
  std::vector<std::string> families, files;
  UnwrapOptions options;
  app.add_option("--first", first, "the first seed");
  app.add_option("--seeds", seeds, "so many of each family");
  app.add_option("--faces", faces, "about so many triangles each");
  app.add_option("--most-faces", most_faces, "random sizes, from --faces to so many");
  app.add_option("--max-stretch", options.seams.max_stretch);
  app.add_option("--prefer", options.seams.prefer, "seams or texture")
      ->transform(CLI::CheckedTransformer(std::map<std::string, SeamPreference>{
          {"seams", SeamPreference::kSeams}, {"texture", SeamPreference::kTexture}}));
  app.add_option("--out", out, "an existing folder, for the meshes on which promises were broken (OBJ)");
  app.add_option("--cases", cases, "a file to write");
  app.add_option("--effort", options.atlas.effort, "of packing: fast, normal or best")
      ->transform(CLI::CheckedTransformer(std::map<std::string, PackEffort>{
          {"fast", PackEffort::kFast}, {"normal", PackEffort::kNormal}, {"best", PackEffort::kBest}}));
  app.add_option("--tiles", options.atlas.tiles);
  app.add_option("--texture-size", options.atlas.texture_size);
  app.add_option("--padding", options.atlas.padding);
  app.add_option("--threads", options.threads);
  app.add_option("--reordered-faces", options.tuning.reordered_faces,
                 "unwrap meshes of so many faces in spatial order; default 50000");
  app.add_flag("--float", as_float, "deliver float, even where only double keeps every triangle");
  app.add_option("--memory", memory, "a process may have so many times the memory that was estimated");
  const std::map<std::string, SeamPolicy> policies = {{"none", SeamPolicy::kNone},
                                                      {"keep", SeamPolicy::kKeep},
                                                      {"needed", SeamPolicy::kNeeded},
                                                      {"uv", SeamPolicy::kNeeded},
                                                      {"auto", SeamPolicy::kAuto}};
  app.add_option("--seams", seams, "auto; or none, keep, needed or uv, for the estimates alone")
      ->check(CLI::IsMember(policies));
  app.add_option("--mesh", files, "mesh files instead of families");
  app.add_option("families", families);
  CLI11_PARSE(app, argc, argv);
  if (as_float) options.precision = Precision::kFloat;
  options.seams.policy = policies.at(seams);
  Hunt hunt(options, memory, out, cases);
  for (const std::string& file : files) {
    std::optional<SeamedMesh> given = ReadWithSeams(file);
    if (!given || given->mesh.faces.empty() || (seams == "uv" && !given->has_uv)) continue;
    if (seams != "uv") given->seam_corners.clear();
    options.seams.corners = std::move(given->seam_corners);
    hunt.Try(std::filesystem::path(file).stem(), given->mesh);
    hunt.EndFamily(std::filesystem::path(file).filename());
  }
  if (families.empty() && files.empty()) families = testing::Families();
  for (const std::string& family : families) {
    for (std::uint64_t seed = first; seed < first + static_cast<std::uint64_t>(seeds); ++seed) {
      const int wanted = SizeOf(seed, faces, most_faces);
      const Mesh mesh = testing::MakeFamily(family, seed, wanted);
      if (!mesh.faces.empty()) hunt.Try(family + "-" + std::to_string(seed) + "-" + std::to_string(wanted), mesh);
    }
    hunt.EndFamily(family);
  }
  return hunt.End();
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  return planish::bench::Main(argc, argv);
}
