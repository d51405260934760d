// A transform for glTF-Transform, which makes UV for the triangles of a document, as its own unwrap() does.
import {Node, Primitive, PropertyType} from '@gltf-transform/core';

import {Client} from './client.js';
import {PlanishError} from './errors.js';
import {defaultClient} from './index.js';

const NAME = 'planish';
const GROUPS = ['primitive', 'mesh', 'scene'];
const MOST_AT_A_TIME = 4;

export function planish({server, client, connection, texcoord = 0, overwrite = false, groupBy = 'mesh', onProgress, onResult, signal, ...options} = {}) {
  if (!GROUPS.includes(groupBy)) throw new Error(`${NAME}: groupBy is ${groupBy}; it must be one of ${GROUPS.join(', ')}`);
  const transform = async (document) => {
    if (document.hasExtension?.('KHR_mesh_primitive_restart')) throw new Error(`${NAME}: KHR_mesh_primitive_restart is not supported`);
    const semantic = `TEXCOORD_${texcoord}`;
    const groups = [];
    const scene = [];
    for (const mesh of document.getRoot().listMeshes()) {
      const scale = groupBy === 'scene' ? worldScale(mesh) : 1;
      const parts = mesh.listPrimitives()
        .filter((primitive) => overwrite || !primitive.getAttribute(semantic))
        .map((primitive) => ({primitive, mesh, scale, triangles: trianglesOf(primitive)}))
        .filter(({triangles}) => triangles?.length > 0);
      if (groupBy === 'scene') scene.push(...parts);
      else if (groupBy === 'mesh') groups.push(parts);
      else groups.push(...parts.map((part) => [part]));
    }
    groups.push(scene);
    const wanted = groups.filter((parts) => parts.length > 0), waiting = [...wanted];
    const mine = client ?? (server ? new Client(server, connection) : defaultClient());
    const done = new Map();
    const work = async () => {
      for (let parts = waiting.shift(); parts; parts = waiting.shift()) {
        const primitives = parts.map(({primitive}) => primitive);
        const {positions, indices} = weld(parts);
        try {
          const result = await mine.unwrap(positions, indices, options, {signal, onProgress: onProgress && ((progress) => onProgress(progress, primitives))});
          done.set(parts, result);
        } catch (error) {
          waiting.length = 0;  // starts no more; calls that run end first, and the document stays as it was
          if (error instanceof PlanishError) error.message = `${parts.map(({mesh}) => mesh.getName()).find(Boolean) ?? 'a mesh'}: ${error.message}`;
          throw error;
        }
      }
    };
    const ends = await Promise.allSettled(Array.from({length: MOST_AT_A_TIME}, work));
    if (server && !client) mine.close();
    const failed = ends.find(({status}) => status === 'rejected');
    if (failed) throw failed.reason;
    for (const parts of wanted) {
      const result = done.get(parts);
      let corner = 0;
      for (const {primitive, triangles} of parts) {
        write(document, primitive, triangles, result.uv.subarray(2 * corner, 2 * (corner + triangles.length)), texcoord);
        corner += triangles.length;
      }
      for (const {message} of result.warnings) document.getLogger().warn(`${NAME}: ${message}`);
      onResult?.(result, parts.map(({primitive}) => primitive));
    }
    document.getLogger().debug(`${NAME}: Complete.`);
  };
  return Object.defineProperty(transform, 'name', {value: NAME});
}

// The vertices of the primitive's triangles, three each; null for points and lines.
function trianglesOf(primitive) {
  const {TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN} = Primitive.Mode;
  const position = primitive.getAttribute('POSITION');
  const mode = primitive.getMode();
  if (!position || ![TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN].includes(mode)) return null;
  const given = primitive.getIndices()?.getArray() ?? Uint32Array.from({length: position.getCount()}, (_, i) => i);
  if (mode === TRIANGLES) return Uint32Array.from(given.subarray(0, given.length - (given.length % 3)));
  const triangles = [];
  for (let i = 2; i < given.length; ++i) {
    const [a, b] = mode === TRIANGLE_FAN ? [given[0], given[i - 1]] : i % 2 === 0 ? [given[i - 2], given[i - 1]] : [given[i - 1], given[i - 2]];
    if (a !== b && b !== given[i] && a !== given[i]) triangles.push(a, b, given[i]);
  }
  return Uint32Array.from(triangles);
}

