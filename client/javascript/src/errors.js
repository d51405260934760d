// The errors of calls and jobs, made from the answers of a server or of the connection to it.
import {definition} from './protocol.js';

const CODES = ['OK', 'CANCELLED', 'UNKNOWN', 'INVALID_ARGUMENT', 'DEADLINE_EXCEEDED', 'NOT_FOUND', 'ALREADY_EXISTS', 'PERMISSION_DENIED',
               'RESOURCE_EXHAUSTED', 'FAILED_PRECONDITION', 'ABORTED', 'OUT_OF_RANGE', 'UNIMPLEMENTED', 'INTERNAL', 'UNAVAILABLE', 'DATA_LOSS',
               'UNAUTHENTICATED'];

export class PlanishError extends Error {
  constructor(message, {code = 'UNKNOWN', reason = '', metadata = {}, job = '', retryAfterSeconds = 0} = {}) {
    super(message);
    this.name = 'PlanishError';
    this.code = code;
    this.reason = reason || code;
    this.metadata = metadata;
    this.job = job;
    this.retryAfterSeconds = retryAfterSeconds;
  }
  get faces() { return this.#ids('face', 'faces'); }
  get vertices() { return this.#ids('vertex', 'vertices'); }
  get edges() {
    const text = [this.metadata.edge, this.metadata.edges].join(',');
    return [...text.matchAll(/(\d+)-(\d+)/g)].map(([, a, b]) => [Number(a), Number(b)]);
  }
  #ids(...keys) {
    return keys.flatMap((key) => (this.metadata[key] ?? '').match(/\d+/g) ?? []).map(Number);
  }
}

// The error of a google.rpc.Status.
export function errorOfStatus({code, message, details}, job = '') {
  const found = {code: CODES[code] ?? 'UNKNOWN', job};
  for (const {type_url, typeUrl, value} of details) {
    const kind = (type_url ?? typeUrl).split('/').pop();
    if (kind === 'google.rpc.ErrorInfo') {
      const {reason, metadata} = definition[kind].deserialize(value);
      Object.assign(found, {reason, metadata});
    } else if (kind === 'google.rpc.RetryInfo') {
      const {seconds, nanos} = definition[kind].deserialize(value).retryDelay ?? {seconds: 0, nanos: 0};
      found.retryAfterSeconds = seconds + 1e-9 * nanos;
    }
  }
  return new PlanishError(message, found);
}

// The error of a job that ended without UV.
export function errorOfJob(job) {
  if (job.error) return errorOfStatus(job.error, job.name);
  const cancelled = job.state === 'JOB_STATE_CANCELLED';
  return new PlanishError(cancelled ? 'the job was cancelled' : `the job ended as ${job.state} without UV`,
                          {code: cancelled ? 'CANCELLED' : 'INTERNAL', job: job.name});
}

// The error of a call; `error` is that of grpc-js.
export function errorOfCall(error, target) {
  const [bytes] = error.metadata?.get('grpc-status-details-bin') ?? [];
  if (bytes) {
    const status = definition['google.rpc.Status'].deserialize(bytes);
    if (status.details.length > 0) return errorOfStatus(status);
  }
  const code = CODES[error.code] ?? 'UNKNOWN';
  const said = error.details ?? error.message;
  if (code === 'UNAVAILABLE') {
    const reason = /certificate|SSL|TLS|wrong version number|altnames/i.test(said) ? 'TLS_FAILED' : 'SERVER_UNREACHABLE';
    return new PlanishError(`cannot reach the planish server at ${target}: ${said}`, {code, reason});
  }
  return new PlanishError(said, {code});
}

// Whether the connection broke or the server is unavailable. UPLOAD_BUSY counts too: the server has not noticed yet
// that the call which wrote the upload broke. False for other errors that the server returned.
export function isBroken(error) {
  return error.code === 'UNAVAILABLE' || error.reason === 'UPLOAD_BUSY' ||
         (error.reason === error.code && (error.code === 'INTERNAL' || error.code === 'UNKNOWN' || error.code === 'CANCELLED'));
}

export function invalid(message, reason = 'OPTIONS_INVALID', metadata = {}) {
  return new PlanishError(message, {code: 'INVALID_ARGUMENT', reason, metadata});
}
