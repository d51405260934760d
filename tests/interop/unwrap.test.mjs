// What a client that knows only the published proto files may rely on. It also runs with those of the last release
// (tests/proto/released): what is newer is tested elsewhere.
import grpc from '@grpc/grpc-js';
import assert from 'node:assert/strict';
import {createHash} from 'node:crypto';
import {mkdtempSync, rmSync} from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import {after, before, test} from 'node:test';

import {bump, cylinderPatch, decode, encode, tetrahedron} from './meshes.mjs';
import {call, collect, errorInfoOfCall, errorInfoOfJob, fieldsOfCall, freePort, startServer} from './server.mjs';

const sha256 = (bytes) => createHash('sha256').update(bytes).digest('hex');
const STATES = ['JOB_STATE_QUEUED', 'JOB_STATE_RUNNING', 'JOB_STATE_SUCCEEDED'];

let server;
before(async () => {
  server = await startServer(`127.0.0.1:${await freePort()}`);
});
after(async () => {
  if (server) assert.equal(await server.stop(), 0, 'SIGTERM ends planishd with exit code 0');
});

// Takes the answers of Unwrap or WatchJob apart and checks what holds for every stream.
function checkStream(messages, firstSequence = 1, firstOffset = 0) {
  const events = messages.filter(({content}) => content === 'event').map(({event}) => event);
  const chunks = messages.filter(({content}) => content === 'uv').map(({uv}) => uv);
  events.forEach((event, i) => {
    assert.equal(event.sequence, firstSequence + i, 'sequences are ordered and without gaps');
    assert.equal(event.skipped, 0);
  });
  const jobs = events.filter(({detail}) => detail === 'job').map(({job}) => job);
  const progress = events.filter(({detail}) => detail === 'progress').map((event) => event.progress);
  const lastEvent = messages.findLastIndex(({content}) => content === 'event');
  const firstChunk = messages.findIndex(({content}) => content === 'uv');
  assert.ok(firstChunk < 0 || firstChunk > lastEvent, 'UV come after the last event');
  let end = firstOffset;
  for (const {offset, data} of chunks) {
    assert.equal(offset, end, 'chunks lie end to end');
    end += data.length;
  }
  return {jobs, progress, job: jobs.at(-1), uv: Buffer.concat(chunks.map(({data}) => data))};
}

// Checks the UV of a job that succeeded against the bytes that were sent. Returns them with the decoded mesh.
async function checkUv(job, uv, draco) {
  assert.equal(job.state, 'JOB_STATE_SUCCEEDED', job.error?.message);
  const mesh = await decode(draco);
  assert.equal(job.uv.corner_count, mesh.faces.length, 'one pair for each corner of the decoded mesh');
  assert.equal(job.uv.precision, 'PRECISION_FLOAT');
  assert.equal(uv.length, 8 * mesh.faces.length);
  assert.equal(job.uv.total_bytes, uv.length);
  assert.equal(job.uv.mesh_sha256.toString('hex'), sha256(draco));
  assert.equal(job.uv.uv_sha256.toString('hex'), sha256(uv));
  const pairs = Array.from({length: mesh.faces.length}, (_, i) => [uv.readFloatLE(8 * i), uv.readFloatLE(8 * i + 4)]);
  for (const pair of pairs) assert.ok(pair.every((x) => x >= 0 && x <= 1), `UV within the unit square: ${pair}`);
  for (let c = 0; c < pairs.length; c += 3) {
    const [p, q, r] = pairs.slice(c, c + 3);
    const area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    assert.ok(area > 0, `face ${c / 3} keeps its orientation: doubled area ${area}`);
  }
  const ofPoint = new Map();
  mesh.faces.forEach((point, corner) => {
    if (!ofPoint.has(point)) ofPoint.set(point, pairs[corner]);
    assert.deepEqual(pairs[corner], ofPoint.get(point), 'a disc needs no seam: all corners of a vertex agree');
  });
  const {quality} = job.report;
  assert.deepEqual([quality.flipped, quality.degenerate, quality.overlapping], [0, 0, 0]);
  assert.equal(job.report.input.triangles, mesh.faces.length / 3);
  assert.equal(job.report.charts.length, 1);
  assert.ok(job.report.charts[0].converged, job.report.charts[0].stop_message);
  return {mesh, pairs};
}

