#include "client/src/find_planishd.h"

#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "client/src/process.h"

namespace planish {

namespace fs = std::filesystem;

std::string FindPlanishd(const std::string& directory) {
  if (!directory.empty()) {
    for (const fs::path& candidate : {fs::path(directory) / "planishd", fs::path(directory) / "../bin/planishd"}) {
      if (IsExecutable(candidate)) return candidate.lexically_normal();
    }
  }
  const char* named = std::getenv("PLANISHD");
  if (named != nullptr && *named != '\0') return IsExecutable(named) ? named : "";
  const char* path = std::getenv("PATH");
  std::istringstream directories(path == nullptr ? "" : path);
  for (std::string entry; std::getline(directories, entry, ':');) {
    const fs::path candidate = fs::path(entry) / "planishd";
    if (!entry.empty() && IsExecutable(candidate)) return candidate;
  }
  return "";
}

}  // namespace planish
