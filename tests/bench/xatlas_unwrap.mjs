// node xatlas_unwrap.mjs NODE_MODULES MESH.obj MAP.obj PADDING SIZE: xatlas, from the watlas package that
// @gltf-transform/cli carries, called as `gltf-transform unwrap` calls it (default options) but with PADDING texels between
// charts, for which that command has no flag. MESH.obj has v and f lines only, so that xatlas sees which triangles are
// neighbours. Prints wall-clock and CPU seconds of xatlas alone and the size of its atlas; UV are written in its texels.
import fs from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { pathToFileURL } from "node:url";

const [modules, meshPath, out, padding, size] = process.argv.slice(2);
const require = createRequire(path.resolve(modules, "@gltf-transform/cli/package.json"));
const watlas = await import(pathToFileURL(require.resolve("watlas")));
await watlas.Initialize();

const positions = [];
const corners = [];
for (const line of fs.readFileSync(meshPath, "utf8").split("\n")) {
  const [kind, ...words] = line.split(" ");
  if (kind === "v") positions.push(...words.map(Number));
  if (kind === "f") corners.push(...words.map((word) => Number(word) - 1));
}

const start = performance.now();
const cpuStart = process.cpuUsage();
const atlas = new watlas.Atlas();
atlas.addMesh({
  vertexPositionData: new Float32Array(positions),
  vertexCount: positions.length / 3,
  vertexPositionStride: 12,
  indexData: new Uint32Array(corners),
  indexCount: corners.length,
});
atlas.generate({}, { padding: Number(padding) });
const cpu = process.cpuUsage(cpuStart);
const seconds = (performance.now() - start) / 1e3;

// It never draws more than 1,024 texels per unit of length, so that meshes of a few centimetres get an atlas of a few
// texels and far too much padding: the same charts are packed again, off the clock, until the atlas has the size wanted.
for (let tries = 0; tries < 5; ++tries) {
  const ratio = Number(size) / Math.max(atlas.width, atlas.height);
  if (Math.abs(ratio - 1) < 0.02) break;
  atlas.packCharts({ padding: Number(padding), texelsPerUnit: atlas.texelsPerUnit * ratio });
}

if (atlas.atlasCount !== 1) throw new Error(`xatlas made ${atlas.atlasCount} atlases`);
const mesh = atlas.getMesh(0);
const indices = new Uint32Array(mesh.indexCount);
mesh.getIndexArray(indices);
const lines = [];
const vertices = Array.from({ length: mesh.vertexCount }, (_, i) => mesh.getVertex(i));
for (const vertex of vertices) lines.push(`vt ${vertex.uv[0]} ${vertex.uv[1]}`);
for (let i = 0; i < indices.length; i += 3) {
  lines.push("f " + [0, 1, 2].map((k) => `${vertices[indices[i + k]].xref + 1}/${indices[i + k] + 1}`).join(" "));
}
fs.writeFileSync(out, lines.join("\n") + "\n");
console.log(
  `RESULT "map_seconds":${seconds.toFixed(6)},"map_cpu_seconds":${((cpu.user + cpu.system) / 1e6).toFixed(6)},` +
    `"tile":[${atlas.width},${atlas.height}],"xatlas_charts":${atlas.chartCount}`,
);
