// Combines concurrent calls of many threads into groups.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

namespace planish {

// A call that arrives while most_groups groups run waits; then one waiting thread runs the waiting calls together, as a
// group. So the cost of a call falls as the load rises. A Call has `keys`; calls that share a key are in different
// groups. Thread-safe.
template <class Call>
class CallGroups {
 public:
  using Body = std::function<void(const std::vector<Call*>& calls)>;

  // Limits on the groups that run at the same time, and on the calls of each.
  CallGroups(int most_groups, std::size_t most_calls) : most_groups_(most_groups), most_calls_(most_calls) {}

  // Returns once a group with `call` has run, in this thread's `body` or another's.
  void Run(Call* call, const Body& body) {
    Waiting own = {call};
    std::unique_lock lock(mutex_);
    waiting_.push_back(&own);
    own.changed.wait(lock, [&] { return own.done || (waiting_.front() == &own && groups_ < most_groups_); });
    if (own.done) return;
    const std::vector<Waiting*> group = TakeGroup();
    ++groups_;
    WakeNext();
    lock.unlock();
    std::vector<Call*> calls;
    for (const Waiting* each : group) calls.push_back(each->call);
    body(calls);
    lock.lock();
    --groups_;
    for (Waiting* const each : group) {
      each->done = true;
      each->changed.notify_one();
    }
    WakeNext();
  }

  // The number of calls that are not in a group yet.
  std::size_t waiting() {
    const std::lock_guard lock(mutex_);
    return waiting_.size();
  }

 private:
  struct Waiting {
    Call* call;
    bool in_group = false, done = false;
    std::condition_variable changed = {};
  };

  // Removes the next group from waiting_ and returns it: calls in order of arrival, at most most_calls_, without those
  // that share a key with a call already taken. Requires mutex_.
  std::vector<Waiting*> TakeGroup() {
    std::vector<Waiting*> group;
    std::vector<std::string> taken;
    for (Waiting* const each : waiting_) {
      const std::vector<std::string>& keys = each->call->keys;
      const bool shares = std::any_of(keys.begin(), keys.end(), [&](const std::string& key) {
        return std::find(taken.begin(), taken.end(), key) != taken.end();
      });
      if (shares || group.size() == most_calls_) continue;
      taken.insert(taken.end(), keys.begin(), keys.end());
      each->in_group = true;
      group.push_back(each);
    }
    std::erase_if(waiting_, [](const Waiting* each) { return each->in_group; });
    return group;
  }

  // Wakes the call that waits longest if another group may run. Requires mutex_.
  void WakeNext() {
    if (!waiting_.empty() && groups_ < most_groups_) waiting_.front()->changed.notify_one();
  }

  const int most_groups_;
  const std::size_t most_calls_;
  std::mutex mutex_;
  // Guarded by mutex_.
  std::deque<Waiting*> waiting_;
  int groups_ = 0;  // running groups
};

}  // namespace planish
