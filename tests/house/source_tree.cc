#include "tests/house/source_tree.h"

#include <algorithm>

namespace planish::house {

namespace fs = std::filesystem;

fs::path Root() {
  return PLANISH_SOURCE_TREE;
}

std::set<std::string> TopLevel(const fs::path& root) {
  std::set<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(root)) names.insert(entry.path().filename().string());
  names.erase(".git");
  for (std::string ignored : Lines(ReadFile(root / ".gitignore"))) {
    while (!ignored.empty() && ignored.back() == '/') ignored.pop_back();
    while (!ignored.empty() && ignored.front() == '/') ignored.erase(0, 1);
    names.erase(ignored);
  }
  return names;
}

std::vector<SourceFile> ReadSources(const fs::path& root, const std::set<std::string>& extensions) {
  std::vector<SourceFile> files;
  for (const char* folder : {"proto", "core", "server", "client", "deploy", "tests"}) {
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(root / folder)) {
      const fs::path& path = entry.path();
      if (!entry.is_regular_file()) continue;
      if (!extensions.contains(path.extension().string()) && !extensions.contains(path.filename().string())) continue;
      files.push_back({path.lexically_relative(root).generic_string(), ReadFile(path)});
    }
  }
  std::sort(files.begin(), files.end(), [](const SourceFile& a, const SourceFile& b) { return a.path < b.path; });
  return files;
}

}  // namespace planish::house
