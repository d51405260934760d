// What JobStore needs in PostgreSQL in addition to its tables (job_schema.h).
#pragma once

#include <cstdint>

namespace planish {

// Number of transactions that may be between TakeTurn() and their ends; each has locked one of the tables turns_N. With
// four, claims delayed each other on two cores: p99 105 to 135 ms, and 63 to 122 with two
// (tests/bench/results/farm.md).
inline constexpr std::uint64_t kTurns = 2;

// Pages of frequently updated rows have room for new row versions. Rows of tenants, which are updated all the time and
// read together, stay on a few pages. take_turn() returns 1 with the lock, which lasts until the end of the
// transaction, or 0 if it timed out. live_jobs_of() implements {with_jobs}. It is VOLATILE so that its query sees what
// was committed before the call, which comes after the work was locked; a join would see the state before the whole
// statement.
inline constexpr char kPostgresSchema[] = R"sql(
  CREATE SEQUENCE job_numbers;
  ALTER TABLE jobs SET (fillfactor = 80);
  ALTER TABLE works SET (fillfactor = 70);
  ALTER TABLE tenants SET (fillfactor = 10);
  ALTER TABLE blobs ALTER COLUMN bytes SET STORAGE EXTERNAL;
  CREATE TABLE turns_0 ();
  CREATE TABLE turns_1 ();
  CREATE FUNCTION take_turn(lane BIGINT) RETURNS BIGINT LANGUAGE plpgsql SET lock_timeout = '20ms' AS $$
  BEGIN
    EXECUTE format('LOCK TABLE turns_%s IN EXCLUSIVE MODE', lane);
    RETURN 1;
  EXCEPTION WHEN lock_not_available THEN
    RETURN 0;
  END $$;
  CREATE FUNCTION live_jobs_of(work_name TEXT) RETURNS SETOF jobs LANGUAGE plpgsql VOLATILE AS $$
  BEGIN
    RETURN QUERY SELECT * FROM jobs WHERE work = work_name AND ended = 0;
  END $$;
)sql";

}  // namespace planish
