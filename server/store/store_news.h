// How changes become known to whoever waits for them, in this process and in others.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/store/job_store.h"

namespace planish {

// Functions to call, each as long as somebody holds its subscription. Thread-safe.
template <class Message>
class Listeners {
 public:
  using Listener = std::function<void(const Message&)>;
  using Subscription = std::shared_ptr<const Listener>;

  [[nodiscard]] Subscription Add(Listener listener) {
    auto subscription = std::make_shared<const Listener>(std::move(listener));
    const std::lock_guard lock(mutex_);
    std::erase_if(listeners_, [](const auto& each) { return each.expired(); });
    listeners_.push_back(subscription);
    return subscription;
  }

  // On this thread. A listener whose subscription is dropped meanwhile may still be called once.
  void Call(const Message& message) const {
    std::vector<Subscription> live;
    {
      const std::lock_guard lock(mutex_);
      for (const auto& listener : listeners_) live.push_back(listener.lock());
    }
    for (const Subscription& listener : live) {
      if (listener != nullptr) (*listener)(message);
    }
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::weak_ptr<const Listener>> listeners_;  // guarded by mutex_
};

// News as lines of text for SqlDatabase::Publish: "w" for work, "*" for everything, names of jobs, and after "=" names
// of work.
std::string EncodeNews(const StoreNews& news);
StoreNews DecodeNews(std::string_view message);

}  // namespace planish