// The largest factor by which a node of the mesh enlarges it.
function worldScale(mesh) {
  const scales = mesh.listParents().filter((parent) => parent instanceof Node).flatMap((node) => node.getWorldScale()).map(Math.abs);
  const scale = Math.max(...scales.filter(Number.isFinite));
  return scale > 0 && Number.isFinite(scale) ? scale : 1;
}

// Joins all parts into one mesh. Vertices of the same glTF mesh at the same position become one, so that charts
// continue across edges where normals or materials change.
function weld(parts) {
  const positions = [], indices = [], known = new Map(), point = [];
  for (const {primitive, mesh, scale, triangles} of parts) {
    const accessor = primitive.getAttribute('POSITION');
    if (!known.has(mesh)) known.set(mesh, new Map());
    const places = known.get(mesh), numbers = new Int32Array(accessor.getCount()).fill(-1);
    for (const v of triangles) {
      if (numbers[v] < 0) {
        accessor.getElement(v, point);
        const place = `${point[0] + 0},${point[1] + 0},${point[2] + 0}`;  // -0 is 0
        if (!places.has(place)) {
          places.set(place, positions.length / 3);
          positions.push(scale * point[0], scale * point[1], scale * point[2]);
        }
        numbers[v] = places.get(place);
      }
      indices.push(numbers[v]);
    }
  }
  return {positions: Float32Array.from(positions), indices: Uint32Array.from(indices)};
}

// Writes the UV of the primitive's corners, and splits vertices with several UV.
function write(document, primitive, triangles, uv, texcoord) {
  const next = new Map(), sources = [], coordinates = [], first = new Int32Array(primitive.getAttribute('POSITION').getCount()).fill(-1);
  const indices = new Uint32Array(triangles.length);
  for (let c = 0; c < triangles.length; ++c) {
    const v = triangles[c], s = Math.fround(uv[2 * c]), t = Math.fround(1 - uv[2 * c + 1]);  // glTF's v goes down
    let n = first[v], last = -1;
    while (n >= 0 && (coordinates[2 * n] !== s || coordinates[2 * n + 1] !== t)) {
      last = n;
      n = next.get(n) ?? -1;
    }
    if (n < 0) {
      n = sources.length;
      sources.push(v);
      coordinates.push(s, t);
      if (last < 0) first[v] = n;
      else next.set(last, n);
    }
    indices[c] = n;
  }
  const semantic = `TEXCOORD_${texcoord}`;
  const old = primitive.getAttribute(semantic);
  primitive.setAttribute(semantic, null);
  if (old) disposeUnused(old);
  const buffer = primitive.getAttribute('POSITION').getBuffer() ?? document.getRoot().listBuffers()[0] ?? document.createBuffer();
  for (const holder of [primitive, ...primitive.listTargets()]) {
    for (const name of holder.listSemantics()) {
      const accessor = holder.getAttribute(name);
      holder.setAttribute(name, remapped(document, accessor, sources));
      disposeUnused(accessor);
    }
  }
  const made = document.createAccessor().setType('VEC2').setArray(Float32Array.from(coordinates)).setBuffer(buffer);
  // glTF allows TEXCOORD_N only with all sets below N: those that are missing get the same UV.
  for (let n = 0; n <= texcoord; ++n) {
    if (n === texcoord || !primitive.getAttribute(`TEXCOORD_${n}`)) primitive.setAttribute(`TEXCOORD_${n}`, made);
  }
  const before = primitive.getIndices();
  primitive.setIndices(document.createAccessor().setType('SCALAR').setArray(sources.length < 65535 ? Uint16Array.from(indices) : indices).setBuffer(buffer));
  primitive.setMode(Primitive.Mode.TRIANGLES);
  if (before) disposeUnused(before);
}

function remapped(document, accessor, sources) {
  const size = accessor.getElementSize(), from = accessor.getArray();
  const array = new from.constructor(sources.length * size);
  sources.forEach((v, i) => { for (let k = 0; k < size; ++k) array[i * size + k] = from[v * size + k]; });
  return document.createAccessor(accessor.getName()).setType(accessor.getType()).setNormalized(accessor.getNormalized()).setArray(array)
    .setBuffer(accessor.getBuffer()).setExtras(accessor.getExtras());
}

function disposeUnused(property) {
  if (!property.listParents().some((parent) => parent.propertyType !== PropertyType.ROOT)) property.dispose();
}
