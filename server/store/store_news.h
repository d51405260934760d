// Notifies listeners in this process and others of changes.
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

// Functions to call, each until its subscription is dropped. Thread-safe; a function must not drop its own
// subscription.
template <class Message>
class Listeners {
 public:
  using Listener = std::function<void(const Message&)>;

  // Adds a function. Dropping the returned subscription waits for a running call.
  [[nodiscard]] std::shared_ptr<void> Add(Listener listener) {
    auto entry = std::make_shared<Entry>();
    entry->listener = std::move(listener);
    const std::lock_guard lock(mutex_);
    std::erase_if(entries_, [](const auto& each) { return each.expired(); });
    entries_.push_back(entry);
    return std::shared_ptr<void>(entry.get(), [entry](void*) {
      const std::lock_guard ended(entry->mutex);
      entry->listener = nullptr;
    });
  }

  // Calls the functions on this thread.
  void Call(const Message& message) const {
    std::vector<std::shared_ptr<Entry>> entries;
    {
      const std::lock_guard lock(mutex_);
      for (const auto& entry : entries_) entries.push_back(entry.lock());
    }
    for (const std::shared_ptr<Entry>& entry : entries) {
      if (entry == nullptr) continue;
      const std::lock_guard lock(entry->mutex);
      if (entry->listener != nullptr) entry->listener(message);
    }
  }

 private:
  struct Entry {
    std::mutex mutex;
    Listener listener;  // guarded by mutex
  };

  mutable std::mutex mutex_;
  std::vector<std::weak_ptr<Entry>> entries_;  // guarded by mutex_
};

// News as lines of text for SqlDatabase::Publish: "w" for work, "*" for everything, names of jobs, and names of work
// after "=".
std::string EncodeNews(const StoreNews& news);
StoreNews DecodeNews(std::string_view message);

}  // namespace planish
