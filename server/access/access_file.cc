#include "server/access/access_file.h"

#include <pwd.h>
#include <sys/stat.h>

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/read_file.h"
#include "core/base/status_macros.h"
#include "yaml-cpp/yaml.h"

namespace planish {
namespace {

constexpr std::size_t kMaxTenantName = 63;
constexpr std::int64_t kMiB = std::int64_t{1} << 20;

bool IsTenantName(const std::string& name) {
  if (name.empty() || name.size() > kMaxTenantName || name[0] == '_' || name[0] == '-') return false;
  for (const char c : name) {
    const bool known = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
    if (!known) return false;
  }
  return true;
}

std::optional<std::uint32_t> UserId(const std::string& text) {
  std::uint32_t uid = 0;
  if (absl::SimpleAtoi(text, &uid)) return uid;
  passwd entry = {};
  passwd* found = nullptr;
  std::vector<char> buffer(16384);
  if (getpwnam_r(text.c_str(), &entry, buffer.data(), buffer.size(), &found) != 0 || found == nullptr) {
    return std::nullopt;
  }
  return found->pw_uid;
}

int LineOf(const YAML::Node& node) {
  return node.Mark().is_null() ? 0 : node.Mark().line + 1;
}

// One value of the file, and its place.
struct Item {
  YAML::Node node;
  std::string key;  // "tenants.lighting.queue"
  int line;         // of the key, or of the value if it has no key; 0: unknown
};

class Parser {
 public:
  explicit Parser(std::string file) : file_(std::move(file)) {}

  absl::StatusOr<std::shared_ptr<const AccessTable>> Parse(const YAML::Node& root) {
    PLANISH_ASSIGN_OR_RETURN(const auto top, Map({root, "", LineOf(root)}, {"tenants"}));
    if (!top.contains("tenants")) return absl::InvalidArgumentError(file_ + ": there are no tenants");
    PLANISH_ASSIGN_OR_RETURN(const auto tenants, Map(top.at("tenants"), {}));
    if (tenants.empty()) return Wrong(top.at("tenants"), "there are none");
    for (const auto& [name, item] : tenants) PLANISH_RETURN_IF_ERROR(Tenant(name, item));
    return std::make_shared<const AccessTable>(std::move(limits_), std::move(credentials_));
  }

 private:
  std::string Where(const Item& item) const {
    const std::string line = item.line == 0 ? "" : absl::StrCat(":", item.line);
    return absl::StrCat(file_, line, ": ", item.key.empty() ? "" : item.key + ": ");
  }

  absl::Status Wrong(const Item& item, const std::string& what) const {
    return absl::InvalidArgumentError(Where(item) + what);
  }

  // The values of a map by their keys. Each key must occur once and be one of `known` (any key, if that is empty).
  absl::StatusOr<std::map<std::string, Item>> Map(const Item& item, const std::vector<std::string>& known) const {
    if (!item.node.IsMap()) return Wrong(item, "expected \"key: value\" lines");
    std::map<std::string, Item> map;
    for (const auto& entry : item.node) {
      const std::string name = entry.first.IsScalar() ? entry.first.Scalar() : "";
      const Item key = {entry.first, item.key.empty() ? name : absl::StrCat(item.key, ".", name), LineOf(entry.first)};
      if (!known.empty() && std::find(known.begin(), known.end(), name) == known.end()) {
        return Wrong(key, "no such key; there are " + absl::StrJoin(known, ", "));
      }
      if (!map.emplace(name, Item{entry.second, key.key, key.line}).second) return Wrong(key, "is there twice");
    }
    return map;
  }

  absl::StatusOr<std::string> Text(const Item& item) const {
    if (!item.node.IsScalar() || item.node.Scalar().empty()) return Wrong(item, "expected a single value");
    return item.node.Scalar();
  }

  absl::StatusOr<std::vector<Item>> List(const Item& item) const {
    if (!item.node.IsSequence()) return Wrong(item, "expected a list");
    std::vector<Item> items;
    for (std::size_t i = 0; i < item.node.size(); ++i) {
      items.push_back({item.node[i], absl::StrCat(item.key, "[", i, "]"), LineOf(item.node[i])});
    }
    return items;
  }

