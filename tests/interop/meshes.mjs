// Meshes made in code, and their way into and out of Draco by draco3d, Draco's own JavaScript build.
import draco3d from 'draco3d';

// A mesh: {positions: [x, y, z, ...], faces: [a, b, c, ...]}.

function grid(columns, rows, at) {
  const positions = [];
  const faces = [];
  for (let j = 0; j <= rows; ++j) {
    for (let i = 0; i <= columns; ++i) positions.push(...at(i / columns, j / rows));
  }
  for (let j = 0; j < rows; ++j) {
    for (let i = 0; i < columns; ++i) {
      const a = j * (columns + 1) + i;
      const c = a + columns + 1;
      faces.push(a, a + 1, c + 1, a, c + 1, c);
    }
  }
  return {positions, faces};
}

// 150 degrees of a cylinder. It unrolls without any distortion, so what a correct server answers is known.
export function cylinderPatch() {
  return grid(24, 12, (s, t) => [Math.cos(s * 2.618), Math.sin(s * 2.618), 1.5 * t]);
}

export function bump() {
  return grid(20, 20, (s, t) => {
    const [x, y] = [2 * s - 1, 2 * t - 1];
    return [x, y, 0.6 * Math.exp(-4 * (x * x + y * y))];
  });
}

export function tetrahedron() {
  return {positions: [1, 1, 1, 1, -1, -1, -1, 1, -1, -1, -1, 1], faces: [0, 1, 2, 0, 3, 1, 0, 2, 3, 1, 3, 2]};
}

// options: {edgebreaker: false, quantizationBits: 0, normals: false}
export async function encode(mesh, options = {}) {
  const draco = await draco3d.createEncoderModule({});
  const encoder = new draco.Encoder();
  const builder = new draco.MeshBuilder();
  const target = new draco.Mesh();
  const points = mesh.positions.length / 3;
  builder.AddFacesToMesh(target, mesh.faces.length / 3, new Uint32Array(mesh.faces));
  builder.AddFloatAttributeToMesh(target, draco.POSITION, points, 3, new Float32Array(mesh.positions));
  if (options.normals) {
    const normals = new Float32Array(3 * points).fill(0.577);
    builder.AddFloatAttributeToMesh(target, draco.NORMAL, points, 3, normals);
  }
  encoder.SetEncodingMethod(options.edgebreaker ? draco.MESH_EDGEBREAKER_ENCODING : draco.MESH_SEQUENTIAL_ENCODING);
  if (options.quantizationBits) encoder.SetAttributeQuantization(draco.POSITION, options.quantizationBits);
  const array = new draco.DracoInt8Array();
  const size = encoder.EncodeMeshToDracoBuffer(target, array);
  const bytes = Buffer.alloc(size);
  for (let i = 0; i < size; ++i) bytes.writeInt8(array.GetValue(i), i);
  for (const object of [array, target, builder, encoder]) draco.destroy(object);
  if (size === 0) throw new Error('draco3d could not encode the mesh');
  return bytes;
}

// Faces and corners in the order of the decoded bytes, which is the order of the UV that the server sends.
export async function decode(bytes) {
  const draco = await draco3d.createDecoderModule({});
  const decoder = new draco.Decoder();
  const mesh = new draco.Mesh();
  const status = decoder.DecodeArrayToMesh(new Int8Array(bytes), bytes.length, mesh);
  if (!status.ok()) throw new Error(`draco3d could not decode its own bytes: ${status.error_msg()}`);
  const faces = [];
  const corners = new draco.DracoInt32Array();
  for (let f = 0; f < mesh.num_faces(); ++f) {
    decoder.GetFaceFromMesh(mesh, f, corners);
    faces.push(corners.GetValue(0), corners.GetValue(1), corners.GetValue(2));
  }
  const values = new draco.DracoFloat32Array();
  decoder.GetAttributeFloatForAllPoints(mesh, decoder.GetAttribute(mesh, decoder.GetAttributeId(mesh, draco.POSITION)),
                                        values);
  const positions = Array.from({length: values.size()}, (_, i) => values.GetValue(i));
  for (const object of [values, corners, mesh, decoder]) draco.destroy(object);
  return {positions, faces};
}
