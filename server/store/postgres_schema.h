// The tables of JobStore in PostgreSQL.
#pragma once

#include <cstdint>

#include "server/store/work_schema.h"

namespace planish {

// Steps from each version of the schema to the next, by the rule of sql_schema.h; meta.version says how many were
// taken. The first ones, which drop columns, are from before the first release. The collation is that of bytes, as
// SQLite's: no index depends on the machine's locale.
inline constexpr const char* kPostgresMigrations[] = {
    R"sql(
      CREATE SEQUENCE job_numbers;
      CREATE TABLE jobs (
        number BIGINT PRIMARY KEY,
        name TEXT COLLATE "C" NOT NULL UNIQUE,
        tenant TEXT COLLATE "C" NOT NULL,
        request_id TEXT COLLATE "C",
        state BIGINT NOT NULL,
        ended BIGINT NOT NULL,
        end_time BIGINT NOT NULL,
        work_key BYTEA NOT NULL,
        mesh_sha256 BYTEA NOT NULL,
        seams_sha256 BYTEA NOT NULL,
        uv_sha256 BYTEA NOT NULL,
        uv_bytes BIGINT NOT NULL,
        record BYTEA NOT NULL,
        report BYTEA,
        create_time BIGINT NOT NULL,
        work TEXT COLLATE "C" NOT NULL,
        owner TEXT COLLATE "C" NOT NULL,
        attempt BIGINT NOT NULL,
        lease_until BIGINT NOT NULL,
        turn_time BIGINT NOT NULL,
        memory_bytes BIGINT NOT NULL,
        UNIQUE (tenant, request_id)
      ) WITH (fillfactor = 80);
      CREATE INDEX jobs_by_end ON jobs (end_time, number) WHERE ended = 1;
      CREATE INDEX jobs_by_state ON jobs (state, end_time, number) WHERE ended = 1;
      CREATE INDEX jobs_by_tenant ON jobs (tenant, number);
      CREATE INDEX jobs_by_tenant_end ON jobs (tenant, end_time, number) WHERE ended = 1;
      CREATE INDEX jobs_by_tenant_state ON jobs (tenant, state, end_time, number) WHERE ended = 1;
      CREATE INDEX jobs_by_work ON jobs (work_key, number);
      CREATE INDEX jobs_by_mesh ON jobs (mesh_sha256) WHERE ended = 0;
      CREATE INDEX jobs_by_seams ON jobs (seams_sha256) WHERE ended = 0;
      CREATE INDEX jobs_by_uv ON jobs (uv_sha256) WHERE ended = 1;
      CREATE INDEX jobs_by_live_work ON jobs (work) WHERE ended = 0;
      CREATE INDEX jobs_by_turn ON jobs (turn_time, number) WHERE state = 1;
      CREATE INDEX jobs_by_lease ON jobs (lease_until) WHERE ended = 0 AND state != 1;
      CREATE TABLE events (
        job BIGINT NOT NULL,
        sequence BIGINT NOT NULL,
        event BYTEA NOT NULL,
        PRIMARY KEY (job, sequence)
      );
      CREATE TABLE blobs (
        tenant TEXT COLLATE "C" NOT NULL,
        sha256 BYTEA NOT NULL,
        bytes BYTEA NOT NULL,
        PRIMARY KEY (tenant, sha256)
      );
      ALTER TABLE blobs ALTER COLUMN bytes SET STORAGE EXTERNAL;
      CREATE TABLE labels (
        job BIGINT NOT NULL,
        key TEXT COLLATE "C" NOT NULL,
        value TEXT COLLATE "C" NOT NULL,
        PRIMARY KEY (job, key)
      );
    )sql",
    kWorkMigration,
    // Collations as above; room for rows that are written again and again.
    R"sql(
      ALTER TABLE works ALTER COLUMN name TYPE TEXT COLLATE "C", ALTER COLUMN tenant TYPE TEXT COLLATE "C",
        ALTER COLUMN owner TYPE TEXT COLLATE "C";
      ALTER TABLE tenants ALTER COLUMN tenant TYPE TEXT COLLATE "C";
      ALTER TABLE works SET (fillfactor = 70);
      ALTER TABLE tenants SET (fillfactor = 50);
    )sql",
    // Tables that stay empty, to be locked by TakeTurn(). Rows of tenants are written all the time and read together:
    // with room for their versions they stay on a few pages. A column that some index has costs an entry in all of them
    // when it changes: `state` gets out of them, and what jobs seldom have.
    R"sql(
      CREATE TABLE turns_0 ();
      CREATE TABLE turns_1 ();
      CREATE TABLE turns_2 ();
      CREATE TABLE turns_3 ();
      ALTER TABLE tenants SET (fillfactor = 10);
      DROP INDEX jobs_by_work;
      CREATE INDEX jobs_by_work ON jobs (work_key, tenant, number);
      ALTER TABLE jobs ADD COLUMN outcome BIGINT GENERATED ALWAYS AS (CASE WHEN ended = 1 THEN state ELSE 0 END) STORED;
      DROP INDEX jobs_by_state, jobs_by_tenant_state, jobs_by_seams, jobs_by_uv;
      CREATE INDEX jobs_by_outcome ON jobs (outcome, end_time, number) WHERE ended = 1;
      CREATE INDEX jobs_by_tenant_outcome ON jobs (tenant, outcome, end_time, number) WHERE ended = 1;
      CREATE INDEX jobs_by_seams ON jobs (seams_sha256) WHERE ended = 0 AND seams_sha256 != '';
      CREATE INDEX jobs_by_uv ON jobs (uv_sha256) WHERE ended = 1 AND uv_sha256 != '';
    )sql",
    // Hardly any work has a wish.
    R"sql(
      CREATE INDEX works_by_wish ON works (owner) WHERE running = 1 AND wish != 0;
    )sql",
    // 1 with the turn, which lasts to the end of the transaction; 0 if it did not come in time.
    R"sql(
      CREATE FUNCTION take_turn(lane BIGINT) RETURNS BIGINT LANGUAGE plpgsql SET lock_timeout = '20ms' AS $$
      BEGIN
        EXECUTE format('LOCK TABLE turns_%s IN EXCLUSIVE MODE', lane);
        RETURN 1;
      EXCEPTION WHEN lock_not_available THEN
        RETURN 0;
      END $$;
    )sql",
    // For {with_jobs}. VOLATILE: its query sees what was committed before the call, which comes after the lock of the
    // work, where a join would see what there was before the whole statement.
    R"sql(
      CREATE FUNCTION live_jobs_of(work_name TEXT) RETURNS SETOF jobs LANGUAGE plpgsql VOLATILE AS $$
      BEGIN
        RETURN QUERY SELECT * FROM jobs WHERE work = work_name AND ended = 0;
      END $$;
    )sql",
    // What ended jobs take; indexes for the newest work and the newest result with one key, however many jobs had it.
    R"sql(
      ALTER TABLE tenants ADD COLUMN record_bytes BIGINT NOT NULL DEFAULT 0;
      DROP INDEX jobs_by_work, jobs_by_uv;
      CREATE INDEX jobs_by_live_key ON jobs (work_key, tenant, number) WHERE ended = 0;
      CREATE INDEX jobs_by_result ON jobs (work_key, number) WHERE ended = 1 AND outcome = 4;
      CREATE INDEX jobs_by_uv ON jobs (uv_sha256, tenant) WHERE ended = 1 AND outcome = 4 AND uv_sha256 != '';
    )sql",
};

// Transactions between TakeTurn() and their ends; the first of the tables turns_N. With four of them, claims held each
// other up on two cores: p99 105 to 135 ms, and 63 to 122 with two (tests/bench/results/farm.md).
inline constexpr std::uint64_t kTurns = 2;

}  // namespace planish
