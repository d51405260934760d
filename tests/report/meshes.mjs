// Small meshes that show what a page must show.

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
