// The example for JavaScript, proto/unwrap.mjs, as a program and as a module.
import assert from 'node:assert/strict';
import {execFile} from 'node:child_process';
import {mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import {after, before, test} from 'node:test';
import {promisify} from 'node:util';

import {unwrap} from './unwrap.mjs';
import {tetrahedron} from './meshes.mjs';
import {freePort, startServer} from './server.mjs';

let server, address;
before(async () => {
  address = `127.0.0.1:${await freePort()}`;
  server = await startServer(address);
});
after(async () => {
  if (server) await server.stop();
});

test('an OBJ file gets UV', async () => {
  const folder = mkdtempSync(path.join(os.tmpdir(), 'planish-'));
  try {
    const [input, output] = ['in.obj', 'out.obj'].map((name) => path.join(folder, name));
    const {positions, faces} = tetrahedron();
    const rows = (word, numbers, shift) => numbers.flatMap((_, i) =>
      i % 3 ? [] : [`${word} ${numbers.slice(i, i + 3).map((n) => n + shift).join(' ')}`]);
    writeFileSync(input, [...rows('v', positions, 0), ...rows('f', faces, 1)].join('\n'));
    const {stdout} = await promisify(execFile)(process.execPath, ['unwrap.mjs', address, input, output]);
    assert.match(stdout, /^\d+ charts, stretch 1\.\d{3}\n$/);
    const words = readFileSync(output, 'utf8').trim().split('\n').map((line) => line.split(' '));
    const uv = words.filter(([word]) => word === 'vt').map(([, u, v]) => [Number(u), Number(v)]);
    const corners = words.filter(([word]) => word === 'f').flatMap((line) => line.slice(1));
    assert.deepEqual(corners.map((corner) => parseInt(corner) - 1), faces, 'the faces keep their vertices and order');
    const {uv: expected} = await unwrap(address, new Float32Array(positions), new Uint32Array(faces));
    assert.deepEqual(corners.flatMap((corner) => uv[corner.split('/')[1] - 1]), [...expected]);
    for (let i = 0; i < expected.length; i += 6) {
      const [a, b, c, d, e, f] = expected.slice(i, i + 6);
      assert.ok((c - a) * (f - b) - (d - b) * (e - a) > 0, 'every triangle keeps its orientation');
    }
  } finally {
    rmSync(folder, {recursive: true});
  }
});

test('progress, options and errors', async () => {
  const {positions, faces} = tetrahedron();
  const mesh = [new Float32Array(positions), new Uint32Array(faces)];
  const stages = new Set();
  const {report} = await unwrap(address, ...mesh, {textureSize: 256}, ({stage}) => stages.add(stage));
  assert.equal(report.atlas.textureSize, 256);
  assert.ok(stages.has('STAGE_SOLVE'), [...stages].join());
  await assert.rejects(unwrap(address, ...mesh, {seams: 'SEAMS_NONE'}), /closed/);
  await assert.rejects(unwrap(address, mesh[0].slice(1), mesh[1]), /multiple of 12/);
});

test('the lines that proto/README.md begins with', async () => {
  const page = readFileSync(path.join(process.env.PLANISH_PROTO, 'README.md'), 'utf8');
  const [, code] = /^# [^\n]*\n\n```js\n(.*?)^```/ms.exec(page);
  writeFileSync('readme.mjs', code.replace('127.0.0.1:7741', address).replace("'proto'", JSON.stringify(process.env.PLANISH_PROTO)));
  const {stdout} = await promisify(execFile)(process.execPath, ['readme.mjs']);
  assert.match(stdout, /STAGE_PACK/);
  assert.match(stdout, /JOB_STATE_SUCCEEDED/);
  assert.match(stdout, /Float32Array\(6\)/);
});
