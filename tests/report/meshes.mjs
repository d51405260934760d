// Small meshes that show what a page must show.
import { deflateSync } from 'node:zlib';

const squares = [[0, 0], [1, 0], [1, 1], [0, 1]];

// Three squares in a row with a material each: red, green and blue. As data URI; with UV side by side.
export function threeMaterials() {
  const positions = [], uv = [];
  for (let i = 0; i < 3; ++i) {
    for (const [x, y] of squares) {
      positions.push(1.2 * i + x, y, 0.3 * i);
      uv.push(0.02 + 0.33 * i + 0.28 * x, 0.1 + 0.28 * y);
    }
  }
  const indices = [0, 1, 2].map((i) => [0, 1, 2, 0, 2, 3].map((v) => 4 * i + v));
  const buffer = Buffer.concat([
    Buffer.from(new Float32Array(positions).buffer),
    Buffer.from(new Float32Array(uv).buffer),
    Buffer.from(new Uint32Array(indices.flat()).buffer),
  ]);
  const uvAt = 4 * positions.length, indicesAt = uvAt + 4 * uv.length;
  const colors = [[0.8, 0.05, 0.05, 1], [0.05, 0.6, 0.05, 1], [0.05, 0.1, 0.9, 1]];
  return {
    positions,
    uv, // v downwards, as glTF has it
    json: JSON.stringify({
      asset: { version: '2.0' },
      buffers: [{ byteLength: buffer.length, uri: `data:application/octet-stream;base64,${buffer.toString('base64')}` }],
      bufferViews: [{ buffer: 0, byteLength: buffer.length }],
      accessors: [
        { bufferView: 0, componentType: 5126, count: 12, type: 'VEC3', min: [0, 0, 0], max: [3.4, 1, 0.6] },
        { bufferView: 0, byteOffset: uvAt, componentType: 5126, count: 12, type: 'VEC2' },
        ...[0, 1, 2].map((i) => ({
          bufferView: 0, byteOffset: indicesAt + 24 * i, componentType: 5125, count: 6, type: 'SCALAR',
        })),
      ],
      materials: colors.map((color, i) => ({
        name: ['red', 'green', 'blue'][i], pbrMetallicRoughness: { baseColorFactor: color },
      })),
      meshes: [{
        primitives: [0, 1, 2].map((i) => ({
          attributes: { POSITION: 0, TEXCOORD_0: 1 }, indices: 2 + i, material: i,
        })),
      }],
      nodes: [{ mesh: 0 }],
      scenes: [{ nodes: [0] }],
      scene: 0,
    }),
  };
}

// Two squares that overlap in the map, the second one mirrored; and one whose corner is folded over.
export function spoiled() {
  return `v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 3 0 0\nv 3 1 0\nv 2 1 0\nv 4 0 0\nv 5 0 0\nv 5 1 0\nv 4 1 0
vt .1 .1\nvt .4 .1\nvt .4 .4\nvt .1 .4\nvt .6 .3\nvt .3 .3\nvt .3 .6\nvt .6 .6\nvt .6 .6\nvt .72 .85\nvt .9 .9\nvt .6 .9
f 1/1 2/2 3/3\nf 1/1 3/3 4/4\nf 5/5 6/6 7/7\nf 5/5 7/7 8/8\nf 9/9 10/10 11/11\nf 9/9 11/11 12/12\n`;
}

function crcOf(bytes) {
  let crc = ~0;
  for (const byte of bytes) {
    crc ^= byte;
    for (let k = 0; k < 8; ++k) crc = (crc >>> 1) ^ (0xedb88320 & -(crc & 1));
  }
  return ~crc >>> 0;
}

// An RGB image of 8 bits; value(x, y, channel) from 0 to 1.
export function png(width, height, value) {
  const chunk = (type, data) => {
    const whole = Buffer.alloc(12 + data.length);
    whole.writeUInt32BE(data.length, 0);
    whole.write(type, 4, 'latin1');
    data.copy(whole, 8);
    whole.writeUInt32BE(crcOf(whole.subarray(4, 8 + data.length)), 8 + data.length);
    return whole;
  };
  const header = Buffer.alloc(13);
  header.writeUInt32BE(width, 0);
  header.writeUInt32BE(height, 4);
  header.set([8, 2], 8);
  const rows = Buffer.alloc(height * (3 * width + 1));
  for (let y = 0; y < height; ++y) {
    for (let i = 0; i < 3 * width; ++i) {
      rows[y * (3 * width + 1) + 1 + i] = Math.round(255 * value(Math.floor(i / 3), y, i % 3));
    }
  }
  const signature = Buffer.from([137, 80, 78, 71, 13, 10, 26, 10]);
  return Buffer.concat([signature, chunk('IHDR', header), chunk('IDAT', deflateSync(rows)), chunk('IEND', Buffer.alloc(0))]);
}

