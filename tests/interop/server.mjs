// Starts and stops a planishd, and speaks to it with @grpc/grpc-js and the published proto files.
import grpc from '@grpc/grpc-js';
import protoLoader from '@grpc/proto-loader';
import protobuf from 'protobufjs';
import {spawn} from 'node:child_process';
import {once} from 'node:events';
import {createServer} from 'node:net';
import path from 'node:path';

const PROTO = process.env.PLANISH_PROTO;  // the folder proto/
const DEADLINE_MS = 30_000;

const definition = protoLoader.loadSync(['planish/v1/planish.proto', 'health.proto'], {
  includeDirs: [PROTO, import.meta.dirname ?? path.dirname(new URL(import.meta.url).pathname)],
  keepCase: true, longs: Number, enums: String, defaults: true, oneofs: true,
});
const api = grpc.loadPackageDefinition(definition);
const rpcTypes = protobuf.loadSync(['google/rpc/status.proto', 'google/rpc/error_details.proto']
  .map((file) => path.join(PROTO, file)));

export async function freePort() {
  const probe = createServer().listen(0, '127.0.0.1');
  await once(probe, 'listening');
  const {port} = probe.address();
  probe.close();
  await once(probe, 'close');
  return port;
}

// `listen` as planishd takes it: unix:/path or 127.0.0.1:port.
export async function startServer(listen, flags = ['--workers=2']) {
  // planishd ends when the other end of its supervisor descriptor closes: it cannot outlive this test.
  const child = spawn(process.env.PLANISHD, [`--listen=${listen}`, ...flags, '--supervisor-fd=3'],
                      {stdio: ['ignore', 'inherit', 'inherit', 'pipe']});
  const exited = once(child, 'exit');
  exited.catch(() => {});
  const options = {'grpc.initial_reconnect_backoff_ms': 20, 'grpc.max_reconnect_backoff_ms': 100};
  const client = new api.planish.v1.Planish(listen, grpc.credentials.createInsecure(), options);
  const health = new api.grpc.health.v1.Health(listen, grpc.credentials.createInsecure(), options);
  await Promise.race([
    new Promise((resolve, reject) =>
      client.waitForReady(Date.now() + DEADLINE_MS, (error) => (error ? reject(error) : resolve()))),
    exited.then(([code, signal]) => {
      throw new Error(`planishd ended before it listened: code ${code}, signal ${signal}`);
    }),
  ]);
  return {
    client,
    health,
    // Asks the server to end and returns its exit code.
    async stop() {
      client.close();
      health.close();
      child.kill('SIGTERM');
      const [code, signal] = await exited;
      return signal ?? code;
    },
  };
}

// One answer for one request.
export function call(client, method, request) {
  return new Promise((resolve, reject) =>
    client[method](request, {deadline: Date.now() + DEADLINE_MS},
                   (error, response) => (error ? reject(error) : resolve(response))));
}

// All messages of a stream, in order.
export async function collect(client, method, request) {
  const messages = [];
  for await (const message of client[method](request, {deadline: Date.now() + DEADLINE_MS})) messages.push(message);
  return messages;
}

// The google.rpc.ErrorInfo among the details of a google.rpc.Status.
function errorInfo(details) {
  const any = details.find(({type_url}) => type_url === 'type.googleapis.com/google.rpc.ErrorInfo');
  return any && rpcTypes.lookupType('google.rpc.ErrorInfo').decode(any.value);
}

// Of a job that failed.
export const errorInfoOfJob = (job) => errorInfo(job.error.details);

function detailsOfCall(error) {
  const [bytes] = error.metadata.get('grpc-status-details-bin');
  if (!bytes) return [];
  const status = rpcTypes.lookupType('google.rpc.Status').decode(bytes);
  return status.details.map((any) => ({type_url: any.type_url ?? any.typeUrl, value: any.value}));
}

// Of a call that failed.
export const errorInfoOfCall = (error) => errorInfo(detailsOfCall(error));

// The fields that the google.rpc.BadRequest of a call that failed names.
export function fieldsOfCall(error) {
  const any = detailsOfCall(error).find(({type_url}) => type_url === 'type.googleapis.com/google.rpc.BadRequest');
  if (!any) return [];
  return rpcTypes.lookupType('google.rpc.BadRequest').decode(any.value).fieldViolations.map(({field}) => field);
}
