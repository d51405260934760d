#include "server/store/job_filter.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

constexpr std::size_t kMaxFilter = 1024;
constexpr std::string_view kLabels = "labels";

bool IsSpace(char c) {
  return absl::ascii_isspace(static_cast<unsigned char>(c));
}

bool IsBare(char c) {
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) ||
         std::string_view("-+_.:*").find(c) != std::string_view::npos;
}

bool IsFieldPart(char c) {
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' || c == '.';
}

class Parser {
 public:
  explicit Parser(std::string_view text) : text_(text) {}

  absl::StatusOr<JobFilter> Parse() {
    if (text_.size() > kMaxFilter) return Wrong(absl::StrCat("it is longer than ", kMaxFilter, " bytes"));
    SkipSpace();
    while (!AtEnd()) {
      PLANISH_RETURN_IF_ERROR(ParseCondition());
      const bool spaced = SkipSpace();
      if (AtEnd()) break;
      if (!spaced || Take(IsFieldPart) != "AND") return Wrong("conditions are joined by AND");
      if (!SkipSpace() || AtEnd()) return Wrong("a condition must follow AND");
    }
    return std::move(filter_);
  }

 private:
  absl::Status ParseCondition() {
    const std::string field(Take(IsFieldPart));
    SkipSpace();
    const std::string comparison(TakeComparison());
    SkipSpace();
    if (field.empty() || comparison.empty()) return Wrong("a condition is a field, a comparison and a value");
    PLANISH_ASSIGN_OR_RETURN(std::string value, TakeValue());
    if (field == "state") return AddState(comparison, value);
    if (field == "create_time") return AddTime(comparison, value);
    if (field == "tenant") return AddTenant(comparison, std::move(value));
    if (field == kLabels && comparison == ":") {
      return AddLabel({std::move(value), LabelCondition::Kind::kExists, "", false});
    }
    const bool is_label =
        field.size() > kLabels.size() + 1 && field.starts_with(kLabels) && field[kLabels.size()] == '.';
    if (is_label && IsEquality(comparison)) {
      const bool has_star = !value.empty() && value.back() == '*';
      if (has_star) value.pop_back();
      return AddLabel({field.substr(kLabels.size() + 1),
                       has_star ? LabelCondition::Kind::kBeginsWith : LabelCondition::Kind::kEquals, std::move(value),
                       comparison == "!="});
    }
    return Wrong(absl::StrCat("there is no condition '", field, " ", comparison, "'"));
  }

  absl::Status AddState(const std::string& comparison, const std::string& value) {
    v1::JobState state = v1::JOB_STATE_UNSPECIFIED;
    if (!IsEquality(comparison) || !v1::JobState_Parse("JOB_STATE_" + value, &state) ||
        state == v1::JOB_STATE_UNSPECIFIED) {
      return Wrong(absl::StrCat("state ", comparison, " ", value, " is no state that a job can be in"));
    }
    filter_.states.push_back({state, comparison == "!="});
    return absl::OkStatus();
  }

  absl::Status AddTime(const std::string& comparison, const std::string& value) {
    absl::Time time;
    std::string error;
    if (!absl::ParseTime(absl::RFC3339_full, value, &time, &error)) {
      return Wrong(absl::StrCat("create_time: '", value, "' is no time such as 2026-01-31T08:00:00Z"));
    }
    const absl::Time after = time + absl::Nanoseconds(1);
    if (comparison == ">=" || comparison == ">") {
      const absl::Time from = comparison == ">" ? after : time;
      filter_.from = std::max(filter_.from.value_or(from), from);
    } else if (comparison == "<" || comparison == "<=") {
      const absl::Time before = comparison == "<" ? time : after;
      filter_.before = std::min(filter_.before.value_or(before), before);
    } else {
      return Wrong("create_time is compared by >=, >, < or <=");
    }
    return absl::OkStatus();
  }

  absl::Status AddTenant(const std::string& comparison, std::string value) {
    if (comparison != "=" || value.empty() || !filter_.tenant.empty()) {
      return Wrong("tenant is compared once, by =");
    }
    filter_.tenant = std::move(value);
    return absl::OkStatus();
  }

  absl::Status AddLabel(LabelCondition condition) {
    if (!IsLabelKey(condition.key)) return Wrong(absl::StrCat("'", condition.key, "' cannot be the key of a label"));
    filter_.labels.push_back(std::move(condition));
    return absl::OkStatus();
  }

  static bool IsEquality(const std::string& comparison) { return comparison == "=" || comparison == "!="; }

  bool AtEnd() const { return at_ == text_.size(); }

  // Returns whether there was any space.
  bool SkipSpace() { return !Take(IsSpace).empty(); }

  std::string_view Take(bool (*is_part)(char)) {
    const std::size_t begin = at_;
    while (!AtEnd() && is_part(text_[at_])) ++at_;
    return text_.substr(begin, at_ - begin);
  }

  std::string_view TakeComparison() {
    for (const std::string_view known : {">=", "<=", "!=", "=", ">", "<", ":"}) {
      if (!text_.substr(at_).starts_with(known)) continue;
      at_ += known.size();
      return known;
    }
    return {};
  }

  absl::StatusOr<std::string> TakeValue() {
    if (AtEnd() || text_[at_] != '"') {
      const std::string_view bare = Take(IsBare);
      if (bare.empty()) return Wrong("a value is missing, or needs quotes");
      return std::string(bare);
    }
    std::string value;
    for (++at_; !AtEnd() && text_[at_] != '"'; ++at_) {
      if (text_[at_] == '\\' && ++at_ == text_.size()) break;
      value.push_back(text_[at_]);
    }
    if (AtEnd()) return Wrong("a quote is not closed");
    ++at_;
    return value;
  }

  absl::Status Wrong(const std::string& why) const {
    return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID",
                     absl::StrCat("filter, at byte ", at_, ": ", why), {{"field", "filter"}});
  }

  const std::string_view text_;
  std::size_t at_ = 0;
  JobFilter filter_;
};

}  // namespace

bool IsLabelKey(std::string_view key) {
  return !key.empty() && key.size() <= kMostLabelKey && absl::ascii_islower(static_cast<unsigned char>(key.front())) &&
         std::all_of(key.begin(), key.end(), [](unsigned char c) {
           return absl::ascii_islower(c) || absl::ascii_isdigit(c) || c == '-' || c == '_';
         });
}

absl::StatusOr<JobFilter> ParseJobFilter(std::string_view text) {
  return Parser(text).Parse();
}

}  // namespace planish
