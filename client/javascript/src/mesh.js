// Converts arrays to meshes for sending, and UV per corner to UV per vertex.
import {createHash} from 'node:crypto';

import {invalid} from './errors.js';

const bytesOf = (array) => Buffer.from(array.buffer, array.byteOffset, array.byteLength);

function numbers(argument, value, width) {
  let array = value;
  if (Array.isArray(value) && (Array.isArray(value[0]) || ArrayBuffer.isView(value[0]))) array = value.map((row) => [...row]).flat();
  if (!Array.isArray(array) && (!ArrayBuffer.isView(array) || array instanceof DataView)) throw invalid(`${argument} is no array of numbers`);
  if (array.length % width !== 0) throw invalid(`${argument} has ${array.length} numbers, which is no multiple of ${width}`);
  return array;
}

function integers(argument, value, width, low, high, reason = 'OPTIONS_INVALID') {
  const array = numbers(argument, value, width);
  for (let i = 0; i < array.length; ++i) {
    if (!(Number.isInteger(array[i]) && array[i] >= low && array[i] <= high)) {
      throw invalid(`${argument}[${i}] is ${array[i]}; it must be an integer from ${low} to ${high}`, reason, {faces: String(Math.floor(i / width))});
    }
  }
  return array instanceof Uint32Array ? array : Uint32Array.from(array);
}

// The point to subtract from positions, in double, before they are rounded: the rule of core/mesh/local_origin.h.
function localOrigin(positions, triangles) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  let isExact = true;
  for (const v of triangles) {
    for (let k = 0; k < 3; ++k) {
      const x = positions[3 * v + k];
      if (x < low[k]) low[k] = x;
      if (x > high[k]) high[k] = x;
      isExact &&= x === Math.fround(x);
    }
  }
  const side = Math.max(...[0, 1, 2].map((k) => high[k] - low[k]));
  if (!(side > 0) || isExact) return [0, 0, 0];
  const step = 2 ** (Math.floor(Math.log2(side)) - 1);
  return [0, 1, 2].map((k) => {
    const middle = low[k] / 2 + high[k] / 2;
    return Math.abs(middle) > side && step > 0 ? Math.floor(middle / step + 0.5) * step : 0;
  });
}

// Checks the arrays of a mesh and lays them out for the wire.
export function packMesh({positions, indices, seamEdges, seamCorners, parts, uncutCorners, facePolygon, faceAtlas, faceWeights}) {
  const given = numbers('positions', positions, 3);
  if (indices?.length === 0) throw invalid('indices is empty: there is nothing to flatten', 'MESH_EMPTY');
  const triangles = integers('indices', indices, 3, 0, given.length / 3 - 1, 'MESH_INDEX_OUT_OF_RANGE');
  const faces = triangles.length / 3;
  const origin = given instanceof Float32Array ? [0, 0, 0] : localOrigin(given, triangles);
  const xyz = given instanceof Float32Array ? given : Float32Array.from(given, (x, i) => x - origin[i % 3]);
  for (let i = 0; i < xyz.length; ++i) {
    if (!Number.isFinite(xyz[i])) {
      throw invalid(`positions[${i}] is ${given[i]}, which is no number of single precision`, 'MESH_POSITION_NOT_FINITE',
                    {vertices: String(Math.floor(i / 3))});
    }
  }
  const ofFaces = (argument, value, high) => {
    const array = integers(argument, value, 1, 0, high);
    if (array.length !== faces) throw invalid(`${argument} has ${array.length} numbers for ${faces} triangles`);
    return array;
  };
  const elements = {};
  const polygon = facePolygon === undefined ? undefined : ofFaces('facePolygon', facePolygon, faces - 1);
  const seams = seamCorners === undefined ? [] : [...integers('seamCorners', seamCorners, 1, 0, triangles.length - 1)];
  if (seamEdges !== undefined) cornersOfEdges(numbers('seamEdges', seamEdges, 2), triangles, polygon).forEach((corner) => seams.push(corner));
  if (parts !== undefined) cornersBetween(ofFaces('parts', parts, 2 ** 32 - 1), triangles).forEach((corner) => seams.push(corner));
  if (seams.length > 0) elements.seamCorners = bytesOf(Uint32Array.from(seams));
  if (uncutCorners !== undefined) elements.uncutCorners = bytesOf(integers('uncutCorners', uncutCorners, 1, 0, triangles.length - 1));
  if (polygon !== undefined) elements.facePolygon = bytesOf(polygon);
  if (faceAtlas !== undefined) elements.faceAtlas = bytesOf(ofFaces('faceAtlas', faceAtlas, 2 ** 31 - 1));
  if (faceWeights !== undefined) {
    const weights = Float32Array.from(numbers('faceWeights', faceWeights, 1));
    if (weights.length !== faces || !weights.every((weight) => weight > 0.0099 && weight <= 100)) {
      throw invalid(`faceWeights must have ${faces} numbers from 0.01 to 100`);
    }
    elements.faceWeights = bytesOf(weights);
  }
  return new PackedMesh(xyz, triangles, elements);
}

