// Filters of lists: planish.v1.ListJobsRequest.filter.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planish/v1/job.pb.h"

namespace planish {

// Maximal length of a label's key.
inline constexpr std::size_t kMostLabelKey = 63;

// Whether `key` is valid for a label (planish.v1.JobSpec.labels).
bool IsLabelKey(std::string_view key);

struct StateCondition {
  v1::JobState state = v1::JOB_STATE_UNSPECIFIED;
  bool negated = false;
};

// The job has a label `key`, with this value or prefix. A job without the label meets negated conditions.
struct LabelCondition {
  enum class Kind { kExists, kEquals, kBeginsWith };

  std::string key;
  Kind kind = Kind::kExists;
  std::string value;
  bool negated = false;
};

// A job must meet all conditions.
struct JobFilter {
  std::vector<StateCondition> states;
  std::vector<LabelCondition> labels;
  std::optional<absl::Time> from, before;  // create_time >= from, create_time < before
  std::string tenant;                      // empty: any
};

// Parses a filter. INVALID_ARGUMENT with REQUEST_INVALID; the message says where the text cannot be read.
absl::StatusOr<JobFilter> ParseJobFilter(std::string_view text);

}  // namespace planish
