// Files and folders of tests, and their text.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace planish {

// A new empty directory with a short path, so that sockets fit into it; removed with everything in it.
class TempDir {
 public:
  TempDir();
  ~TempDir();
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;

  // Of the directory itself, if `name` is empty.
  std::string Path(const std::string& name = "") const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

// All bytes of a file. Throws std::runtime_error if it cannot be opened.
std::string ReadFile(const std::filesystem::path& path);
// Writes a file anew, or appends. Throws std::runtime_error if that fails.
void PutFile(const std::filesystem::path& path, std::string_view bytes, bool append = false);
// In one step, as whoever renews a certificate should.
void ReplaceFile(const std::filesystem::path& path, std::string_view bytes, int mode = 0600);

// Without their ends.
std::vector<std::string> Lines(const std::string& text);

using TableRow = std::map<std::string, std::string>;  // from heading to cell

// A table in a file: a heading, then rows, with tabs between cells. Nothing if there is no such file.
std::vector<TableRow> ReadTable(const std::filesystem::path& path);

}  // namespace planish