  // Sets *value to the number of the key `name`, which must be `low` to `high`. Without that key *value does not
  // change.
  template <class Number>
  absl::Status Take(const std::map<std::string, Item>& map, const std::string& name, std::int64_t low,
                    std::int64_t high, Number* value) const {
    const auto found = map.find(name);
    if (found == map.end()) return absl::OkStatus();
    PLANISH_ASSIGN_OR_RETURN(const std::string text, Text(found->second));
    std::int64_t number = 0;
    if (!absl::SimpleAtoi(text, &number) || number < low || number > high) {
      return Wrong(found->second, absl::StrCat("expected a whole number from ", low, " to ", high, ", not ", text));
    }
    *value = static_cast<Number>(number);
    return absl::OkStatus();
  }

  absl::Status TakeShare(const std::map<std::string, Item>& map, double* share) const {
    const auto found = map.find("share");
    if (found == map.end()) return absl::OkStatus();
    PLANISH_ASSIGN_OR_RETURN(const std::string text, Text(found->second));
    if (!absl::SimpleAtod(text, share) || !(*share > 0) || *share > 1e6) {
      return Wrong(found->second, "expected a number above 0, up to 1000000, not " + text);
    }
    return absl::OkStatus();
  }

  absl::Status Tenant(const std::string& name, const Item& item) {
    if (!IsTenantName(name)) {
      return Wrong(item, "a tenant's name has 1 to 63 of a-z, 0-9, _ and -, the first a letter or digit");
    }
    TenantLimits limits;
    if (item.node.IsNull()) {  // "name:" alone
      limits_[name] = limits;
      return absl::OkStatus();
    }
    PLANISH_ASSIGN_OR_RETURN(const auto map,
                             Map(item, {"share", "queue", "running", "memory-mb", "store-mb", "credentials"}));
    PLANISH_RETURN_IF_ERROR(TakeShare(map, &limits.share));
    PLANISH_RETURN_IF_ERROR(Take(map, "queue", 0, 100'000, &limits.queue));
    PLANISH_RETURN_IF_ERROR(Take(map, "running", 1, 1024, &limits.running));
    std::int64_t memory_mb = -1, store_mb = -1;
    PLANISH_RETURN_IF_ERROR(Take(map, "memory-mb", 1, 100'000'000, &memory_mb));
    if (memory_mb >= 0) limits.memory_bytes = memory_mb * kMiB;
    PLANISH_RETURN_IF_ERROR(Take(map, "store-mb", 1, 100'000'000, &store_mb));
    if (store_mb >= 0) limits.store_bytes = store_mb * kMiB;
    limits_[name] = limits;
    if (const auto found = map.find("credentials"); found != map.end() && !found->second.node.IsNull()) {
      PLANISH_ASSIGN_OR_RETURN(const std::vector<Item> list, List(found->second));
      for (const Item& each : list) PLANISH_RETURN_IF_ERROR(TakeCredential(name, each));
    }
    return absl::OkStatus();
  }

  absl::Status TakeCredential(const std::string& tenant, const Item& item) {
    PLANISH_ASSIGN_OR_RETURN(const auto map,
                             Map(item, {"token-sha256", "certificate", "user", "name", "rights", "expires"}));
    if (map.count("token-sha256") + map.count("certificate") + map.count("user") != 1) {
      return Wrong(item, "expected exactly one of token-sha256, certificate and user");
    }
    Credential credential;
    credential.tenant = tenant;
    std::string same;  // identifies the token, certificate or user, so that a second entry for it is refused
    PLANISH_RETURN_IF_ERROR(Identify(map, &credential, &same));
    if (const auto found = map.find("name"); found != map.end()) {
      PLANISH_ASSIGN_OR_RETURN(const std::string name, Text(found->second));
      const std::string kind = credential.label.substr(0, credential.label.find(' '));
      credential.label = absl::StrCat(kind, " ", name);
    }
    PLANISH_ASSIGN_OR_RETURN(credential.rights, RightsOf(map));
    if (const auto found = map.find("expires"); found != map.end()) {
      PLANISH_ASSIGN_OR_RETURN(const std::string text, Text(found->second));
      std::string error;
      if (!absl::ParseTime(absl::RFC3339_full, text, &credential.expires, &error)) {
        return Wrong(found->second, "expected a time like 2027-01-01T00:00:00Z, not " + text);
      }
    }
    const auto [first, is_new] = known_.emplace(same, Where(item));
    if (!is_new) return Wrong(item, "the same credential is at " + first->second.substr(0, first->second.size() - 2));
    credentials_.push_back(std::move(credential));
    return absl::OkStatus();
  }

  absl::Status Identify(const std::map<std::string, Item>& map, Credential* credential, std::string* same) const {
    if (const auto token = map.find("token-sha256"); token != map.end()) {
      PLANISH_ASSIGN_OR_RETURN(const std::string text, Text(token->second));
      const std::optional<TokenDigest> digest = ParseTokenDigest(text);
      // Not repeated in the message: it may be the token itself.
      if (!digest) return Wrong(token->second, "expected the SHA-256 of a token, 64 hexadecimal digits");
      credential->kind = Credential::Kind::kToken;
      credential->digest = *digest;
      credential->label = "token " + ShortName(*digest);
      *same = "token " + absl::AsciiStrToLower(text);
    } else if (const auto certificate = map.find("certificate"); certificate != map.end()) {
      PLANISH_ASSIGN_OR_RETURN(const std::string text, Text(certificate->second));
      credential->kind = Credential::Kind::kCertificate;
      credential->certificate = absl::AsciiStrToLower(text);
      credential->label = "certificate " + credential->certificate;
      *same = credential->label;
    } else {
      const Item& user = map.at("user");
      PLANISH_ASSIGN_OR_RETURN(const std::string text, Text(user));
      const std::optional<std::uint32_t> uid = UserId(text);
      if (!uid) return Wrong(user, "this system has no user " + text);
      credential->kind = Credential::Kind::kUser;
      credential->user = *uid;
      credential->label = "user " + text;
      *same = absl::StrCat("user ", *uid);
    }
    return absl::OkStatus();
  }

  absl::StatusOr<Rights> RightsOf(const std::map<std::string, Item>& map) const {
    Rights rights;
    const auto found = map.find("rights");
    if (found == map.end()) {
      rights.submit = rights.jobs = true;
      return rights;
    }
    const std::map<std::string, bool*> names = {
        {"submit", &rights.submit}, {"jobs", &rights.jobs}, {"all-jobs", &rights.all_jobs}, {"admin", &rights.admin}};
    PLANISH_ASSIGN_OR_RETURN(const std::vector<Item> list, List(found->second));
    if (list.empty()) return Wrong(found->second, "the list is empty; leave the line out for submit and jobs");
    for (const Item& each : list) {
      PLANISH_ASSIGN_OR_RETURN(const std::string text, Text(each));
      const auto right = names.find(text);
      if (right == names.end()) {
        return Wrong(each, "unknown right: " + text + "; use submit, jobs, all-jobs or admin");
      }
      *right->second = true;
    }
    return rights;
  }

  const std::string file_;
  std::map<std::string, TenantLimits> limits_;
  std::vector<Credential> credentials_;
  std::map<std::string, std::string> known_;  // from a credential to its place in the file
};

}  // namespace

absl::StatusOr<std::shared_ptr<const AccessTable>> ParseAccessFile(const std::string& text, const std::string& file) {
  // yaml-cpp reports errors by exceptions.
  try {
    return Parser(file).Parse(YAML::Load(text));
  } catch (const YAML::Exception& error) {
    const std::string line = error.mark.is_null() ? "" : absl::StrCat(":", error.mark.line + 1);
    return absl::InvalidArgumentError(absl::StrCat(file, line, ": ", error.msg));
  }
}

absl::StatusOr<LoadedAccess> LoadAccessFile(const std::string& file) {
  PLANISH_ASSIGN_OR_RETURN(const std::string text, ReadTextFile("the access file", file));
  LoadedAccess loaded;
  struct stat info = {};
  if (stat(file.c_str(), &info) == 0) {
    if ((info.st_mode & S_IWOTH) != 0) {
      return absl::InvalidArgumentError(file + ": everybody on this machine can change it: chmod o-rwx " + file);
    }
    if ((info.st_mode & S_IROTH) != 0) {
      loaded.warnings.push_back(file + ": everybody on this machine can read it: chmod o-r " + file);
    }
  }
  PLANISH_ASSIGN_OR_RETURN(loaded.table, ParseAccessFile(text, file));
  return loaded;
}

}  // namespace planish