// Longest over shortest edge of the map, as multiples of the edges on the surface, less 1: 0 for an isometry.
function edgeDistortion({mesh, pairs}) {
  const ratios = mesh.faces.map((point, corner) => {
    const next = corner - (corner % 3) + ((corner + 1) % 3);
    const at = (p) => mesh.positions.slice(3 * p, 3 * p + 3);
    const [a, b] = [at(point), at(mesh.faces[next])];
    const [u, v] = [pairs[corner], pairs[next]];
    return Math.hypot(v[0] - u[0], v[1] - u[1]) / Math.hypot(...b.map((x, i) => x - a[i]));
  });
  return Math.max(...ratios) / Math.min(...ratios) - 1;
}

async function unwrap(draco, more = {}) {
  return checkStream(await collect(server.client, 'Unwrap', {spec: {draco, labels: {test: 'interop'}, ...more}}));
}

test('health check', async () => {
  assert.equal((await call(server.health, 'Check', {service: ''})).status, 'SERVING');
});

test('capabilities', async () => {
  const capabilities = await call(server.client, 'GetCapabilities', {});
  assert.match(capabilities.version, /^\d+\.\d+\.\d+/);
  assert.equal(capabilities.workers, 2);
  assert.ok(capabilities.max_mesh_bytes > 1_000_000);
  assert.ok(capabilities.seams.includes('SEAMS_AUTO'));
  assert.ok(capabilities.solvers.some(({solver}) => solver === 'SOLVER_UZAWA'));
});

test('a cylinder patch, encoded sequentially, unrolls without distortion', async () => {
  const draco = await encode(cylinderPatch());
  const {jobs, progress, job, uv} = await unwrap(draco);
  const order = jobs.map(({state}) => STATES.indexOf(state));
  assert.deepEqual([...order].sort((a, b) => a - b), order, `states in order: ${jobs.map(({state}) => state)}`);
  assert.deepEqual(jobs[0].labels, {test: 'interop'});
  assert.match(job.name, /^jobs\/.+/);
  assert.ok(progress.some(({stage}) => stage === 'STAGE_SOLVE'));
  assert.ok(edgeDistortion(await checkUv(job, uv, draco)) < 1e-4);
});

test('progress follows Newton: iterations grow, residuals fall', async () => {
  const {progress, job} = await unwrap(await encode(bump()));
  const solve = progress.filter(({stage}) => stage === 'STAGE_SOLVE');
  const iterations = solve.map(({newton_iteration}) => newton_iteration);
  assert.deepEqual([...iterations].sort((a, b) => a - b), iterations);
  assert.equal(iterations.at(-1), job.report.charts[0].newton_iterations);
  assert.ok(iterations.at(-1) > 1, 'a bump takes more than one step');
  const worst = solve.map(({residual}) => Math.max(residual.triangle, residual.vertex, residual.wheel));
  const measured = worst.filter((residual) => residual > 0);  // not yet so when the stage begins
  assert.ok(measured.at(-1) < 1e-3 * measured[0], `residuals: ${worst}`);
});

test('edgebreaker with quantization and normals: UV in the order of the decoded faces', async () => {
  const draco = await encode(cylinderPatch(), {edgebreaker: true, quantizationBits: 14, normals: true});
  const {job, uv} = await unwrap(draco);
  const flat = await checkUv(job, uv, draco);
  assert.notDeepEqual(flat.mesh.faces, cylinderPatch().faces, 'edgebreaker gave the faces another order');
  assert.ok(edgeDistortion(flat) < 0.02);
});

