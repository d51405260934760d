// Where jobs are remembered.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "planish/v1/job.pb.h"

namespace planish {

// What must outlive a restart. Meshes, UV and events are kept elsewhere.
struct JobRecord {
  v1::Job job;              // without queue_position and progress
  std::int64_t number = 0;  // 1, 2, 3, ... in order of creation
  std::string request_id;   // empty, or unique among the records
};

struct JobQuery {
  std::int64_t before_number = 0;                  // only older records than this one; 0: all
  v1::JobState state = v1::JOB_STATE_UNSPECIFIED;  // only records in this state; UNSPECIFIED: all
  int limit = 0;                                   // at most this many
};

// Called by one thread at a time: JobManager holds its lock.
class JobStore {
 public:
  virtual ~JobStore() = default;

  // Adds the record, or replaces the one with the same job name.
  virtual void Put(const JobRecord& record) = 0;

  virtual std::optional<JobRecord> Find(const std::string& name) const = 0;
  virtual std::optional<JobRecord> FindByRequestId(const std::string& request_id) const = 0;

  // Newest first.
  virtual std::vector<JobRecord> List(const JobQuery& query) const = 0;

  // No effect if there is no such record.
  virtual void Delete(const std::string& name) = 0;
};

std::unique_ptr<JobStore> NewMemoryJobStore();

}  // namespace planish
