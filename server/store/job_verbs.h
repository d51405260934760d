// The two longest verbs of JobStore, within a transaction.
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "server/store/job_store.h"
#include "server/store/job_transaction.h"

namespace planish {

// JobStore::Accept. `accepted` is as constructed.
absl::Status AcceptIn(JobTransaction* transaction, const NewJob& job, RecentAccounts* recent, AcceptedChange* accepted);

// JobStore::Claim. `claimed` is empty.
absl::Status ClaimIn(JobTransaction* transaction, const ClaimRequest& request, std::vector<ClaimedWork>* claimed);

}  // namespace planish
