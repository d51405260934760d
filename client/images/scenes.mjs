// Makes the models of client/images/textures.sh: merge.glb, a still life of five materials, three of which have images, and
// bake.ply, a knobbly ball with colours of vertices.
//   node scenes.mjs FOLDER
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { png } from '../../tests/report/meshes.mjs';

const folder = process.argv[2];
const TURN = 2 * Math.PI;
const onGrid = (x) => Math.round(4096 * x) / 4096 + 0; // both sides of a seam come to the same place

// A surface over [0, 1]^2, of columns x rows squares.
function sheet(columns, rows, place, repeat = [1, 1]) {
  const positions = [], uv = [], indices = [];
  for (let j = 0; j <= rows; ++j) {
    for (let i = 0; i <= columns; ++i) {
      positions.push(...place(i / columns, j / rows).map(onGrid));
      uv.push((repeat[0] * i) / columns, (repeat[1] * j) / rows);
      if (i < columns && j < rows) {
        const v = j * (columns + 1) + i, w = v + columns + 1;
        indices.push(v, v + 1, w + 1, v, w + 1, w);
      }
    }
  }
  return { positions, uv, indices };
}

function joined(parts) {
  const all = { positions: [], uv: [], indices: [] };
  for (const { positions, uv, indices } of parts) {
    const first = all.positions.length / 3;
    all.positions.push(...positions);
    all.uv.push(...uv);
    all.indices.push(...indices.map((v) => first + v));
  }
  return all;
}

// A box round `middle`, with an image for each `size` of its sides.
function box(middle, half, size) {
  const sides = [[0, 1, 2, 1], [0, 1, 2, -1], [1, 2, 0, 1], [1, 2, 0, -1], [2, 0, 1, 1], [2, 0, 1, -1]];
  return joined(sides.map(([a, b, c, sign]) => sheet(4, 4, (x, y) => {
    const p = [...middle];
    p[a] += sign * half[a];
    p[b] += sign * half[b] * (2 * x - 1);
    p[c] += half[c] * (2 * y - 1);
    return p;
  }, [(2 * half[b]) / size, (2 * half[c]) / size])));
}

// A curve (radius and height of t) turned round an axis.
const turned = (columns, rows, [x0, y0, z0], curve, repeat) => sheet(columns, rows, (x, y) => {
  const [radius, height] = curve(y);
  return [x0 + radius * Math.sin(TURN * x), y0 + height, z0 + radius * Math.cos(TURN * x)];
}, repeat);

// Values between those of a lattice that repeats.
function cloud(seed, cells) {
  let state = seed;
  const values = Array.from({ length: cells * cells }, () => (state = (state * 48271) % 2147483647) / 2147483647);
  const soft = (t) => t * t * (3 - 2 * t), at = (i, j) => values[(j % cells) * cells + (i % cells)];
  return (u, v) => {
    const x = u * cells, y = v * cells, i = Math.floor(x), j = Math.floor(y), s = soft(x - i), t = soft(y - j);
    return (1 - t) * ((1 - s) * at(i, j) + s * at(i + 1, j)) + t * ((1 - s) * at(i, j + 1) + s * at(i + 1, j + 1));
  };
}

const SIDE = 512, grain = cloud(3, 8), dust = cloud(5, 64), mix = (a, b, t) => a.map((x, k) => x + t * (b[k] - x));
const wood = (x, y) => {
  const ring = 0.5 + 0.5 * Math.sin(TURN * (7 * y + 0.9 * grain(x / 2, y)));
  return mix(mix([0.42, 0.25, 0.13], [0.72, 0.5, 0.3], ring), [0.3, 0.17, 0.08], 0.3 * dust(x / 4, y));
};
const brick = (x, y) => {
  const row = Math.floor(4 * y), u = 2 * x + 0.5 * (row % 2), v = 4 * y - row, isJoint = v < 0.09 || u - Math.floor(u) < 0.045;
  return isJoint ? [0.75, 0.73, 0.7] : mix([0.6, 0.2, 0.14], [0.72, 0.32, 0.2], dust(x, y));
};
const stripes = (x, y) => {
  const band = Math.abs(((8 * x + 2 * y) % 1) - 0.5), spot = Math.hypot(((16 * x) % 1) - 0.5, ((8 * y) % 1) - 0.5) < 0.2;
  return spot ? [0.98, 0.85, 0.3] : band < 0.25 ? [0.1, 0.35, 0.6] : [0.92, 0.95, 0.97];
};
const image = (color, side = SIDE) => png(side, side, (x, y, c) => Math.min(1, Math.max(0, color((x + 0.5) / side, (y + 0.5) / side)[c])));

