// The transform for glTF-Transform, beside its own unwrap() with watlas on the same documents.
import {Document, NodeIO} from '@gltf-transform/core';
import {unwrap as unwrapByWatlas} from '@gltf-transform/functions';
import assert from 'node:assert/strict';
import test from 'node:test';
import {closeDefaultServer} from 'planish';
import {planish} from 'planish/gltf-transform';
import * as watlas from 'watlas';

import {areas, bump, measure, tube} from './meshes.mjs';

// A tube of two primitives, the upper one with vertices of its own and with texture coordinates; and a bump, twice as large in the scene.
function scene() {
  const document = new Document();
  const buffer = document.createBuffer();
  const accessor = (type, array) => document.createAccessor().setType(type).setArray(array).setBuffer(buffer);
  const {positions, indices} = tube(12);
  const position = accessor('VEC3', positions);
  const half = indices.length / 2;
  const lower = document.createPrimitive().setAttribute('POSITION', position).setIndices(accessor('SCALAR', indices.slice(0, half)));
  const upper = document.createPrimitive().setAttribute('POSITION', accessor('VEC3', positions.slice())).setIndices(accessor('SCALAR', Uint16Array.from(indices.slice(half))))
    .setAttribute('TEXCOORD_0', accessor('VEC2', new Float32Array(2 * positions.length / 3)))
    .setAttribute('COLOR_0', accessor('VEC4', Uint8Array.from({length: 4 * positions.length / 3}, (_, i) => i >> 2)).setNormalized(true));
  const target = document.createPrimitiveTarget().setAttribute('POSITION', accessor('VEC3', positions.map((x, i) => x + i)));
  upper.addTarget(target);
  const flat = bump(6);
  const other = document.createPrimitive().setAttribute('POSITION', accessor('VEC3', flat.positions)).setIndices(accessor('SCALAR', flat.indices));
  const points = document.createPrimitive().setMode(0).setAttribute('POSITION', position);
  const meshes = [document.createMesh('tube').addPrimitive(lower).addPrimitive(upper), document.createMesh('bump').addPrimitive(other).addPrimitive(points)];
  const nodes = meshes.map((mesh, i) => document.createNode().setMesh(mesh).setScale(i === 0 ? [1, 1, 1] : [2, 2, 2]));
  document.createScene().addChild(nodes[0]).addChild(nodes[1]);
  return {document, lower, upper, other, points};
}

const uvByCorner = (primitive, semantic = 'TEXCOORD_0') => {
  const texcoord = primitive.getAttribute(semantic);
  return Float32Array.from([...primitive.getIndices().getArray()].flatMap((v) => texcoord.getElement(v, [])));
};
// With glTF's v, which goes down, triangles that are not mirrored are clockwise.
const areMirrored = (uv) => areas(uv).filter((area) => area >= 0).length;

test('what is there stays, and the map goes on over borders of primitives', async () => {
  const {document, lower, upper, other, points} = scene(), given = uvByCorner(upper);
  const positionsOf = (primitive) => [...primitive.getIndices().getArray()].map((v) => String(primitive.getAttribute('POSITION').getElement(v, [])));
  const before = positionsOf(lower);
  await document.transform(planish({textureSize: 256}));
  assert.deepEqual(uvByCorner(upper), given);  // overwrite is false
  assert.ok(points.getAttribute('TEXCOORD_0') === null);
  assert.equal(areMirrored(uvByCorner(lower)) + areMirrored(uvByCorner(other)), 0);
  assert.deepEqual(positionsOf(lower), before);

  const results = [];
  await document.transform(planish({textureSize: 256, overwrite: true, onResult: (result, primitives) => results.push([result, primitives])}));
  assert.ok(results.length === 2 && results[0][1][0] === lower && results[0][1][1] === upper && results[1][1][0] === other);
  assert.ok(measure([lower, upper], 'TEXCOORD_0').seams < 30);  // one line along the tube, and no ring between its halves
  // A vertex takes everything along that it has.
  const color = upper.getAttribute('COLOR_0'), moved = upper.listTargets()[0].getAttribute('POSITION'), position = upper.getAttribute('POSITION');
  assert.ok(color.getArray() instanceof Uint8Array && color.getNormalized());
  for (let v = 0; v < position.getCount(); ++v) {
    const source = color.getArray()[4 * v];
    assert.deepEqual(moved.getElement(v, []), position.getElement(v, []).map((x, k) => Math.fround(x + 3 * source + k)));
  }
  await new NodeIO().writeBinary(document);
});

