// The two status helpers of the project; no other macros.
#pragma once

#include "absl/status/status.h"
#include "absl/status/statusor.h"

// Returns from the enclosing function if `expression` is not OK.
#define PLANISH_RETURN_IF_ERROR(expression)                                                         \
  do {                                                                                              \
    if (absl::Status planish_status_ = (expression); !planish_status_.ok()) return planish_status_; \
  } while (false)

#define PLANISH_CONCAT_INNER_(a, b) a##b
#define PLANISH_CONCAT_(a, b) PLANISH_CONCAT_INNER_(a, b)

// Declares or assigns `lhs` from the value of a StatusOr, or returns its status.
#define PLANISH_ASSIGN_OR_RETURN(lhs, expression)                   \
  auto PLANISH_CONCAT_(planish_statusor_, __LINE__) = (expression); \
  if (!PLANISH_CONCAT_(planish_statusor_, __LINE__).ok())           \
    return PLANISH_CONCAT_(planish_statusor_, __LINE__).status();   \
  lhs = std::move(PLANISH_CONCAT_(planish_statusor_, __LINE__)).value()
