#include "server/jobs/job_callers.h"

#include <algorithm>
#include <vector>

namespace planish {
namespace {

// Between two times that the store is told of callers, and how long it believes that.
constexpr absl::Duration kRenewal = absl::Seconds(20);
constexpr absl::Duration kBelieved = absl::Seconds(60);

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

absl::Time JobCallers::Until() const {
  return context_.options.clock() + kBelieved;
}

JobAttachment JobCallers::Attach(const std::string& name, bool known) {
  {
    const std::lock_guard lock(mutex_);
    ++callers_[name];
  }
  if (!known) {
    if (const absl::Status status = context_.store.SetCallersUntil({name}, Until()); !status.ok()) {
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
  const absl::Time now = context_.options.clock();
  const absl::Time until = parting == Parting::kForGood ? now : now + context_.Limits().reattach_grace;
  // If it cannot be written, what was said last comes true a little later.
  if (const absl::Status status = context_.store.SetCallersUntil({name}, until); !status.ok()) {
    context_.TellError(status);
  }
  if (until <= now && context_.on_due) context_.on_due();
}

void JobCallers::Renew() {
  std::vector<std::string> names;
  const absl::Time now = context_.options.clock();
  {
    const std::lock_guard lock(mutex_);
    // A clock that was set back puts it off by one renewal at the most.
    next_renewal_ = std::min(next_renewal_, now + kRenewal);
    if (suspended_ || now < next_renewal_) return;
    next_renewal_ = now + kRenewal;
    for (const auto& [name, count] : callers_) names.push_back(name);
  }
  if (names.empty()) return;
  if (const absl::Status status = context_.store.SetCallersUntil(names, now + kBelieved); !status.ok()) {
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
