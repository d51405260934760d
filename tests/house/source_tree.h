// The files of the repository as they lie on disk.
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "tests/testing/files.h"

namespace planish::house {

struct SourceFile {
  std::string path;  // relative to the repository's root, with '/'
  std::string text;
};

// Root of the source tree under test.
std::filesystem::path Root();

// Names of files and folders directly under `root`, without .git and whatever .gitignore names.
std::set<std::string> TopLevel(const std::filesystem::path& root);

// All files under proto, core, server, client, deploy and tests with one of these extensions (".cc"; for files that
// have none to speak of, the whole name: "CMakeLists.txt"), in the order of their paths.
std::vector<SourceFile> ReadSources(const std::filesystem::path& root, const std::set<std::string>& extensions);

}  // namespace planish::house
