// What JobStore answers without changing anything, and its small blobs.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/blobs/blob_catalog.h"
#include "server/store/job_store.h"
#include "server/store/job_transaction.h"
#include "server/store/sql.h"

namespace planish {

// Thread-safe. Functions as those of JobStore and BlobRows with the same names; `database` outlives the object.
class JobQuestions : public BlobRows {
 public:
  explicit JobQuestions(SqlDatabase* database) : database_(database) {}

  absl::StatusOr<std::optional<JobRecord>> Find(const std::string& name);
  absl::StatusOr<std::optional<JobRecord>> FindByRequestId(const std::string& tenant, const std::string& request_id);
  absl::StatusOr<std::optional<JobRecord>> FindResult(const std::string& work_key);
  absl::StatusOr<std::vector<JobRecord>> List(const JobQuery& query);
  absl::StatusOr<std::vector<JobRecord>> Unfinished();
  absl::StatusOr<std::optional<JobRecord>> FirstEnded(const std::string& tenant, v1::JobState state);
  absl::StatusOr<JobTotals> Totals();
  absl::StatusOr<FairAccounts> Accounts();
  absl::StatusOr<absl::Time> Now(const StoreClock& clock);
  absl::StatusOr<QueueState> Queue(const StoreClock& clock);
  absl::StatusOr<std::vector<std::pair<std::string, Wish>>> Wishes(const std::string& owner);
  absl::StatusOr<bool> IsUnderWay(const std::string& tenant, const std::string& work_key);
  absl::StatusOr<std::optional<JobRecord>> LastEnded(const std::string& tenant);
  absl::StatusOr<std::optional<v1::Progress>> LastProgress(std::int64_t number);
  absl::StatusOr<std::vector<v1::JobEvent>> Events(std::int64_t number, std::int64_t after);
  absl::StatusOr<std::vector<JobPosition>> Positions(const std::vector<std::int64_t>& numbers);
  absl::StatusOr<bool> UsesBlob(const BlobId& id);

  absl::StatusOr<std::vector<std::pair<BlobId, std::int64_t>>> List() override;
  absl::StatusOr<std::string> Read(const BlobId& id) override;
  absl::StatusOr<bool> Remove(const BlobId& id) override;

 private:
  absl::StatusOr<SqlRows> Ask(const std::string& sql, const std::vector<SqlValue>& values);
  absl::StatusOr<std::vector<JobRecord>> All(const std::string& sql, const std::vector<SqlValue>& values);
  absl::StatusOr<std::optional<JobRecord>> One(const std::string& sql, const std::vector<SqlValue>& values);

  SqlDatabase* const database_;
};

}  // namespace planish
