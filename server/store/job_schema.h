// The tables of JobStore in SQLite and PostgreSQL. For rules about later versions see sql_schema.h.
//
// Words in braces differ between the engines, as in all statements (sql.h). Here also: {text} and {bytes} are types,
// {rowid} is the type of a growing primary key, {outcome_column} adds the column of {outcome} if the engine has one,
// and {clustered} ends tables that are stored in the order of their primary key.
#pragma once

namespace planish {

// jobs: a row for each job (JobRecord). `ended`: 0 or 1. `due`: when EndOverdue() must look at the job, nanoseconds
// since 1970, like all times. {outcome} is the state of an ended job; indexes use it instead of `state`, which changes.
// events: `kind` 0 is one JobEvent, 1 an EventBatch with a change of state, 2 one with progress only.
// blobs: small blobs committed with the records that refer to them.
// works: a row for each piece of work that has not ended (WorkRow). `running` is 1 while there is a lease. tenants: the
// account of a tenant is the sum over its rows (TenantAccount). There is a row for each SqlConnection::Slot(), so that
// concurrent writers seldom wait for each other. The rows of the tenant '' hold the virtual time as `received`.
inline constexpr char kJobSchema[] = R"sql(
  CREATE TABLE jobs (
    number {rowid} PRIMARY KEY,
    name {text} NOT NULL UNIQUE,
    tenant {text} NOT NULL,
    request_id {text},
    state BIGINT NOT NULL,
    priority BIGINT NOT NULL,
    ended BIGINT NOT NULL,
    create_time BIGINT NOT NULL,
    end_time BIGINT NOT NULL,
    due BIGINT NOT NULL,
    work {text} NOT NULL,
    work_key {bytes} NOT NULL,
    mesh_sha256 {bytes} NOT NULL,
    elements_sha256 {bytes} NOT NULL,
    uv_sha256 {bytes} NOT NULL,
    record {bytes} NOT NULL,
    report {bytes},{outcome_column}
    UNIQUE (tenant, request_id)
  );
  CREATE INDEX jobs_by_tenant ON jobs (tenant, number);
  CREATE INDEX jobs_by_end ON jobs (end_time, number) WHERE ended = 1;
  CREATE INDEX jobs_by_outcome ON jobs ({outcome}, end_time, number) WHERE ended = 1;
  CREATE INDEX jobs_by_tenant_end ON jobs (tenant, end_time, number) WHERE ended = 1;
  CREATE INDEX jobs_by_tenant_outcome ON jobs (tenant, {outcome}, end_time, number) WHERE ended = 1;
  CREATE INDEX jobs_by_result ON jobs (work_key, number) WHERE ended = 1 AND {outcome} = 4;
  CREATE INDEX jobs_by_uv ON jobs (uv_sha256, tenant) WHERE ended = 1 AND {outcome} = 4 AND uv_sha256 != '';
  CREATE INDEX jobs_by_live_work ON jobs (work) WHERE ended = 0;
  CREATE INDEX jobs_by_live_key ON jobs (work_key, tenant, number) WHERE ended = 0;
  CREATE INDEX jobs_by_mesh ON jobs (mesh_sha256) WHERE ended = 0;
  CREATE INDEX jobs_by_elements ON jobs (elements_sha256) WHERE ended = 0 AND elements_sha256 != '';
  CREATE INDEX jobs_by_due ON jobs (due) WHERE ended = 0;
  CREATE TABLE events (
    job BIGINT NOT NULL,
    sequence BIGINT NOT NULL,
    kind BIGINT NOT NULL,
    event {bytes} NOT NULL,
    PRIMARY KEY (job, sequence)
  ) {clustered};
  CREATE TABLE labels (
    job BIGINT NOT NULL,
    key {text} NOT NULL,
    value {text} NOT NULL,
    PRIMARY KEY (job, key)
  ) {clustered};
  CREATE TABLE blobs (
    tenant {text} NOT NULL,
    sha256 {bytes} NOT NULL,
    bytes {bytes} NOT NULL,
    PRIMARY KEY (tenant, sha256)
  );
  CREATE TABLE works (
    name {text} NOT NULL PRIMARY KEY,
    tenant {text} NOT NULL,
    number BIGINT NOT NULL,
    running BIGINT NOT NULL,
    turn_time BIGINT NOT NULL,
    memory_bytes BIGINT NOT NULL,
    mesh_bytes BIGINT NOT NULL,
    run_time BIGINT NOT NULL,
    alone BIGINT NOT NULL,
    wish BIGINT NOT NULL,
    owner {text} NOT NULL,
    attempt BIGINT NOT NULL,
    lease_until BIGINT NOT NULL,
    start_time BIGINT NOT NULL,
    charge BIGINT NOT NULL,
    share BIGINT NOT NULL
  );
  CREATE INDEX works_by_turn ON works (tenant, turn_time, number) WHERE running = 0;
  CREATE INDEX works_by_owner ON works (owner) WHERE running = 1;
  CREATE INDEX works_by_wish ON works (owner) WHERE running = 1 AND wish != 0;
  CREATE INDEX works_by_lease ON works (lease_until) WHERE running = 1;
  CREATE TABLE tenants (
    tenant {text} NOT NULL,
    slot BIGINT NOT NULL,
    waiting BIGINT NOT NULL,
    waiting_bytes BIGINT NOT NULL,
    running BIGINT NOT NULL,
    started BIGINT NOT NULL,
    charged BIGINT NOT NULL,
    received BIGINT NOT NULL,
    ended BIGINT NOT NULL,
    result_bytes BIGINT NOT NULL,
    record_bytes BIGINT NOT NULL,
    PRIMARY KEY (tenant, slot)
  );
)sql";

}  // namespace planish
