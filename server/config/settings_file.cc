#include "server/config/settings_file.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "yaml-cpp/yaml.h"

namespace planish {
namespace {

constexpr std::size_t kMaxBytes = std::size_t{1} << 20;

int LineOf(const YAML::Mark& mark) {
  return mark.line + 1;
}

class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path) {}

  SettingsFile Read() {
    const std::optional<std::string> text = Bytes();
    if (!text.has_value()) return std::move(file_);
    try {
      const std::vector<YAML::Node> documents = YAML::LoadAll(*text);
      if (documents.size() > 1) {
        Fail("holds more than one YAML document");
      } else if (!documents.empty() && !documents.front().IsNull()) {
        ReadMap(documents.front());
      }
    } catch (const YAML::Exception& error) {
      Fail(LineOf(error.mark), absl::StrCat("this is no YAML: ", error.msg));
    }
    return std::move(file_);
  }

 private:
  std::optional<std::string> Bytes() {
    errno = 0;
    std::ifstream stream(path_, std::ios::binary);
    std::ostringstream bytes;
    // A directory can be opened; only reading it fails.
    if (!stream || !(bytes << stream.rdbuf())) {
      if (stream.is_open() && errno == 0) return "";
      Fail(absl::StrCat("cannot read it: ", std::strerror(errno)));
      return std::nullopt;
    }
    if (bytes.view().size() > kMaxBytes) {
      Fail(absl::StrCat("is larger than ", kMaxBytes, " bytes"));
      return std::nullopt;
    }
    return std::move(bytes).str();
  }

  void ReadMap(const YAML::Node& map) {
    if (!map.IsMap()) return Fail(LineOf(map.Mark()), "the file should have \"key: value\" on each line");
    std::map<std::string, int> lines;
    for (const auto& entry : map) {
      const int line = LineOf(entry.first.Mark());
      if (!entry.first.IsScalar()) {
        Fail(line, "a key should be a word");
        continue;
      }
      const std::string& key = entry.first.Scalar();
      const auto [earlier, is_new] = lines.emplace(key, line);
      if (!is_new) {
        Fail(line, absl::StrCat(key, ": is there a second time, after line ", earlier->second));
      } else {
        ReadSetting(key, line, entry.second);
      }
    }
  }

  void ReadSetting(const std::string& key, int line, const YAML::Node& node) {
    FileSetting setting = {key, line, node.IsSequence(), {}};
    if (node.IsScalar()) {
      setting.values.push_back({node.Scalar(), LineOf(node.Mark())});
    } else if (!node.IsSequence()) {
      return Fail(line, absl::StrCat(key, node.IsNull() ? ": has no value" : ": takes a value, not keys of its own"));
    }
    for (std::size_t i = 0; setting.is_list && i < node.size(); ++i) {
      if (!node[i].IsScalar()) {
        return Fail(LineOf(node[i].Mark()), absl::StrCat(key, ": a list should hold values only"));
      }
      setting.values.push_back({node[i].Scalar(), LineOf(node[i].Mark())});
    }
    file_.settings.push_back(std::move(setting));
  }

  void Fail(const std::string& what) { file_.errors.push_back(absl::StrCat(path_, ": ", what)); }
  void Fail(int line, const std::string& what) { Fail(absl::StrCat(path_, ":", line), what); }
  void Fail(const std::string& where, const std::string& what) {
    file_.errors.push_back(absl::StrCat(where, ": ", what));
  }

  const std::string path_;
  SettingsFile file_;
};

}  // namespace

SettingsFile ReadSettingsFile(const std::string& path) {
  return Reader(path).Read();
}

}  // namespace planish
