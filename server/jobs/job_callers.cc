#include "server/jobs/job_callers.h"

#include <vector>

namespace planish {
namespace {

// Interval at which callers are renewed in the store.
constexpr absl::Duration kRenewal = absl::Seconds(20);

}  // namespace

JobAttachment& JobAttachment::operator=(JobAttachment&& other) noexcept {
  Release();
  callers_ = std::exchange(other.callers_, nullptr);
  name_ = std::move(other.name_);
  return *this;
}

void JobAttachment::Release(Parting parting) {
  if (JobCallers* callers = std::exchange(callers_, nullptr); callers != nullptr) callers->Detach(name_, parting);
}

JobAttachment JobCallers::Attach(const std::string& name, bool known) {
  {
    const std::lock_guard lock(mutex_);
    ++callers_[name];
  }
  if (!known) {
    if (const absl::Status status = context_.store.KeepCallers({name}, kBelieved); !status.ok()) {
      context_.TellError(status);
    }
  }
  return JobAttachment(this, name);
}

void JobCallers::Detach(const std::string& name, Parting parting) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = callers_.find(name);
    if (found == callers_.end() || --found->second > 0) return;
    callers_.erase(found);
    if (suspended_ || parting == Parting::kJobEnded) return;
  }
  const absl::Duration grace = parting == Parting::kForGood ? absl::ZeroDuration() : context_.Limits().reattach_grace;
  // If this cannot be written, the job is cancelled a little later, when the callers' last renewal expires.
  if (const absl::Status status = context_.store.KeepCallers({name}, grace); !status.ok()) context_.TellError(status);
  if (grace <= absl::ZeroDuration() && context_.on_due) context_.on_due();
}

void JobCallers::Renew() {
  std::vector<std::string> names;
  const absl::Time now = context_.options.steady_clock();
  absl::Duration ahead;
  // Asking a shared store for its time costs a round trip.
  if (!context_.store.is_shared()) {
    if (const absl::StatusOr<absl::Time> of_store = context_.store.Now(); of_store.ok()) ahead = *of_store - now;
  }
  {
    const std::lock_guard lock(mutex_);
    // If the store's clock was set forward, earlier renewals may have expired.
    const bool was_set = ahead > store_ahead_ + kRenewal;
    store_ahead_ = ahead;
    if (suspended_ || (now < next_renewal_ && !was_set)) return;
    next_renewal_ = now + kRenewal;
    for (const auto& [name, count] : callers_) names.push_back(name);
  }
  if (names.empty()) return;
  if (const absl::Status status = context_.store.KeepCallers(names, kBelieved); !status.ok()) {
    context_.TellError(status);
    const std::lock_guard lock(mutex_);
    next_renewal_ = absl::InfinitePast();
  }
}

void JobCallers::Suspend() {
  const std::lock_guard lock(mutex_);
  suspended_ = true;
}

}  // namespace planish
