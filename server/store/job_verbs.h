// The two longest verbs of JobStore, within a transaction.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/store/job_store.h"
#include "server/store/job_transaction.h"

namespace planish {

// Of a job, what Accept() says of none other at the same time: its name, its request id, and its work unless it is
// fresh.
std::vector<std::string> KeysOf(const NewJob& job);

// A call of JobStore::Accept.
struct AcceptCall {
  NewJob job;
  std::vector<std::string> keys;  // KeysOf(job)
  absl::Status status;
  AcceptedChange accepted;
};

// JobStore::Accept of several calls, in their order as far as they have a key in common.
absl::Status AcceptIn(JobTransaction* transaction, const std::vector<AcceptCall*>& calls, RecentAccounts* recent);

// JobStore::Claim. `claimed` is empty, `wait` may be null.
absl::Status ClaimIn(JobTransaction* transaction, const ClaimRequest& request, std::vector<ClaimedWork>* claimed,
                     ClaimWait* wait);

}  // namespace planish