// In the order in which the layout draws them.
const parts = [
  {
    name: 'vase', factor: [0.25, 0.04, 0.2, 1],
    mesh: turned(48, 40, [1.1, 0, -0.3], (t) => [0.22 + 0.16 * Math.sin(5 * t + 0.4) * (1 - 0.4 * t), 1.15 * t]),
  },
  {
    name: 'ring', factor: [0.9, 0.5, 0.05, 1],
    mesh: turned(64, 24, [-0.45, 0.08, 0.6], (t) => [0.28 + 0.08 * Math.cos(TURN * t), 0.08 * Math.sin(TURN * t)]),
  },
  {
    name: 'ball', image: image(stripes),
    mesh: turned(64, 32, [0.15, 0.45, 0.35], (t) => [0.45 * Math.sin(Math.PI * t), -0.45 * Math.cos(Math.PI * t)], [1, 1]),
  },
  { name: 'brick', image: image(brick, SIDE / 2), mesh: box([-0.9, 0.4, -0.3], [0.4, 0.4, 0.4], 0.8) },
  { name: 'wood', image: image(wood), mesh: box([0, -0.1, 0], [1.7, 0.1, 1.1], 3.4) },
];

const chunks = [], bufferViews = [];
let length = 0;
const view = (bytes) => {
  const padded = Buffer.concat([bytes, Buffer.alloc((4 - (bytes.length % 4)) % 4)]);
  bufferViews.push({ buffer: 0, byteOffset: length, byteLength: bytes.length });
  chunks.push(padded);
  length += padded.length;
  return bufferViews.length - 1;
};
const json = { asset: { version: '2.0' }, accessors: [], images: [], textures: [], materials: [], meshes: [], nodes: [], scenes: [], scene: 0, bufferViews };
const accessor = (array, componentType, type, size, more = {}) => {
  json.accessors.push({ bufferView: view(Buffer.from(array.buffer)), componentType, type, count: array.length / size, ...more });
  return json.accessors.length - 1;
};
const primitives = parts.map(({ name, image: bytes, factor, mesh }, material) => {
  const of = (k, least) => mesh.positions.filter((_, i) => i % 3 === k).reduce((a, b) => (least ? Math.min(a, b) : Math.max(a, b)));
  const pbr = { metallicFactor: 0, roughnessFactor: 0.8 };
  if (bytes) {
    json.images.push({ name, mimeType: 'image/png', bufferView: view(bytes) });
    json.textures.push({ source: json.images.length - 1 });
    pbr.baseColorTexture = { index: json.textures.length - 1 };
  }
  if (factor) pbr.baseColorFactor = factor;
  json.materials.push({ name, pbrMetallicRoughness: pbr });
  return {
    attributes: {
      POSITION: accessor(new Float32Array(mesh.positions), 5126, 'VEC3', 3, { min: [0, 1, 2].map((k) => of(k, true)), max: [0, 1, 2].map((k) => of(k, false)) }),
      TEXCOORD_0: accessor(new Float32Array(mesh.uv), 5126, 'VEC2', 2),
    },
    indices: accessor(new Uint32Array(mesh.indices), 5125, 'SCALAR', 1),
    material,
  };
});
json.meshes.push({ primitives });
json.nodes.push({ mesh: 0 });
json.scenes.push({ nodes: [0] });
json.buffers = [{ byteLength: length }];
const text = Buffer.from(JSON.stringify(json)), whole = Buffer.concat([text, Buffer.alloc((4 - (text.length % 4)) % 4, ' ')]);
const words = (...values) => Buffer.from(new Uint32Array(values).buffer);
writeFileSync(join(folder, 'merge.glb'), Buffer.concat([
  words(0x46546c67, 2, 28 + whole.length + length, whole.length, 0x4e4f534a), whole, words(length, 0x004e4942), ...chunks,
]));

const knobs = cloud(11, 6);
const ball = sheet(240, 120, (x, y) => {
  const polar = Math.PI * (0.02 + 0.96 * y), radius = 1 + 0.12 * (knobs(x, y) - 0.5) + 0.02 * Math.sin(TURN * 12 * x) * Math.sin(polar) ** 2;
  return [radius * Math.sin(polar) * Math.sin(TURN * x), -radius * Math.cos(polar), radius * Math.sin(polar) * Math.cos(TURN * x)];
});
const tone = cloud(7, 9), lines = [];
for (let v = 0; v < ball.positions.length / 3; ++v) {
  const [u, w] = [ball.uv[2 * v] % 1, ball.uv[2 * v + 1]], t = tone(u, w), vein = Math.max(0, 1 - (tone(w, u) - 0.5) ** 2 / 0.004);
  const ground = mix(mix([0.1, 0.3, 0.25], [0.85, 0.55, 0.2], t), [0.5, 0.1, 0.2], Math.max(0, 2 * t - 1));
  const color = mix(ground, [0.95, 0.9, 0.75], vein);
  lines.push([...ball.positions.slice(3 * v, 3 * v + 3), ball.uv[2 * v], 1 - ball.uv[2 * v + 1], ...color.map((x) => Math.round(255 * x))].join(' '));
}
const faces = [];
for (let i = 0; i < ball.indices.length; i += 3) faces.push(`3 ${ball.indices.slice(i, i + 3).join(' ')}`);
writeFileSync(join(folder, 'bake.ply'), `ply
format ascii 1.0
element vertex ${lines.length}
${['x', 'y', 'z', 's', 't'].map((name) => `property float ${name}`).join('\n')}
${['red', 'green', 'blue'].map((name) => `property uchar ${name}`).join('\n')}
element face ${faces.length}
property list uchar int vertex_indices
end_header
${lines.join('\n')}
${faces.join('\n')}
`);
