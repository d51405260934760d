// Flattens a mesh of triangles from JavaScript, with @grpc/grpc-js and plain arrays: no encoder, no client library.
//
//   npm install @grpc/grpc-js @grpc/proto-loader
//   node unwrap.mjs 127.0.0.1:7741 in.obj out.obj
//
// $PLANISH_PROTO is the folder of the .proto files [../../proto from here].
import grpc from '@grpc/grpc-js';
import protoLoader from '@grpc/proto-loader';
import {readFileSync, writeFileSync} from 'node:fs';
import {fileURLToPath} from 'node:url';

const protos = process.env.PLANISH_PROTO ?? fileURLToPath(new URL('../../proto', import.meta.url));
const definition = protoLoader.loadSync('planish/v1/planish.proto', {includeDirs: [protos], enums: String, oneofs: true});
const {planish} = grpc.loadPackageDefinition(definition);

// Arrays travel as the bytes that they have in memory: float32 and uint32, little-endian.
const bytesOf = (array) => Buffer.from(array.buffer, array.byteOffset, array.byteLength);

// positions: Float32Array of x, y, z. triangles: Uint32Array of three vertices each.
// Returns {uv, report}: uv[2 * (3 * f + k)] and the number after it are (u, v) of corner k of triangle f.
export async function unwrap(address, positions, triangles, options = {}, onProgress = () => {}) {
  const client = new planish.v1.Planish(address, grpc.credentials.createInsecure(), {'grpc.max_send_message_length': -1});
  try {
    const arrays = {positions: bytesOf(positions), triangles: bytesOf(triangles)};
    const chunks = [];
    let job;
    for await (const {event, uv} of client.Unwrap({spec: {arrays, options}})) {
      if (event?.progress) onProgress(event.progress);
      if (event?.job) job = event.job;
      if (uv) chunks.push(uv.data);
    }
    if (job.state !== 'JOB_STATE_SUCCEEDED') throw new Error(job.error?.message ?? job.state);
    const bytes = new Uint8Array(Buffer.concat(chunks)).buffer;  // a copy of its own, so that it is aligned
    const uv = job.uv.precision === 'PRECISION_DOUBLE' ? new Float64Array(bytes) : new Float32Array(bytes);
    return {uv, report: job.report};
  } finally {
    client.close();
  }
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const [address, input, output] = process.argv.slice(2);
  const lines = readFileSync(input, 'utf8').split('\n').map((line) => line.trim().split(/\s+/));
  const positions = lines.filter(([word]) => word === 'v').flatMap((words) => words.slice(1, 4).map(Number));
  const triangles = lines.filter(([word]) => word === 'f').flatMap((words) => words.slice(1, 4).map((w) => parseInt(w) - 1));
  const {uv, report} = await unwrap(address, new Float32Array(positions), new Uint32Array(triangles), {},
                                    ({stage}) => process.stderr.write(`\r${stage.slice('STAGE_'.length).padEnd(9)}`));
  const text = lines.filter(([word]) => word === 'v').map((words) => words.join(' '));
  for (let i = 0; i < uv.length; i += 2) text.push(`vt ${uv[i]} ${uv[i + 1]}`);
  for (let c = 0; c < triangles.length; c += 3) {
    text.push('f ' + [0, 1, 2].map((k) => `${triangles[c + k] + 1}/${c + k + 1}`).join(' '));
  }
  writeFileSync(output, text.join('\n') + '\n');
  console.log(`${report.chartTotals.charts} charts, stretch ${report.quality.stretchL2.toFixed(3)}`);
}
