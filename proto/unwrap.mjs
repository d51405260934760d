// Flattens a mesh of triangles from JavaScript, with @grpc/grpc-js and plain arrays: no encoder, no client library.
//
//   npm install @grpc/grpc-js @grpc/proto-loader
//   node unwrap.mjs 127.0.0.1:7741 in.obj out.obj
//
// $PLANISH_PROTO is the folder of the .proto files [the folder of this script].
import grpc from '@grpc/grpc-js';
import protoLoader from '@grpc/proto-loader';
import {randomUUID} from 'node:crypto';
import {readFileSync, writeFileSync} from 'node:fs';
import {setTimeout} from 'node:timers/promises';
import {fileURLToPath} from 'node:url';

const includeDirs = [process.env.PLANISH_PROTO ?? fileURLToPath(new URL('.', import.meta.url))];
const definition = protoLoader.loadSync('planish/v1/planish.proto', {includeDirs, enums: String, longs: Number, oneofs: true});
const {Planish} = grpc.loadPackageDefinition(definition).planish.v1;
const bytesOf = (array) => Buffer.from(array.buffer, array.byteOffset, array.byteLength);
const isLost = ({code, metadata}) => code === 14 || (code === 13 && !metadata.get('grpc-status-details-bin').length);

// Arrays travel as the bytes that they have in memory. positions: Float32Array of x, y, z, near the origin. triangles:
// Uint32Array of three vertices each. Returns {uv, report}: uv[2 * (3 * f + k)] and the number after it are (u, v) of
// corner k of triangle f.
export async function unwrap(address, positions, triangles, options = {}, onProgress = () => {}) {
  const arrays = {positions: bytesOf(positions), triangles: bytesOf(triangles)};
  // If the connection is lost, the same request is sent again. The id makes it continue the same job, also on another
  // server of the farm.
  const request = {spec: {arrays, options}, requestId: randomUUID()};
  for (let attempt = 1, last = 0, job, chunks = []; ; ++attempt, chunks = []) {
    const client = new Planish(address, grpc.credentials.createInsecure(), {'grpc.max_send_message_length': -1});
    try {
      for await (const {event, uv} of client.Unwrap(request)) {
        if (event?.progress && event.sequence > last) onProgress(event.progress);
        if (event) [last, job] = [Math.max(last, event.sequence), event.job ?? job];
        if (uv) chunks.push(uv.data);
      }
      if (job.state !== 'JOB_STATE_SUCCEEDED') throw new Error(job.error?.message ?? job.state);
      const bytes = new Uint8Array(Buffer.concat(chunks)).buffer;  // a copy of its own, so that it is aligned
      const uv = job.uv.precision === 'PRECISION_DOUBLE' ? new Float64Array(bytes) : new Float32Array(bytes);
      return {uv, report: job.report};
    } catch (error) {
      if (!isLost(error) || attempt === 60) throw error;
      await setTimeout(500);
    } finally {
      client.close();
    }
  }
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const [address, input, output] = process.argv.slice(2);
  const lines = readFileSync(input, 'utf8').split('\n').map((line) => line.trim().split(/\s+/));
  const numbers = (kind) => lines.filter(([word]) => word === kind).flatMap((words) => words.slice(1, 4).map(parseFloat));
  const vertices = numbers('v'), faces = numbers('f').map((id) => id - 1);
  // Float32 has too few digits far from the origin: the mesh is moved there before it is rounded.
  const origin = vertices.slice(0, 3);
  const near = Float32Array.from(vertices, (x, i) => x - origin[i % 3]);
  const {uv, report} = await unwrap(address, near, new Uint32Array(faces), {},
                                    ({stage}) => process.stderr.write(`\r${stage.slice('STAGE_'.length).padEnd(9)}`));
  const text = lines.filter(([word]) => word === 'v').map((words) => words.join(' '));
  for (let i = 0; i < uv.length; i += 2) text.push(`vt ${uv[i]} ${uv[i + 1]}`);
  for (let c = 0; c < faces.length; c += 3) text.push('f ' + [c, c + 1, c + 2].map((k) => `${faces[k] + 1}/${k + 1}`).join(' '));
  writeFileSync(output, text.join('\n') + '\n');
  console.log(`${report.chartTotals.charts} charts, stretch ${report.quality.stretchL2.toFixed(3)}`);
}
