// The step of the schema that both engines share: pieces of work and the accounts of tenants get tables of their own.
#pragma once

namespace planish {

// works: one row for each piece of work that has not ended (WorkRow). `running` is 1 while there is a lease.
// tenants: what a tenant has is the sum over its rows (TenantAccount). There are several, by SqlConnection::Slot(), so
// that those who write at the same time need not wait for each other. The rows of the tenant '' hold the virtual time
// as `received`. jobs.due: when EndOverdue() has to look at the job, nanoseconds since 1970. events.kind: 0 one
// JobEvent, 1 an EventBatch with a change of state, 2 one with progress only.
inline constexpr char kWorkMigration[] = R"sql(
  CREATE TABLE works (
    name TEXT NOT NULL PRIMARY KEY,
    tenant TEXT NOT NULL,
    number BIGINT NOT NULL,
    running BIGINT NOT NULL,
    turn_time BIGINT NOT NULL,
    memory_bytes BIGINT NOT NULL,
    mesh_bytes BIGINT NOT NULL,
    run_time BIGINT NOT NULL,
    alone BIGINT NOT NULL,
    wish BIGINT NOT NULL,
    owner TEXT NOT NULL,
    attempt BIGINT NOT NULL,
    lease_until BIGINT NOT NULL,
    start_time BIGINT NOT NULL,
    charge BIGINT NOT NULL,
    share BIGINT NOT NULL
  );
  INSERT INTO works
    SELECT work, min(tenant), min(number), max(CASE WHEN state = 1 THEN 0 ELSE 1 END), min(turn_time),
           max(memory_bytes), 0, 0, 0, 0, max(owner), max(attempt), max(lease_until), 0, 0, 1000000
    FROM jobs WHERE ended = 0 GROUP BY work;
  CREATE INDEX works_by_turn ON works (tenant, turn_time, number) WHERE running = 0;
  CREATE INDEX works_by_owner ON works (owner) WHERE running = 1;
  CREATE INDEX works_by_lease ON works (lease_until) WHERE running = 1;
  CREATE TABLE tenants (
    tenant TEXT NOT NULL,
    slot BIGINT NOT NULL,
    waiting BIGINT NOT NULL,
    waiting_bytes BIGINT NOT NULL,
    running BIGINT NOT NULL,
    started BIGINT NOT NULL,
    charged BIGINT NOT NULL,
    received BIGINT NOT NULL,
    ended BIGINT NOT NULL,
    result_bytes BIGINT NOT NULL,
    PRIMARY KEY (tenant, slot)
  );
  INSERT INTO tenants
    SELECT tenant, 0, 0, 0, 0, 0, 0, 0, sum(ended), sum(CASE WHEN state = 4 THEN uv_bytes ELSE 0 END)
    FROM jobs GROUP BY tenant;
  INSERT INTO tenants
    SELECT tenant, 1, sum(1 - running), 0, sum(running), 0, 0, 0, 0, 0
    FROM works GROUP BY tenant;
  ALTER TABLE jobs ADD COLUMN due BIGINT NOT NULL DEFAULT 9223372036854775807;
  CREATE INDEX jobs_by_due ON jobs (due) WHERE ended = 0;
  ALTER TABLE events ADD COLUMN kind BIGINT NOT NULL DEFAULT 0;
  DROP INDEX IF EXISTS jobs_by_turn;
  DROP INDEX IF EXISTS jobs_by_lease;
  ALTER TABLE jobs DROP COLUMN owner;
  ALTER TABLE jobs DROP COLUMN attempt;
  ALTER TABLE jobs DROP COLUMN lease_until;
  ALTER TABLE jobs DROP COLUMN turn_time;
  ALTER TABLE jobs DROP COLUMN memory_bytes;
)sql";

}  // namespace planish
