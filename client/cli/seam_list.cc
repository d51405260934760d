#include "client/cli/seam_list.h"

#include <charconv>
#include <optional>

namespace planish::cli {
namespace {

// Items between commas, empty ones included.
std::vector<std::string> Items(const std::string& text) {
  std::vector<std::string> items = {""};
  for (const char c : text) {
    if (c == ',') {
      items.emplace_back();
    } else {
      items.back() += c;
    }
  }
  return items;
}

std::optional<Seams> PolicyNamed(const std::string& name) {
  for (const Seams policy : {Seams::kNone, Seams::kKeep, Seams::kNeeded, Seams::kAuto}) {
    if (name == ToString(policy)) return policy;
  }
  return std::nullopt;
}

// What stands behind `prefix`; nothing if `item` begins otherwise.
std::optional<std::string> After(const std::string& prefix, const std::string& item) {
  if (item.rfind(prefix, 0) != 0) return std::nullopt;
  return item.substr(prefix.size());
}

std::string ParseDegrees(const std::string& text, double* degrees) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *degrees);
  if (error == std::errc() && end == text.data() + text.size() && *degrees > 0 && *degrees <= 180) return "";
  return "hard:" + text + ": the angle must be a number of degrees above 0 and up to 180";
}

}  // namespace

std::string ParseSeamList(const std::string& text, SeamList* list) {
  *list = SeamList();
  std::optional<Seams> policy;
  bool has_source = false;
  for (const std::string& item : Items(text)) {
    if (const auto named = PolicyNamed(item)) {
      if (policy) return std::string(ToString(*policy)) + " and " + item + " exclude each other";
      policy = named;
      continue;
    }
    if (const auto file = After("uncut:", item); file && !file->empty()) {
      list->uncut_files.push_back(*file);
      continue;
    }
    has_source = true;
    if (item == "uv") {
      list->uv = true;
    } else if (item == "materials") {
      list->materials = true;
    } else if (item == "groups") {
      list->groups = true;
    } else if (item == "hard") {
      list->hard_edge_degrees = kDefaultHardEdge;
    } else if (const auto degrees = After("hard:", item)) {
      if (std::string problem = ParseDegrees(*degrees, &list->hard_edge_degrees); !problem.empty()) {
        return problem;
      }
    } else if (const auto file = After("edges:", item); file && !file->empty()) {
      list->edge_files.push_back(*file);
    } else {
      return "'" + item + "' is neither none, keep, needed or auto, nor one of uv, hard, hard:DEG, edges:FILE, " +
             "materials, groups, uncut:FILE";
    }
  }
  if (policy == Seams::kNone && (has_source || !list->uncut_files.empty())) {
    return "none means that no edge is cut, so it goes with nothing else";
  }
  list->policy = policy.value_or(has_source ? Seams::kNeeded : Seams::kAuto);
  return "";
}

}  // namespace planish::cli
