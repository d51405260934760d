// The client of the npm package, against a real planishd.
import assert from 'node:assert/strict';
import {execFileSync, spawnSync} from 'node:child_process';
import {existsSync, readdirSync, readFileSync} from 'node:fs';
import path from 'node:path';
import test from 'node:test';

import {Client, PlanishError, closeDefaultServer, defaultServer, findPlanishd, splitVertices, unwrap} from 'planish';

import {areas, bump, tube} from './meshes.mjs';

// Process ids of this process's servers.
const servers = () => readdirSync('/proc').filter((pid) => /^\d+$/.test(pid)).filter((pid) => {
  try {
    const [, name, , parent] = /\((.*)\) (\S) (\d+)/s.exec(readFileSync(`/proc/${pid}/stat`, 'utf8'));
    return name === 'planishd' && Number(parent) === process.pid;
  } catch {
    return false;
  }
});

test('a mesh, its progress, and the same mesh with one UV for each vertex', async () => {
  const {positions, indices} = tube(12), stages = [], events = [], parts = Array.from({length: indices.length / 3}, (_, f) => Number(f < 50));
  const result = await unwrap(positions, indices, {textureSize: 512, padding: 4, maxStretch: 1.1, parts},
                              {onProgress: ({stage}) => stages.push(stage), onEvent: (event) => events.push(event)});
  assert.ok(result.isUsable);
  assert.deepEqual(result.warnings, []);
  assert.ok(areas(result.uv).every((area) => area > 0));
  assert.ok(stages.includes('solve') && stages.includes('pack'));
  assert.ok(events[0].job.createTime instanceof Date && events.at(-1).job.state === 'SUCCEEDED');
  assert.equal(result.report.atlas.textureSize, 512);
  assert.equal(result.report.triangles, indices.length / 3);
  assert.ok(result.report.seconds.solve > 0);
  const split = result.perVertex();
  assert.ok(split.sourceVertex.length > positions.length / 3);
  for (let c = 0; c < indices.length; ++c) {
    assert.equal(split.sourceVertex[split.indices[c]], indices[c]);
    assert.deepEqual(split.uv.subarray(2 * split.indices[c], 2 * split.indices[c] + 2), result.uv.subarray(2 * c, 2 * c + 2));
  }
  assert.deepEqual(splitVertices(positions.length / 3, indices, result.uv), split);
});

test('seams, and positions far from the origin', async () => {
  const {positions, indices} = bump(6);
  const [whole, cut, far] = await Promise.all([
    unwrap(positions, indices, {seams: 'keep'}),
    unwrap(positions, indices, {seams: 'keep', parts: Array.from({length: indices.length / 3}, (_, f) => Number(f >= indices.length / 6))}),
    unwrap(Array.from(positions, (x) => x + 4e8), indices, {seams: 'keep'}),
  ]);
  assert.deepEqual([whole.chartCount, cut.chartCount, far.chartCount], [1, 2, 1]);
  assert.ok(far.isUsable && Math.abs(far.report.quality.stretchL2 - whole.report.quality.stretchL2) < 1e-3);
  await assert.rejects(unwrap(positions, indices, {seamEdges: [[0, 40]]}), {reason: 'OPTIONS_INVALID', edges: [[0, 40]]});
});

test('what is wrong with arrays and options is said before anything is sent', async () => {
  const client = new Client('unix:/nowhere');
  const fails = (positions, indices, options, expected) => assert.rejects(client.unwrap(positions, indices, options), expected);
  await fails([0, 0, 0], [0, 0, 7], {}, {reason: 'MESH_INDEX_OUT_OF_RANGE', faces: [0]});
  await fails([0, 0, 0, 1, NaN, 0, 0, 1, 0], [0, 1, 2], {}, {reason: 'MESH_POSITION_NOT_FINITE', vertices: [1]});
  await fails([0, 0], [0, 1, 2], {}, {message: /positions/});
  await fails([], [], {}, {reason: 'MESH_EMPTY'});
  await fails([0, 0, 0], [0, 0, 0], {seams: 'never'}, {message: /keep, needed, auto/, code: 'INVALID_ARGUMENT'});
  await fails([0, 0, 0], [0, 0, 0], {seam: 'auto'}, {message: /there is no option seam/});
  await fails([0, 0, 0], [0, 0, 0], {}, {reason: 'SERVER_UNREACHABLE', code: 'UNAVAILABLE'});
  assert.throws(() => new Client('farm:7741', {token: 'secret'}), {message: /unencrypted/});
});

