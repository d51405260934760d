#include <iterator>
#include <map>
#include <unordered_map>

#include "server/jobs/job_store.h"

namespace planish {
namespace {

class MemoryJobStore : public JobStore {
 public:
  void Put(const JobRecord& record) override {
    Delete(record.job.name());
    numbers_[record.job.name()] = record.number;
    if (!record.request_id.empty()) requests_[record.request_id] = record.number;
    records_[record.number] = record;
  }

  std::optional<JobRecord> Find(const std::string& name) const override { return At(numbers_, name); }

  std::optional<JobRecord> FindByRequestId(const std::string& request_id) const override {
    return At(requests_, request_id);
  }

  std::vector<JobRecord> List(const JobQuery& query) const override {
    std::vector<JobRecord> found;
    const auto end = query.before_number == 0 ? records_.end() : records_.lower_bound(query.before_number);
    for (auto it = std::make_reverse_iterator(end); it != records_.rend(); ++it) {
      if (static_cast<int>(found.size()) >= query.limit) break;
      if (query.state != v1::JOB_STATE_UNSPECIFIED && it->second.job.state() != query.state) continue;
      found.push_back(it->second);
    }
    return found;
  }

  void Delete(const std::string& name) override {
    const auto number = numbers_.find(name);
    if (number == numbers_.end()) return;
    const auto record = records_.find(number->second);
    requests_.erase(record->second.request_id);
    records_.erase(record);
    numbers_.erase(number);
  }

 private:
  using Index = std::unordered_map<std::string, std::int64_t>;

  std::optional<JobRecord> At(const Index& index, const std::string& key) const {
    const auto number = index.find(key);
    if (number == index.end()) return std::nullopt;
    return records_.at(number->second);
  }

  std::map<std::int64_t, JobRecord> records_;  // by number
  Index numbers_;                              // by name
  Index requests_;                             // by request id
};

}  // namespace

std::unique_ptr<JobStore> NewMemoryJobStore() {
  return std::make_unique<MemoryJobStore>();
}

}  // namespace planish
