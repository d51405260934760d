// The configuration file as keys and values, before their meaning is known.
#pragma once

#include <string>
#include <vector>

namespace planish {

struct FileValue {
  std::string text;
  int line = 0;  // counted from 1
};

struct FileSetting {
  std::string key;
  int line = 0;
  bool is_list = false;
  std::vector<FileValue> values;  // one unless it is a list
};

struct SettingsFile {
  std::vector<FileSetting> settings;  // in the file's order, each key once
  std::vector<std::string> errors;    // "FILE:LINE: KEY: ...", or "FILE: ..." for the file as a whole
};

// Reads a YAML mapping of keys to values or lists of values; an empty file has no keys. Wrong entries are left out of
// the settings and described in the errors.
SettingsFile ReadSettingsFile(const std::string& path);

}  // namespace planish
