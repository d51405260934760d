// The blocks of JavaScript in the package's README run as they stand.
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {mkdtempSync, readFileSync, rmSync, symlinkSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import path from 'node:path';
import test from 'node:test';
import {Document, NodeIO} from '@gltf-transform/core';

import {bump} from './meshes.mjs';

const blocks = [...readFileSync(process.env.PLANISH_README, 'utf8').matchAll(/^```js\n(.*?)^```/gms)].map(([, code]) => code);

test('README', async () => {
  const directory = mkdtempSync(path.join(tmpdir(), 'planish-readme-'));
  try {
    symlinkSync(path.resolve('node_modules'), path.join(directory, 'node_modules'));
    const document = new Document(), {positions, indices} = bump(6), buffer = document.createBuffer();
    const accessor = (type, array) => document.createAccessor().setType(type).setArray(array).setBuffer(buffer);
    const primitive = document.createPrimitive().setAttribute('POSITION', accessor('VEC3', positions)).setIndices(accessor('SCALAR', indices));
    document.createScene().addChild(document.createNode().setMesh(document.createMesh('bump').addPrimitive(primitive)));
    await new NodeIO().write(path.join(directory, 'in.glb'), document);
    assert.ok(blocks.length >= 2);
    blocks.forEach((code, i) => {
      writeFileSync(path.join(directory, `${i}.mjs`), code);
      execFileSync(process.execPath, [`${i}.mjs`], {cwd: directory, timeout: 120000, stdio: ['ignore', 'ignore', 'inherit']});
    });
    const [mesh] = (await new NodeIO().read(path.join(directory, 'out.glb'))).getRoot().listMeshes();
    assert.ok(mesh.listPrimitives()[0].getAttribute('TEXCOORD_0'));
  } finally {
    rmSync(directory, {recursive: true});
  }
});
