// Where jobs are remembered.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planish/store/v1/store.pb.h"
#include "planish/v1/job.pb.h"
#include "server/blobs/blob_store.h"
#include "server/jobs/job_filter.h"

namespace planish {

using JobRecord = store::v1::JobRecord;

struct JobQuery {
  std::int64_t before_number = 0;  // only older records than this one; 0: all
  JobFilter filter;                // only records that this is true of
  bool with_reports = false;
  int limit = 0;  // at most this many
};

// What one write makes of one job: its record, an event (may be null), and small blobs that the record refers to and
// that are pending (BlobStore::Pending()).
struct JobWrite {
  const JobRecord* record = nullptr;
  const v1::JobEvent* event = nullptr;
  std::vector<BlobRow> blobs;
};

// When a write outlives what.
enum class Durability {
  kNow,    // synced to the disk before the call returns: outlives a loss of power
  kLater,  // outlives the process at once, and a loss of power after the next write that is durable now
};

struct TenantTotals {
  std::int64_t ended = 0;         // jobs in terminal states
  std::int64_t result_bytes = 0;  // of the UV of those that SUCCEEDED
};

struct JobTotals {
  std::map<std::string, TenantTotals> tenants;  // that have records
  std::int64_t last_number = 0;                 // ever given to a record that is still there
};

// What must outlive a restart: records, the events that are changes of state, and small blobs. Large blobs are files
// (BlobStore), progress is kept nowhere. Called by one thread at a time: JobManager holds its lock.
// Records of stores from before there were tenants belong to kDefaultTenant.
// Every function may fail: RESOURCE_EXHAUSTED with STORAGE_FULL, INTERNAL. A write that failed changed nothing.
class JobStore {
 public:
  virtual ~JobStore() = default;

  // Of this store, the same after a restart.
  virtual const std::string& id() const = 0;

  // Adds each record, or replaces the one with the same number, adds events, and adds or replaces small blobs: all of
  // it or nothing.
  virtual absl::Status Write(const std::vector<JobWrite>& writes, Durability durability) = 0;
  absl::Status Put(const JobRecord& record, const v1::JobEvent* event) {
    return Write({{&record, event, {}}}, Durability::kNow);
  }

  virtual absl::StatusOr<std::optional<JobRecord>> Find(const std::string& name) = 0;
  virtual absl::StatusOr<std::optional<JobRecord>> FindByRequestId(const std::string& tenant,
                                                                   const std::string& request_id) = 0;
  // The newest that SUCCEEDED at this work.
  virtual absl::StatusOr<std::optional<JobRecord>> FindResult(const std::string& work_key) = 0;

  // Newest first.
  virtual absl::StatusOr<std::vector<JobRecord>> List(const JobQuery& query) = 0;
  // Those that have not ended, oldest first.
  virtual absl::StatusOr<std::vector<JobRecord>> Unfinished() = 0;
  // The record of the tenant (empty: of all) in one of the terminal states (UNSPECIFIED: any) that ended first.
  virtual absl::StatusOr<std::optional<JobRecord>> FirstEnded(const std::string& tenant, v1::JobState state) = 0;
  virtual absl::StatusOr<JobTotals> Totals() = 0;

  // In order. The last event of a job that ended has no report: the record has it.
  virtual absl::StatusOr<std::vector<v1::JobEvent>> Events(std::int64_t number) = 0;

  // With its events; durable later. No effect if there is no such record.
  virtual absl::Status Delete(std::int64_t number) = 0;

  // Whether a record needs this blob: a mesh of a job that has not ended, UV of one that SUCCEEDED.
  virtual absl::StatusOr<bool> UsesBlob(const BlobId& id) = 0;

  // Where Write() puts small blobs, for BlobPlaces::rows; null: nowhere, as in memory. Lives as long as the store.
  virtual BlobRows* rows() { return nullptr; }
};

// SQLite at `path`, or ":memory:" for one that lives as long as the object. FAILED_PRECONDITION if the file was written
// by a newer version of planish.
absl::StatusOr<std::unique_ptr<JobStore>> OpenJobStore(const std::string& path);

}  // namespace planish
