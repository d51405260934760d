// Flattens a mesh that takes minutes through an address, and writes a line for each report of progress.
//   slow_unwrap.mjs ADDRESS
import {unwrap} from './unwrap.mjs';

const n = 150;
const positions = [], triangles = [];
for (let i = 0; i <= n; ++i) for (let j = 0; j <= n; ++j) positions.push(i, j, 3 * Math.sin(i / 9) * Math.cos(j / 7));
for (let i = 0; i < n; ++i) {
  for (let j = 0; j < n; ++j) {
    const a = i * (n + 1) + j, b = a + n + 1;
    triangles.push(a, b, a + 1, b, b + 1, a + 1);
  }
}
const options = {seams: 'SEAMS_NONE', solver: 'SOLVER_MINRES', system: 'SYSTEM_FULL', preconditioner: 'PRECONDITIONER_NONE'};
const {uv} = await unwrap(process.argv[2], new Float32Array(positions), new Uint32Array(triangles), options,
                          () => console.log('progress'));
console.log(`uv of ${uv.length / 6} triangles`);