test('create, watch, list and delete a job; same bytes as in one call', async () => {
  const draco = await encode(bump());
  const first = await unwrap(draco);
  const {name} = await call(server.client, 'CreateJob',
                            {spec: {draco, labels: {test: 'queued'}, scheduling: {fresh: true}}});
  const watched = checkStream(await collect(server.client, 'WatchJob', {name, include_uv: true}));
  await checkUv(watched.job, watched.uv, draco);
  assert.ok(watched.uv.equals(first.uv), 'the same bytes for the same input');

  const resume = {name, after_sequence: 2, include_uv: true, uv_offset: 800};
  const rest = checkStream(await collect(server.client, 'WatchJob', resume), 3, 800);
  assert.equal(rest.job.state, 'JOB_STATE_SUCCEEDED');
  assert.ok(rest.uv.equals(first.uv.subarray(800)), 'a watch resumes where the caller says');

  const {jobs} = await call(server.client, 'ListJobs', {filter: 'labels.test = "queued" AND state = SUCCEEDED'});
  assert.deepEqual(jobs.map((job) => job.name), [name]);
  await call(server.client, 'DeleteJob', {name});
  await assert.rejects(call(server.client, 'GetJob', {name}), (error) => error.code === grpc.status.NOT_FOUND);
});

// A mesh as a language without a Draco encoder sends it.
function arrays({positions, faces}) {
  const bytes = (numbers) => Buffer.from(numbers.buffer, numbers.byteOffset, numbers.byteLength);
  return {positions: bytes(new Float32Array(positions)), triangles: bytes(new Uint32Array(faces))};
}

test('plain arrays, by short calls only: the same bytes as by Draco', async () => {
  const mesh = bump();
  const spec = {arrays: arrays(mesh), labels: {test: 'arrays'}};
  const {name} = await call(server.client, 'CreateJob', {spec, request_id: 'arrays'});
  assert.equal((await call(server.client, 'CreateJob', {spec, request_id: 'arrays'})).name, name);
  let job;
  do {
    job = await call(server.client, 'WaitJob', {name, timeout: {seconds: 5}, view: 'JOB_VIEW_BASIC'});
  } while (['JOB_STATE_QUEUED', 'JOB_STATE_RUNNING'].includes(job.state));
  assert.equal(job.state, 'JOB_STATE_SUCCEEDED', job.error?.message);
  assert.equal(job.report, null);
  const {positions, triangles} = spec.arrays;
  assert.equal(job.uv.mesh_sha256.toString('hex'), sha256(Buffer.concat([positions, triangles])));
  const pieces = [];
  for (let offset = 0; offset < job.uv.total_bytes; offset += pieces.at(-1).length) {
    const {uv, data} = await call(server.client, 'ReadResult', {name, offset, limit: 1000});
    assert.equal(uv.total_bytes, job.uv.total_bytes);
    pieces.push(data);
  }
  const {uv: byDraco} = await unwrap(await encode(mesh));
  assert.ok(Buffer.concat(pieces).equals(byDraco));
});

test('arrays that are no mesh', async () => {
  const {positions, triangles} = arrays(cylinderPatch());
  const cut = {spec: {arrays: {positions: positions.subarray(1), triangles}}};
  await assert.rejects(call(server.client, 'CreateJob', cut), (error) => {
    assert.equal(error.code, grpc.status.INVALID_ARGUMENT);
    assert.equal(errorInfoOfCall(error)?.reason, 'MESH_POSITION_INVALID');
    assert.deepEqual(fieldsOfCall(error), ['spec.arrays.positions']);
    return true;
  });
  const wrong = Buffer.from(triangles);
  wrong.writeUInt32LE(1_000_000, 12 * 5);
  const {job} = checkStream(await collect(server.client, 'Unwrap', {spec: {arrays: {positions, triangles: wrong}}}));
  assert.equal(job.state, 'JOB_STATE_FAILED');
  assert.equal(errorInfoOfJob(job).reason, 'MESH_INDEX_OUT_OF_RANGE');
  assert.equal(errorInfoOfJob(job).metadata.faces, '5');
});

test('a batch: what the server has is not sent again', async () => {
  const [known, other] = [await encode(bump()), await encode(cylinderPatch())];
  const digests = [known, other].map((draco) => createHash('sha256').update(draco).digest());
  await upload(known);
  const {missing_sha256: missing} = await call(server.client, 'FindMissingMeshes', {sha256: digests});
  assert.ok(!missing.some((digest) => digest.equals(digests[0])));
  const specs = [{mesh_sha256: digests[0]}, {draco: other}, {draco: other, options: {padding: 65}}];
  const requests = specs.map((spec) => ({spec}));
  const {results} = await call(server.client, 'BatchCreateJobs', {requests});
  assert.deepEqual(results.map(({result}) => result), ['job', 'job', 'error']);
  assert.match(results[2].error.message, /padding/);
  for (const {job} of results.slice(0, 2)) {
    const ended = await call(server.client, 'WaitJob', {name: job.name, timeout: {seconds: 20}});
    assert.equal(ended.state, 'JOB_STATE_SUCCEEDED', ended.error?.message);
  }
});