// A torus of n x 2 n squares, with an image that is mirrored along its length and turned by KHR_texture_transform; and a
// square above it that has no image. `image`: a PNG; `normals`: one more, of a normal map that is read in the same way.
export function texturedTorus(n, image, normals) {
  const positions = [], uv = [], indices = [];
  for (let j = 0; j <= n; ++j) {
    for (let i = 0; i <= 2 * n; ++i) {
      const a = (Math.PI * i) / n, b = (-2 * Math.PI * j) / n;
      // Both sides of a seam come to the same place.
      const place = [(1 + 0.4 * Math.cos(b)) * Math.cos(a), (1 + 0.4 * Math.cos(b)) * Math.sin(a), 0.4 * Math.sin(b)];
      positions.push(...place.map((x) => Math.round(4096 * x) / 4096));
      uv.push(j / n, i / n); // the transformation swaps them
      if (i < 2 * n && j < n) {
        const v = j * (2 * n + 1) + i, w = v + 2 * n + 1;
        indices.push(v, w + 1, v + 1, v, w, w + 1);
      }
    }
  }
  const torus = indices.length, first = positions.length / 3;
  for (const [x, y] of squares) {
    positions.push(x - 0.5, y - 0.5, 0.7);
    uv.push(x, y);
  }
  indices.push(...[0, 1, 2, 0, 2, 3].map((v) => first + v));
  const parts = [
    Buffer.from(new Float32Array(positions).buffer), Buffer.from(new Float32Array(uv).buffer),
    Buffer.from(new Uint32Array(indices).buffer), image, ...(normals ? [normals] : []),
  ];
  // u' = 2 v, v' = 1 - u.
  const extensions = { KHR_texture_transform: { rotation: Math.PI / 2, offset: [0, 1], scale: [1, 2] } };
  let at = 0;
  const bufferViews = parts.map((part) => {
    const view = { buffer: 0, byteOffset: at, byteLength: part.length };
    at += part.length;
    return view;
  });
  const buffer = Buffer.concat(parts), count = positions.length / 3;
  return JSON.stringify({
    asset: { version: '2.0' },
    extensionsUsed: ['KHR_texture_transform'],
    buffers: [{ byteLength: buffer.length, uri: `data:application/octet-stream;base64,${buffer.toString('base64')}` }],
    bufferViews,
    accessors: [
      { bufferView: 0, componentType: 5126, count, type: 'VEC3', min: [-1.4, -1.4, -0.4], max: [1.4, 1.4, 0.7] },
      { bufferView: 1, componentType: 5126, count, type: 'VEC2' },
      { bufferView: 2, componentType: 5125, count: torus, type: 'SCALAR' },
      { bufferView: 2, byteOffset: 4 * torus, componentType: 5125, count: 6, type: 'SCALAR' },
    ],
    images: parts.slice(3).map((_, i) => ({ name: ['skin', 'bumps'][i], bufferView: 3 + i, mimeType: 'image/png' })),
    samplers: [{ wrapS: 33648 }],
    textures: parts.slice(3).map((_, i) => ({ source: i, sampler: 0 })),
    materials: [
      {
        name: 'skin',
        pbrMetallicRoughness: { baseColorTexture: { index: 0, extensions }, baseColorFactor: [1, 0.9, 0.8, 1] },
        ...(normals && { normalTexture: { index: 1, extensions, scale: 0.8 } }),
      },
      { name: 'plain', pbrMetallicRoughness: { baseColorFactor: [0.05, 0.1, 0.9, 1] } },
    ],
    meshes: [{
      primitives: [0, 1].map((i) => ({ attributes: { POSITION: 0, TEXCOORD_0: 1 }, indices: 2 + i, material: i })),
    }],
    nodes: [{ mesh: 0 }],
    scenes: [{ nodes: [0] }],
    scene: 0,
  });
}

// Two squares side by side in the plane z = 0, each with a dome in the middle that only the normal map shows. The second
// one has mirrored UV. As data URI.
export function domes() {
  const positions = [], uv = [];
  for (const at of [0, 1.2]) {
    for (const [x, y] of squares) {
      positions.push(at + x, y, 0);
      uv.push(at === 0 ? x : 1 - x, 1 - y);
    }
  }
  const side = 128, indices = [0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7];
  const image = png(side, side, (x, y, c) => {
    const n = [(x + 0.5) / side - 0.5, 0.5 - (y + 0.5) / side, 0].map((d) => d / 0.35);
    const r = Math.hypot(...n);
    if (r > 0.9) return c === 2 ? 1 : 0.5;
    n[2] = Math.sqrt(1 - r * r);
    return 0.5 + 0.5 * n[c];
  });
  const buffer = Buffer.concat([
    Buffer.from(new Float32Array(positions).buffer), Buffer.from(new Float32Array(uv).buffer),
    Buffer.from(new Uint32Array(indices).buffer), image,
  ]);
  const uvAt = 4 * positions.length, indicesAt = uvAt + 4 * uv.length, imageAt = indicesAt + 4 * indices.length;
  return JSON.stringify({
    asset: { version: '2.0' },
    buffers: [{ byteLength: buffer.length, uri: `data:application/octet-stream;base64,${buffer.toString('base64')}` }],
    bufferViews: [
      { buffer: 0, byteLength: imageAt }, { buffer: 0, byteOffset: imageAt, byteLength: image.length },
    ],
    accessors: [
      { bufferView: 0, componentType: 5126, count: 8, type: 'VEC3', min: [0, 0, 0], max: [2.2, 1, 0] },
      { bufferView: 0, byteOffset: uvAt, componentType: 5126, count: 8, type: 'VEC2' },
      { bufferView: 0, byteOffset: indicesAt, componentType: 5125, count: 12, type: 'SCALAR' },
    ],
    images: [{ name: 'domes', bufferView: 1, mimeType: 'image/png' }],
    textures: [{ source: 0 }],
    materials: [{ pbrMetallicRoughness: { baseColorFactor: [0.4, 0.4, 0.4, 1] }, normalTexture: { index: 0 } }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0, TEXCOORD_0: 1 }, indices: 2, material: 0 }] }],
    nodes: [{ mesh: 0 }],
    scenes: [{ nodes: [0] }],
    scene: 0,
  });
}