test('groups, further sets, and failures that leave the document alone', async () => {
  const {document, lower, upper, other} = scene();
  await document.transform(planish({texcoord: 1, groupBy: 'scene', textureSize: 256}));
  const area = (primitive) => areas(uvByCorner(primitive, 'TEXCOORD_1')).reduce((sum, each) => sum + Math.abs(each), 0);
  // Twice as large in the scene, so four times the area; the bump's surface and the halves of the tube are known by their triangles.
  const surface = (primitive) => {
    const position = primitive.getAttribute('POSITION'), indices = primitive.getIndices().getArray();
    let sum = 0;
    for (let c = 0; c < indices.length; c += 3) {
      const [p, q, r] = [0, 1, 2].map((k) => position.getElement(indices[c + k], []));
      const [a, b] = [q, r].map((end) => end.map((x, k) => x - p[k]));
      sum += Math.hypot(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
    }
    return sum;
  };
  const density = [lower, upper, other].map((primitive) => area(primitive) / surface(primitive));
  assert.ok(Math.abs(density[1] / density[0] - 1) < 0.05 && Math.abs(density[2] / density[0] - 4) < 0.4, String(density));
  assert.ok(lower.getAttribute('TEXCOORD_0') === lower.getAttribute('TEXCOORD_1'));  // glTF wants those before it as well
  assert.ok(upper.getAttribute('TEXCOORD_0') !== upper.getAttribute('TEXCOORD_1'));

  const kept = lower.getAttribute('TEXCOORD_1');
  await assert.rejects(document.transform(planish({texcoord: 1, overwrite: true, server: 'unix:/nowhere'})), {reason: 'SERVER_UNREACHABLE'});
  await assert.rejects(document.transform(planish({overwrite: true, signal: AbortSignal.abort()})), {name: 'AbortError'});
  assert.throws(() => planish({groupBy: 'material'}), /primitive, mesh, scene/);
  assert.ok(lower.getAttribute('TEXCOORD_1') === kept);

  const strip = new Document(), places = Float32Array.of(0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0.2, 0, 2, 0);
  const primitive = strip.createPrimitive().setMode(5).setAttribute('POSITION', strip.createAccessor().setType('VEC3').setArray(places));
  strip.createMesh().addPrimitive(primitive);
  await strip.transform(planish({groupBy: 'primitive'}));
  assert.equal(primitive.getMode(), 4);
  assert.equal(areMirrored(uvByCorner(primitive)), 0);
  assert.equal(primitive.getIndices().getCount(), 9);
});

test('beside unwrap() of glTF-Transform', async () => {
  const rows = [];
  for (const groupBy of ['primitive', 'mesh', 'scene']) {
    for (const [tool, transform] of [['planish', planish({overwrite: true, groupBy})], ['watlas', unwrapByWatlas({watlas, overwrite: true, groupBy})]]) {
      const {document, lower, upper, other, points} = scene(), start = performance.now();
      points.dispose();  // unwrap() takes no points
      await document.transform(transform);
      const {charts, seams} = measure([lower, upper, other], 'TEXCOORD_0');
      for (const primitive of [lower, upper, other]) assert.ok(uvByCorner(primitive).every((x) => x >= 0 && x <= 1));
      rows.push({groupBy, tool, charts, seams, seconds: (performance.now() - start) / 1000});
    }
  }
  console.table(rows);
  for (let i = 0; i < rows.length; i += 2) assert.ok(rows[i].seams <= rows[i + 1].seams);
});

test.after(closeDefaultServer);