test('a closed mesh without seams fails with a reason', async () => {
  const {job, uv} = await unwrap(await encode(tetrahedron()), {options: {seams: 'SEAMS_NONE'}});
  assert.equal(job.state, 'JOB_STATE_FAILED');
  assert.equal(errorInfoOfJob(job).reason, 'MESH_CLOSED');
  assert.equal(errorInfoOfJob(job).domain, 'planish');
  assert.ok(job.error.message.length > 10, job.error.message);
  assert.equal(uv.length, 0);
});

test('bytes that are no Draco fail with a reason', async () => {
  await assert.rejects(unwrap(Buffer.from('This is not a mesh.')), (error) => {
    assert.equal(error.code, grpc.status.INVALID_ARGUMENT, 'seen at once');
    assert.equal(errorInfoOfCall(error)?.reason, 'MESH_DECODE_FAILED');
    return true;
  });
  const whole = await encode(bump());
  const {job} = await unwrap(whole.subarray(0, whole.length / 2));
  assert.equal(job.state, 'JOB_STATE_FAILED', 'seen when it is decoded');
  assert.equal(errorInfoOfJob(job).reason, 'MESH_DECODE_FAILED');
});

test('a call without a mesh is refused with details', async () => {
  await assert.rejects(collect(server.client, 'Unwrap', {}), (error) => {
    assert.equal(error.code, grpc.status.INVALID_ARGUMENT);
    assert.equal(errorInfoOfCall(error)?.domain, 'planish');
    return true;
  });
});

// ---- errors: each its code, reason and metadata

async function refused(promise, code, reason) {
  let info;
  await assert.rejects(promise, (error) => {
    info = errorInfoOfCall(error);
    assert.equal(error.code, grpc.status[code], error.message);
    assert.equal(info?.reason, reason, error.message);
    assert.equal(info.domain, 'planish');
    return true;
  });
  return info.metadata;
}

async function upload(draco, {sha = createHash('sha256').update(draco).digest(), pieces = 3} = {}) {
  const created = await call(server.client, 'CreateUpload', {total_bytes: draco.length, sha256: sha});
  const written = await new Promise((resolve, reject) => {
    const stream = server.client.WriteUpload((error, response) => (error ? reject(error) : resolve(response)));
    stream.on('error', () => {});  // it is in the answer
    for (let i = 0; i < pieces; ++i) {
      const [begin, end] = [i, i + 1].map((n) => Math.floor((n * draco.length) / pieces));
      stream.write({name: i === 0 ? created.name : '', offset: begin, data: draco.subarray(begin, end)});
    }
    stream.end();
  });
  return {created, written};
}

test('a mesh that was uploaded in pieces gives the same bytes as one sent inline', async () => {
  const draco = await encode(bump());
  const inline = await unwrap(draco);
  const {created, written} = await upload(draco);
  assert.equal(written.committed_bytes, draco.length);
  const uploaded = checkStream(await collect(server.client, 'Unwrap', {spec: {upload: created.name}}));
  await checkUv(uploaded.job, uploaded.uv, draco);
  assert.ok(uploaded.uv.equals(inline.uv));
  const again = await call(server.client, 'CreateUpload', {total_bytes: draco.length, sha256: created.sha256});
  assert.equal(again.committed_bytes, draco.length, 'known bytes need not be sent again');
});

