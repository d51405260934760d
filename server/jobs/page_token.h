// Page tokens: the start of the next page of a list, as an opaque string.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

namespace planish {

// The list that a page belongs to.
struct PageList {
  std::string
      store;  // JobStore::id(), since each store numbers its jobs from 1. It is secret, so nobody else can make tokens
  std::string tenant;  // whose jobs are listed; empty: all tenants'
  std::string filter;  // as the caller wrote it
};

// The token of the page with the jobs before `before_number`. Callers cannot read the number, since they do not know
// the store's id: job numbers count the jobs of all tenants.
std::string EncodePageToken(const PageList& list, std::int64_t before_number);

// The job number before which the page begins; 0 for an empty token. INVALID_ARGUMENT if `token` was made by another
// server or for another filter.
absl::StatusOr<std::int64_t> DecodePageToken(const std::string& token, const PageList& list);

}  // namespace planish