class PackedMesh {
  constructor(positions, triangles, elements) {
    Object.assign(this, {elements, indices: triangles, vertexCount: positions.length / 3});
    this.arrays = {positions: bytesOf(positions), triangles: bytesOf(triangles)};
    this.byteCount = [...Object.values(this.arrays), ...Object.values(elements)].reduce((sum, {length}) => sum + length, 0);
  }
  get sha256() {
    return createHash('sha256').update(this.arrays.positions).update(this.arrays.triangles).digest();
  }
  // The same mesh as a Draco file, the format of uploads: sequential, not compressed, in the same order.
  get draco() {
    const varint = (number) => (number > 127 ? [(number & 127) | 128, ...varint(number >>> 7)] : [number]);
    let bytes;
    if (this.vertexCount < 1 << 8) bytes = Buffer.from(Uint8Array.from(this.indices));
    else if (this.vertexCount < 1 << 16) bytes = bytesOf(Uint16Array.from(this.indices));
    else if (this.vertexCount >= 1 << 21) bytes = this.arrays.triangles;
    else {
      const digits = new Uint8Array(3 * this.indices.length);
      let at = 0;
      for (let index of this.indices) {
        for (; index > 127; index >>>= 7) digits[at++] = (index & 127) | 128;
        digits[at++] = index;
      }
      bytes = Buffer.from(digits.buffer, 0, at);
    }
    return Buffer.concat([
      Buffer.from('DRACO'), Buffer.from([2, 2, 1, 0, 0, 0]),  // a mesh, sequential, no flags
      Buffer.from([...varint(this.indices.length / 3), ...varint(this.vertexCount), 1]), bytes,
      Buffer.from([1, 1, 0, 9, 3, 0, 0, 0]), this.arrays.positions,  // one decoder, one attribute: POSITION, three floats
    ]);
  }
}

const edgeKey = (a, b) => (a < b ? a * 2 ** 26 + b : b * 2 ** 26 + a);
// Calls visit(corner, key): corner 3 f + k faces the edge between the other two corners of f.
function eachEdge(triangles, visit) {
  for (let c = 0; c < triangles.length; ++c) {
    const f = c - (c % 3);
    visit(c, edgeKey(triangles[f + ((c + 1) % 3)], triangles[f + ((c + 2) % 3)]));
  }
}

function cornersOfEdges(pairs, triangles, polygon) {
  const first = new Map(), diagonals = new Set(), polygons = new Map();
  eachEdge(triangles, (corner, key) => {
    if (polygon) {
      const mine = polygon[Math.floor(corner / 3)], others = polygons.get(key) ?? [];
      if (others.includes(mine)) diagonals.add(key);
      polygons.set(key, [...others, mine]);
    }
    if (!first.has(key)) first.set(key, corner);
  });
  const corners = new Set();
  for (let i = 0; i < pairs.length; i += 2) {
    const key = edgeKey(pairs[i], pairs[i + 1]);
    if (!first.has(key) || diagonals.has(key)) {
      throw invalid(`seamEdges[${i / 2}]: no ${polygon ? 'polygon' : 'triangle'} has the edge from vertex ${pairs[i]} to vertex ${pairs[i + 1]}`,
                    'OPTIONS_INVALID', {field: 'seam_edges', edges: `${pairs[i]}-${pairs[i + 1]}`});
    }
    corners.add(first.get(key));
  }
  return corners;
}

function cornersBetween(parts, triangles) {
  const first = new Map(), corners = new Set();
  eachEdge(triangles, (corner, key) => {
    const before = first.get(key);
    if (before === undefined) first.set(key, corner);
    else if (parts[Math.floor(before / 3)] !== parts[Math.floor(corner / 3)]) corners.add(before);
  });
  return corners;
}

export function splitVertices(vertexCount, indices, uv) {
  const corners = indices.length;
  if (uv.length !== 2 * corners) throw invalid(`uv has ${uv.length} numbers for ${corners} corners`);
  const sources = Uint32Array.from({length: vertexCount}, (_, v) => v);
  const made = [];  // per copy: the vertex that it copies
  const coordinates = new uv.constructor(2 * vertexCount), more = [];
  const isTaken = new Uint8Array(vertexCount), next = new Map();  // the copies of a vertex form a list
  const result = new Uint32Array(corners);
  const at = (n, k) => (n < vertexCount ? coordinates[2 * n + k] : more[2 * (n - vertexCount) + k]);
  for (let c = 0; c < corners; ++c) {
    const v = indices[c], u = uv[2 * c] + 0, w = uv[2 * c + 1] + 0;
    if (!isTaken[v]) {
      isTaken[v] = 1;
      coordinates[2 * v] = u;
      coordinates[2 * v + 1] = w;
      result[c] = v;
      continue;
    }
    let n = v, last = v;
    while (n !== undefined && (at(n, 0) !== u || at(n, 1) !== w)) {
      last = n;
      n = next.get(n);
    }
    if (n === undefined) {
      n = vertexCount + made.length;
      made.push(v);
      more.push(u, w);
      next.set(last, n);
    }
    result[c] = n;
  }
  const sourceVertex = new Uint32Array(vertexCount + made.length), vertexUv = new uv.constructor(2 * sourceVertex.length);
  sourceVertex.set(sources);
  sourceVertex.set(made, vertexCount);
  vertexUv.set(coordinates);
  vertexUv.set(more, coordinates.length);
  return {sourceVertex, indices: result, uv: vertexUv};
}
