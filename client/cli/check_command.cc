#include <algorithm>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "client/cli/check_report.h"
#include "client/cli/commands.h"
#include "client/cli/json.h"
#include "client/cli/summary.h"
#include "client/cli/text.h"
#include "client/files/mesh_file.h"

namespace planish::cli {
namespace {

// Judges file after file, and counts.
class CheckRun {
 public:
  CheckRun(const Arguments& arguments, const Execution& execution) : arguments_(arguments), execution_(execution) {
    if (arguments.options.texture_size != 0) options_.texture_size = arguments.options.texture_size;
    if (arguments.options.tiles != 0) options_.tiles = arguments.options.tiles;
    options_.min_padding = arguments.check.min_padding;
  }

  void File(const std::string& path) {
    ++files_;
    try {
      const int first = arguments_.check.all_texcoords || !HasSets(path) ? 0 : arguments_.texcoord;
      const MeshInput input({path}, first);
      const std::vector<int> sets = UvSets(input.file());
      if (!arguments_.check.all_texcoords || sets.empty()) return Map(input, first, sets);
      for (const int set : sets) {
        if (!execution_.IsCancelled()) Map(MeshInput({path}, set), set, sets);
      }
    } catch (const Error& error) {
      ++unreadable_;
      std::cerr << ErrorText(error, Places(error.metadata()), StderrTerminal());
      if (arguments_.json) {
        Print({{"file", path},
               {"error", {{"reason", error.reason()}, {"message", error.what()}, {"metadata", error.metadata()}}},
               {"ok", false}});
      }
    }
  }

  int End() const {
    if (IsSeveral()) {
      if (arguments_.json) {
        Print({{"summary", {{"files", files_}, {"maps", maps_}, {"failed", failed_}, {"unreadable", unreadable_}}}});
      } else {
        std::cout << Counted(files_, "file", "files") << ", " << Counted(maps_, "map", "maps") << ": "
                  << (failed_ == 0 ? "all as required" : WithCommas(failed_) + " not as required")
                  << (unreadable_ == 0 ? "" : ", " + Counted(unreadable_, "file is unreadable", "files are unreadable"))
                  << ".\n";
      }
    }
    std::cout << std::flush;
    return unreadable_ > 0 ? kUsage : failed_ > 0 ? kFailed : kOk;
  }

 private:
  static bool HasSets(const std::string& path) {
    const std::optional<MeshFormat> format = FormatOfPath(path);
    return IsStream(path) || format == MeshFormat::kGltf || format == MeshFormat::kGlb;
  }
  bool IsSeveral() const { return !arguments_.more_inputs.empty() || arguments_.check.all_texcoords; }

  void Print(const Json& json) const { std::cout << (IsSeveral() ? ToLine(json) + "\n" : ToText(json)) << std::flush; }

  void Map(const MeshInput& input, int set, const std::vector<int>& sets) {
    const CheckedMap map = CheckMapOf(input, options_, execution_);
    if (execution_.IsCancelled()) return;
    ++maps_;
    const std::vector<RequirementResult> results = CheckRequirements(arguments_.check, map);
    failed_ += AreMet(results) ? 0 : 1;
    if (arguments_.json) return Print(CheckJson(input, set, sets, options_, map, results));
    std::cout << CheckText(input, set, sets, options_, map, results) << std::flush;
  }

  const Arguments& arguments_;
  const Execution& execution_;
  MapCheckOptions options_;
  std::int64_t files_ = 0, maps_ = 0, failed_ = 0, unreadable_ = 0;
};

}  // namespace

int RunCheck(const Arguments& arguments, Interrupts& interrupts) {
  const auto interrupter = std::make_shared<Interrupter>();
  ThreadTeam team(std::max(1, static_cast<int>(std::thread::hardware_concurrency())));
  Execution execution;
  execution.team = &team;
  execution.cancel = interrupter.get();
  interrupts.SetCancel([interrupter] { interrupter->Interrupt(); });
  CheckRun run(arguments, execution);
  run.File(arguments.input);
  for (const std::string& path : arguments.more_inputs) {
    if (!interrupter->IsInterrupted()) run.File(path);
  }
  interrupts.SetCancel({});
  if (interrupter->IsInterrupted()) {
    std::cerr << "planish: interrupted\n";
    return kInterrupted;
  }
  return run.End();
}

}  // namespace planish::cli
