// planish_memory_use MESH [none|auto|...] [THREADS]: the most memory that a worker's part of a job takes, in a process
// that does nothing else. MESH as in bench_meshes.h. The mesh is made and encoded by a child process, so that this one
// is as idle as a worker before the job. One JSON object:
//
//   idle_bytes   resident before: the encoded bytes not yet there
//   peak_bytes   VmHWM at the end, less that: encoded bytes, decoding, unwrapping, UV as float
//   seconds, cpu_seconds   decoding and unwrapping: wall clock, and CPU of all threads
//   estimate_bytes, estimate_seconds   EstimateUnwrap() of the counts that the encoded bytes declare
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "core/base/heap.h"
#include "core/base/timer.h"
#include "core/draco/codec.h"
#include "core/draco/header.h"
#include "core/unwrap/estimate.h"
#include "core/unwrap/unwrap.h"
#include "nlohmann/json.hpp"
#include "tests/bench/bench_meshes.h"

namespace planish::bench {
namespace {

// A line "VmHWM:   1234 kB" of /proc/self/status, in bytes.
std::int64_t StatusBytes(const std::string& field) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(field + ":")) return 1024 * std::strtoll(line.c_str() + field.size() + 1, nullptr, 10);
  }
  return 0;
}

double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Writes MESH, encoded, to `path`, in a process of its own.
bool WriteEncoded(const std::string& spec, const std::string& path) {
  const pid_t child = fork();
  if (child == 0) {
    const absl::StatusOr<Mesh> mesh = LoadMesh(spec);
    if (!mesh.ok()) {
      std::fprintf(stderr, "%s\n", mesh.status().ToString().c_str());
      _exit(1);
    }
    const absl::StatusOr<std::string> bytes = EncodeDraco(*mesh);
    if (!bytes.ok()) _exit(1);
    std::ofstream(path, std::ios::binary) << *bytes;
    _exit(0);
  }
  int status = 0;
  return child > 0 && waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

std::string ReadBytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  std::string bytes(static_cast<std::size_t>(file.tellg()), '\0');
  file.seekg(0);
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return bytes;
}

SeamPolicy PolicyOf(const std::string& name) {
  return name == "none"     ? SeamPolicy::kNone
         : name == "keep"   ? SeamPolicy::kKeep
         : name == "needed" ? SeamPolicy::kNeeded
                            : SeamPolicy::kAuto;
}

int Main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "planish_memory_use MESH [none|keep|needed|auto] [THREADS]\n");
    return 2;
  }
  KeepFreedMemory();  // as a worker does
  const std::string spec = argv[1], seams = argc > 2 ? argv[2] : "auto";
  UnwrapOptions options;
  options.seams.policy = PolicyOf(seams);
  options.threads = argc > 3 ? std::atoi(argv[3]) : 1;
  std::string path = "/tmp/planish-memory-XXXXXX";
  const int descriptor = mkstemp(path.data());
  if (descriptor < 0 || !WriteEncoded(spec, path)) return 1;
  close(descriptor);
  const std::int64_t idle = StatusBytes("VmRSS");
  nlohmann::json line = {{"mesh", LabelOf(spec)}, {"seams", seams}, {"threads", options.threads}, {"idle_bytes", idle}};
  {
    const std::string bytes = ReadBytes(path);
    unlink(path.c_str());
    const DracoCounts counts = PeekDraco(bytes).value();
    const Estimate estimate =
        EstimateUnwrap(counts.faces.value(), counts.vertices.value(), static_cast<std::int64_t>(bytes.size()), options);
    Timer timer;
    const double cpu_before = CpuSeconds();
    const Mesh mesh = DecodeDraco(bytes).value();
    const absl::StatusOr<UnwrapResult> result = Unwrap(mesh, options, {});
    line["seconds"] = timer.Seconds();
    line["cpu_seconds"] = CpuSeconds() - cpu_before;
    line["triangles"] = mesh.num_faces();
    line["ended"] = result.ok() ? "ok" : std::string(result.status().message());
    if (result.ok()) {
      // What goes into the answer.
      const std::vector<float> uv(result->uv.begin(), result->uv.end());
      line["charts"] = result->charts.size();
      line["uv_bytes"] = uv.size() * sizeof(float);
    }
    line["mesh_bytes"] = bytes.size();
    line["estimate_bytes"] = estimate.peak_bytes;
    line["estimate_seconds"] = estimate.seconds;
  }
  line["peak_bytes"] = StatusBytes("VmHWM") - idle;
  std::printf("%s\n", line.dump().c_str());
  return 0;
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  return planish::bench::Main(argc, argv);
}