test('wrong digest', async () => {
  const metadata = await refused(upload(Buffer.from('not these bytes'), {sha: Buffer.alloc(32)}), 'INVALID_ARGUMENT',
                                 'DIGEST_MISMATCH');
  assert.match(metadata.upload, /^uploads\//);
  await refused(call(server.client, 'GetUpload', {name: metadata.upload}), 'NOT_FOUND', 'UPLOAD_NOT_FOUND');
});

test('incomplete upload', async () => {
  const {name} = await call(server.client, 'CreateUpload', {total_bytes: 10, sha256: Buffer.alloc(32, 1)});
  const metadata = await refused(call(server.client, 'CreateJob', {spec: {upload: name}}), 'FAILED_PRECONDITION',
                                 'UPLOAD_INCOMPLETE');
  assert.equal(metadata.committed_bytes, '0');
});

test('oversized mesh', async () => {
  const {max_mesh_bytes: limit} = await call(server.client, 'GetCapabilities', {});
  const metadata = await refused(
    call(server.client, 'CreateUpload', {total_bytes: Number(limit) + 1, sha256: Buffer.alloc(32)}),
    'RESOURCE_EXHAUSTED', 'MESH_TOO_LARGE');
  assert.equal(metadata.limit, String(limit));
  assert.equal(metadata.bytes, String(Number(limit) + 1));
});

test('unknown job', async () => {
  const name = 'jobs/none';
  for (const method of ['GetJob', 'StopJob', 'CancelJob', 'DeleteJob']) {
    const metadata = await refused(call(server.client, method, {name}), 'NOT_FOUND', 'JOB_NOT_FOUND');
    assert.equal(metadata.job, name, method);
  }
  await refused(collect(server.client, 'WatchJob', {name}), 'NOT_FOUND', 'JOB_NOT_FOUND');
});

// Starts a server with other flags for the time of `use`.
async function withServer(flags, use) {
  const other = await startServer(`127.0.0.1:${await freePort()}`, flags);
  try {
    await use(other.client);
  } finally {
    await other.stop();
  }
}

test('more memory than there is', async () => {
  await withServer(['--memory-mb=1', '--workers=1'], async (client) => {
    const metadata = await refused(call(client, 'CreateJob', {spec: {draco: await encode(bump())}}),
                                   'RESOURCE_EXHAUSTED', 'MEMORY_LIMIT');
    assert.equal(metadata.limit, String(1 << 20));
    assert.ok(Number(metadata.bytes) > 1 << 20, metadata.bytes);
  });
});

test('expired result', async () => {
  await withServer(['--retain-hours=1e-6', '--workers=1'], async (client) => {
    const request = {spec: {draco: await encode(cylinderPatch()), scheduling: {fresh: true}}};
    const {job} = checkStream(await collect(client, 'Unwrap', request));
    await collect(client, 'Unwrap', request);  // the last result always stays
    const name = job.name;
    for (let i = 0; i < 200 && (await call(client, 'GetJob', {name})).state !== 'JOB_STATE_EXPIRED'; ++i) {
      await new Promise((resolve) => setTimeout(resolve, 20));
    }
    const metadata = await refused(collect(client, 'WatchJob', {name, include_uv: true}), 'NOT_FOUND',
                                   'RESULT_EXPIRED');
    assert.equal(metadata.job, name);
  });
});

test('full queue', async () => {
  await withServer(['--queue=1', '--workers=1'], async (client) => {
    const draco = await encode(bump());
    // The paper as written takes its time.
    const options = {solver: 'SOLVER_UZAWA', system: 'SYSTEM_FULL', preconditioner: 'PRECONDITIONER_NONE'};
    const names = [];
    const fill = async () => {
      for (let i = 0; i < 50; ++i) {
        const scheduling = {fresh: true};
        names.push((await call(client, 'CreateJob', {spec: {draco, options, scheduling}})).name);
      }
    };
    const metadata = await refused(fill(), 'RESOURCE_EXHAUSTED', 'QUEUE_FULL');
    assert.equal(metadata.queue_capacity, '1');
    for (const name of names) await call(client, 'CancelJob', {name});
  });
});

test('over a Unix socket', async () => {
  const folder = mkdtempSync(path.join(os.tmpdir(), 'planish-'));
  try {
    const local = await startServer(`unix:${folder}/s`);
    const draco = await encode(cylinderPatch());
    const {job, uv} = checkStream(await collect(local.client, 'Unwrap', {spec: {draco}}));
    await checkUv(job, uv, draco);
    assert.equal(await local.stop(), 0);
  } finally {
    rmSync(folder, {recursive: true});
  }
});