test('one private server, started by the first call', async () => {
  const {positions, indices} = bump(70);
  const before = servers();
  assert.equal(before.length, 1);
  const {target} = await defaultServer();
  await unwrap(positions, indices);
  await new Client().unwrap(positions.map((x) => 2 * x), indices);
  assert.deepEqual(servers(), before);

  // Another process has one of its own; it ends by itself, and its server with it.
  const code = "import {unwrap, defaultServer} from 'planish'; await unwrap([0, 0, 0, 1, 0, 0, 0, 1, 0], [0, 1, 2]); const {target, pid} = await defaultServer(); console.log(target, pid)";
  const [other, pid] = execFileSync(process.execPath, ['--input-type=module', '-e', code], {encoding: 'utf8', timeout: 60000}).trim().split(' ');
  assert.notEqual(other, target);
  assert.ok(!existsSync(path.dirname(other.slice('unix:'.length))));
  while (existsSync(`/proc/${pid}/exe`)) await new Promise(setImmediate);

  // A crash costs a call nothing, a second one during the same call ends it.
  const kill = (most) => {
    const killed = [];
    return {killed, onProgress: () => {
      const [server] = servers();
      if (server && killed.length < most && !killed.includes(server)) {
        killed.push(server);
        process.kill(Number(server), 'SIGKILL');
      }
    }};
  };
  const once = kill(1);
  assert.ok((await unwrap(positions.map((x) => 3 * x), indices, {}, once)).isUsable);
  assert.equal(once.killed.length, 1);
  assert.equal((await defaultServer()).target, target);
  const twice = kill(9);
  await assert.rejects(unwrap(positions.map((x) => 4 * x), indices, {}, twice), {reason: 'PRIVATE_SERVER_FAILED', message: /crashed again/});
  assert.equal(twice.killed.length, 2);
  assert.ok((await unwrap(positions.map((x) => 5 * x), indices)).isUsable);
});

test('jobs and batches', async () => {
  const client = new Client(), {positions, indices} = bump(6);
  const created = await client.createJobs([
    {positions, indices, labels: {batch: 'one'}},
    {positions: [0, 0, 0], indices: [0, 0, 1]},
    {positions, indices, padding: 8, priority: 'low', labels: {batch: 'one'}},
  ]);
  assert.deepEqual(created.map((job) => job instanceof PlanishError), [false, true, false]);
  const [first, , second] = created;
  assert.ok((await client.attach(first.name, positions, indices)).isUsable);
  await assert.rejects(client.attach(first.name, positions.map((x) => 2 * x), indices), {reason: 'MESH_MISMATCH'});
  assert.equal((await client.waitJob(second.name)).state, 'SUCCEEDED');
  const watched = await client.watchJob(second.name);
  assert.equal(watched.report.atlas.padding, 8);
  const listed = await client.listJobs({filter: 'labels.batch = "one"'});
  assert.deepEqual(listed.map(({name}) => name).sort(), [first.name, second.name].sort());
  assert.equal((await client.getJob(first.name)).state, 'SUCCEEDED');
  await client.deleteJob(first.name);
  await assert.rejects(client.getJob(first.name), {reason: 'JOB_NOT_FOUND', code: 'NOT_FOUND'});
  assert.equal((await client.estimate({triangles: 1000})).triangles, 1000);
  assert.ok((await client.capabilities()).isolatedWorkers);
});

test('aborting cancels the job on the server', async () => {
  const client = new Client(), {positions, indices} = bump(80), abort = new AbortController();
  let job;
  const call = client.unwrap(positions, indices, {effort: 'best', maxStretch: 1.001}, {
    signal: abort.signal,
    onEvent: (event) => { job ??= event.job?.name; },
    onProgress: () => abort.abort(),
  });
  await assert.rejects(call, {name: 'AbortError'});
  assert.equal((await client.waitJob(job)).state, 'CANCELLED');
  await assert.rejects(client.unwrap(positions, indices, {}, {signal: abort.signal}), {name: 'AbortError'});
  const own = new Error('my own');
  await assert.rejects(client.unwrap(positions, indices, {maxStretch: 1.002}, {onProgress: () => { throw own; }}), own);
});

test('planishd is $PLANISHD, else in PATH', async () => {
  const code = "import {findPlanishd, unwrap} from 'planish'; console.log(findPlanishd()); await unwrap([0, 0, 0, 1, 0, 0, 0, 1, 0], [0, 1, 2]).catch(({message}) => console.log(message));";
  const run = (env) => spawnSync(process.execPath, ['--input-type=module', '-e', code], {encoding: 'utf8', env, timeout: 60000}).stdout.trim();
  assert.equal(run({PATH: path.dirname(findPlanishd())}), findPlanishd());
  assert.match(run({PATH: '/nowhere'}), /^null\ncannot find planishd in \$PLANISHD or PATH/);
  assert.match(run({PATH: '/nowhere', PLANISHD: '/etc/passwd'}), /^null\n\$PLANISHD is \/etc\/passwd, which is not a program/);
});

test.after(closeDefaultServer);
