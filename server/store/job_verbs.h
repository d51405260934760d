// The two longest verbs of JobStore, within a transaction.
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "server/store/job_store.h"
#include "server/store/job_transaction.h"

namespace planish {

// JobStore::Accept, of a job that is not there: without room `accepted` says so alone. ALREADY_EXISTS, at the latest
// from the commit, where its name or its request id is taken.
absl::Status AcceptIn(JobTransaction* transaction, const NewJob& job, RecentAccounts* recent, AcceptedChange* accepted);

// JobStore::Claim. `claimed` is empty.
absl::Status ClaimIn(JobTransaction* transaction, const ClaimRequest& request, std::vector<ClaimedWork>* claimed);

}  // namespace planish
