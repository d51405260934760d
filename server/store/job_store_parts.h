// The parts of JobStore. For its own files only.
#pragma once

#include <memory>
#include <utility>

#include "absl/time/clock.h"
#include "server/store/call_groups.h"
#include "server/store/job_store.h"
#include "server/store/job_transaction.h"
#include "server/store/job_transactions.h"
#include "server/store/sql.h"
#include "server/store/sql_blob_rows.h"
#include "server/store/store_news.h"
#include "server/store/work_rows.h"

namespace planish {

struct AcceptCall;  // accept.cc
struct FinishCall;  // finish.cc

struct JobStore::Parts {
  // Concurrent transactions of this process, and the calls combined in each. A front end has callers from everywhere;
  // the workers of one machine need only one connection to finish their work.
  static constexpr int kAccepting = 2, kFinishing = 1;
  static constexpr std::size_t kGroupedCalls = 16;

  Parts(std::unique_ptr<SqlDatabase> sql, JobStoreOptions options)
      : database(std::move(sql)),
        clock(options.clock == nullptr && !database->has_clock() ? absl::Now : std::move(options.clock)) {}

  Listeners<StoreNews> listeners;
  const std::unique_ptr<SqlDatabase> database;
  const StoreClock clock;  // null: the database's own clock
  JobTransactions transactions{database.get(), &clock, &listeners};
  SqlBlobRows rows{database.get()};
  RecentAccounts recent_accounts;
  CallGroups<AcceptCall> accepts{kAccepting, kGroupedCalls};
  CallGroups<FinishCall> finishes{kFinishing, kGroupedCalls};
};

}  // namespace planish
