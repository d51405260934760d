// Calls to one server. Most are repeated until they get through; unwraps follow a job from its first event to the last
// byte of its UV, over several streams if the connection breaks.
import {createHash, randomBytes, randomUUID} from 'node:crypto';
import {setTimeout as sleep} from 'node:timers/promises';

import {Connection} from './connection.js';
import {PlanishError, errorOfCall, errorOfJob, errorOfStatus, invalid, isBroken} from './errors.js';
import {packMesh, splitVertices} from './mesh.js';
import {defaultServer, revive} from './private_server.js';
import {Planish, duration, enumValue, enumWords, optionFields, plain} from './protocol.js';

const UNARY_SECONDS = 20, LONGEST_WAIT_SECONDS = 15;
const SMALL_MESH_BYTES = 1 << 20;  // up to this size meshes are sent without asking for the server's limits
const MOST_IN_BATCH = 100, MOST_BATCH_BYTES = 4 << 20;
const MOST_LOST_JOBS = 3;
const PRIVATE_PATIENCE_SECONDS = 5;  // a lost private server is restarted at once, or not at all
const MESH_FIELDS = ['seamEdges', 'seamCorners', 'parts', 'uncutCorners', 'facePolygon', 'faceAtlas', 'faceWeights'];
const TERMINAL = ['SUCCEEDED', 'FAILED', 'CANCELLED', 'EXPIRED'].map((state) => `JOB_STATE_${state}`);
const RETRY = {reattachSeconds: 60, backoffSeconds: 0.1, queueFullWaitSeconds: 60, retrySeconds: 10};

function newTraceparent() {
  const [, id, flags] = /^(?!ff)[0-9a-f]{2}-(?!0{32})([0-9a-f]{32})-(?!0{16})[0-9a-f]{16}-([0-9a-f]{2})$/.exec(process.env.TRACEPARENT ?? '') ?? [];
  return `00-${id ?? randomBytes(16).toString('hex')}-${randomBytes(8).toString('hex')}-${flags ?? '01'}`;
}

// Returns the JobSpec without its mesh, the packed mesh, and the request id. `options`: UnwrapOptions, MeshElements and
// JobOptions (index.d.ts) in one object.
function newJob(positions, indices, options = {}) {
  const {labels = {}, priority, timeoutSeconds, computeBudgetSeconds, fresh, requestId, pack, ...more} = options;
  const ofMesh = Object.fromEntries(MESH_FIELDS.map((name) => [name, more[name]]));
  MESH_FIELDS.forEach((name) => delete more[name]);
  const message = {};
  for (const [name, value] of Object.entries(more)) {
    if (value === undefined || value === null) continue;
    const field = optionFields.get(name);
    if (!field) throw invalid(`there is no option ${name}; there are ${['pack', ...optionFields.keys(), ...MESH_FIELDS].join(', ')}`);
    message[name] = field.type === 'TYPE_ENUM' ? word(name, field.typeName.split('.').pop(), value) : value;
    if (field.type !== 'TYPE_ENUM' && typeof value !== 'number') throw invalid(`${name} is ${value}, which is no number`);
  }
  if (pack !== undefined) message.pack = pack ? 'PACK_ON' : 'PACK_OFF';
  const scheduling = {fresh: Boolean(fresh)};
  if (priority !== undefined) scheduling.priority = word('priority', 'Priority', priority);
  if (timeoutSeconds !== undefined) scheduling.timeout = duration(timeoutSeconds);
  if (computeBudgetSeconds !== undefined) scheduling.computeBudget = duration(computeBudgetSeconds);
  const mesh = positions === undefined ? undefined : packMesh({positions, indices, ...ofMesh});
  return {spec: {elements: mesh?.elements, options: message, scheduling, labels}, mesh, requestId: requestId ?? randomUUID()};
}

function word(name, type, value) {
  const found = enumValue(type, value);
  if (found === undefined) throw invalid(`${name} is ${value}; it must be one of ${enumWords(type).join(', ')}`, 'OPTIONS_INVALID', {field: name});
  return found;
}

// Decides how long one call waits before each of its attempts. It waits at most `lostSeconds` for a lost server, and
// `roomSeconds` for a full one.
class Patience {
  constructor(client, lostSeconds, roomSeconds) {
    Object.assign(this, {client, lostSeconds, roomSeconds, attempts: 0, lostSince: undefined, waited: 0, hasRevived: false});
  }
  succeeded() {
    this.attempts = 0;
    this.lostSince = undefined;
  }
  // Waits before the next attempt and returns the seconds. Throws `error`, or an error that replaces it, if there
  // should be no further attempt.
  async pause(error, signal) {
    const {client} = this;
    let seconds;
    if (isBroken(error) && await revive(client.target, this.hasRevived)) {
      this.hasRevived = true;
      client._disconnect();
      return 0;
    }
    if (error.code === 'RESOURCE_EXHAUSTED' && (error.retryAfterSeconds > 0 || error.reason === 'QUEUE_FULL')) {
      seconds = Math.max(0.05, error.retryAfterSeconds);
      this.waited += seconds;
      if (this.waited > this.roomSeconds) throw error;
    } else if (isBroken(error) && client._reached) {
      seconds = Math.max(Math.min(5, client._retry.backoffSeconds * 2 ** Math.min(30, this.attempts++)) * (0.5 + 0.5 * Math.random()), error.retryAfterSeconds);
      const now = performance.now() / 1000;
      this.lostSince ??= now;
      if (now - this.lostSince + seconds > this.lostSeconds) {
        if (this.lostSeconds <= 0) throw error;
        throw new PlanishError(`lost the planish server at ${client.target} and could not reach it again within ${this.lostSeconds} s: ${error.message}`,
                               {code: 'UNAVAILABLE', reason: 'CONNECTION_LOST'});
      }
    } else {
      throw error;
    }
    await sleep(1000 * seconds, undefined, {signal});
    return seconds;
  }
}

export class Client {
  // `target`: "host:port" or "unix:/path"; undefined: $PLANISH_SERVER, else a private server of this process.
  constructor(target, {retry = {}, ...connection} = {}) {
    const named = target ?? process.env.PLANISH_SERVER;
    this._options = connection;
    this._retry = {...RETRY, ...retry};
    this._reached = false;
    this._isClosed = false;
    if (named) this._connectTo(new Connection(named, connection));
  }

  // "host:port" or "unix:/path"; undefined before the first call of a client with a private server.
  get target() {
    return this._connection?.target;
  }

  _connectTo(connection) {
    this._connection = connection;
  }

  async _stub() {
    if (this._isClosed) throw new PlanishError('the client is closed', {code: 'CANCELLED'});
    if (!this._connection) {
      const {target} = await defaultServer();
      for (const name of ['reattachSeconds', 'retrySeconds']) this._retry[name] = Math.min(this._retry[name], PRIVATE_PATIENCE_SECONDS);
      this._connectTo(new Connection(target, {tls: false, tlsCaFile: '', tlsCertFile: '', tlsKeyFile: '', tlsServerName: '', token: ''}));
    }
    return this._open ??= new Planish(this.target, this._connection.credentials, this._connection.channelOptions);
  }

  _disconnect() {
    this._open?.close();
    this._open = undefined;
  }

  // Ends the connection, and the running calls with it.
  close() {
    this._isClosed = true;
    this._disconnect();
  }

  _error(error) {
    if (error instanceof PlanishError) return error;
    const own = errorOfCall(error, this.target);
    this._reached ||= !['SERVER_UNREACHABLE', 'TLS_FAILED'].includes(own.reason);
    return own;
  }

  async _once(method, request, seconds = UNARY_SECONDS) {
    const stub = await this._stub();
    const options = seconds ? {deadline: Date.now() + 1000 * seconds} : {};
    const metadata = this._connection.metadata(newTraceparent());
    return new Promise((resolve, reject) => {
      const take = (error, answer) => {
        if (error) return reject(this._error(error));
        this._reached = true;
        resolve(answer);
      };
      if (Planish.service[method].requestStream) stub[method](metadata, options, take).end(request);
      else stub[method](request, metadata, options, take);
    });
  }

  async _repeated(method, request, {seconds, patience, signal} = {}) {
    patience ??= new Patience(this, this._retry.retrySeconds, this._retry.retrySeconds);
    for (;;) {
      signal?.throwIfAborted();
      try {
        return await this._once(method, request, seconds);
      } catch (error) {
        await patience.pause(error, signal);
      }
    }
  }

  _patienceForNewJob() {
    return new Patience(this, this._retry.reattachSeconds, this._retry.queueFullWaitSeconds);
  }

  // Puts the mesh into the spec. A mesh that should not be sent in one message is uploaded instead, and the spec names
  // the upload.
  async _placeMesh(spec, mesh, signal) {
    spec.arrays = mesh.arrays;
    if (mesh.byteCount <= SMALL_MESH_BYTES) return;
    const server = await this._repeated('GetCapabilities', {}, {signal});
    if (server.maxMeshBytes > 0 && mesh.byteCount > server.maxMeshBytes) {
      throw new PlanishError(`the mesh has ${mesh.byteCount} bytes as sent; this server takes at most ${server.maxMeshBytes}`,
                             {code: 'RESOURCE_EXHAUSTED', reason: 'MESH_TOO_LARGE', metadata: {bytes: String(mesh.byteCount), limit: String(server.maxMeshBytes)}});
    }
    const isSmall = !(server.inlineMeshBytes > 0 && mesh.byteCount > server.inlineMeshBytes);
    if (this._connection.isUnix || isSmall || mesh.vertexCount > mesh.indices.length) return;  // a Draco file cannot have more vertices than corners
    const data = mesh.draco;
    const begin = {totalBytes: data.length, sha256: createHash('sha256').update(data).digest(), requestId: randomUUID()};
    try {
      let upload = await this._repeated('CreateUpload', begin, {signal, patience: this._patienceForNewJob()});
      while (upload.committedBytes < data.length) {
        const offset = upload.committedBytes;
        const piece = {name: upload.name, offset, data: data.subarray(offset, offset + server.uploadChunkBytes)};
        upload = await this._repeated('WriteUpload', piece, {seconds: 0, signal, patience: this._patienceForNewJob()});
        if (upload.committedBytes <= offset) throw new PlanishError(`the server took no byte of ${upload.name} from byte ${offset} on`, {code: 'INTERNAL'});
      }
      delete spec.arrays;
      spec.upload = upload.name;
    } catch (error) {
      if (error.code !== 'NOT_FOUND') throw error;  // a restarted server has forgotten the upload: sends the mesh in one message
    }
  }

  // Flattens a mesh and waits for the UV.
  async unwrap(positions, indices, options, {onProgress, onEvent, onRetry, signal, detached = false} = {}) {
    signal?.throwIfAborted();
    const {spec, mesh, requestId} = newJob(positions, indices, options);
    await this._placeMesh(spec, mesh, signal);
    return new Follower(this, {unwrap: {spec, requestId, detached}, mesh, onProgress, onEvent, onRetry, signal}).result();
  }

  // Follows a job until it ends and returns its UV. If a mesh is given, it must be the job's.
  async attach(job, positions, indices, {onProgress, onEvent, onRetry, signal} = {}) {
    const mesh = positions === undefined ? undefined : packMesh({positions, indices});
    return new Follower(this, {watch: job, mesh, onProgress, onEvent, onRetry, signal}).result();
  }

  // Follows a job until it ends, in any state, and returns it.
  async watchJob(job, {onProgress, onEvent, onRetry, signal, afterSequence = 0} = {}) {
    const follower = new Follower(this, {watch: job, wantsUv: false, afterSequence, onProgress, onEvent, onRetry, signal});
    await follower.run();
    return plainJob(follower.job);
  }

  // Queues a job and returns it once the server has accepted it.
  async createJob(positions, indices, options, {signal} = {}) {
    const {spec, mesh, requestId} = newJob(positions, indices, options);
    await this._placeMesh(spec, mesh, signal);
    return plainJob(await this._repeated('CreateJob', {spec, requestId}, {seconds: 0, signal, patience: this._patienceForNewJob()}));
  }

  // Queues several jobs with few calls. Returns for each the job, or the error with which it was refused.
  async createJobs(jobs, {signal} = {}) {
    const created = new Array(jobs.length);
    let batch = [], bytes = 0;
    const send = async () => {
      if (batch.length === 0) return;
      const {results} = await this._repeated('BatchCreateJobs', {requests: batch.map(({request}) => request)}, {seconds: 0, signal});
      if (results.length !== batch.length) throw new PlanishError(`the server answered to ${results.length} of ${batch.length} jobs`, {code: 'INTERNAL'});
      results.forEach((result, i) => { created[batch[i].place] = result.job ? plainJob(result.job) : errorOfStatus(result.error); });
      batch = [];
      bytes = 0;
    };
    for (const [place, {positions, indices, ...options}] of jobs.entries()) {
      try {
        const {spec, mesh, requestId} = newJob(positions, indices, options);
        if (mesh.byteCount > MOST_BATCH_BYTES) {
          created[place] = await this.createJob(positions, indices, {...options, requestId}, {signal});
          continue;
        }
        if (batch.length === MOST_IN_BATCH || bytes + mesh.byteCount > MOST_BATCH_BYTES) await send();
        spec.arrays = mesh.arrays;
        batch.push({place, request: {spec, requestId}});
        bytes += mesh.byteCount;
      } catch (error) {
        if (!(error instanceof PlanishError) || error.code === 'UNAVAILABLE') throw error;
        created[place] = error;
      }
    }
    await send();
    return created;
  }

  async getJob(name) {
    return plainJob(await this._repeated('GetJob', {name}));
  }
  // Waits until the job has ended, at most `seconds`, and returns it.
  async waitJob(name, seconds = Infinity) {
    const end = performance.now() + 1000 * seconds;
    for (;;) {
      const left = Math.min(LONGEST_WAIT_SECONDS, Math.max(0.001, (end - performance.now()) / 1000));
      const job = await this._repeated('WaitJob', {name, timeout: duration(left)}, {seconds: left + UNARY_SECONDS});
      if (TERMINAL.includes(job.state) || left < LONGEST_WAIT_SECONDS) return plainJob(job);
    }
  }
  // The jobs, newest first, at most `limit` (0: all), without reports.
  async listJobs({limit = 50, filter = ''} = {}) {
    const jobs = [];
    for (let pageToken = ''; ;) {
      const page = await this._repeated('ListJobs', {filter, pageToken, pageSize: limit > 0 ? Math.min(1000, limit - jobs.length) : 1000});
      jobs.push(...page.jobs.map(plainJob));
      pageToken = page.nextPageToken;
      if (!pageToken || (limit > 0 && jobs.length >= limit)) return limit > 0 ? jobs.slice(0, limit) : jobs;
    }
  }
  // Asks a job to end soon with the best valid map so far.
  async stopJob(name) {
    return plainJob(await this._repeated('StopJob', {name}));
  }
  async cancelJob(name) {
    return plainJob(await this._repeated('CancelJob', {name}));
  }
  async deleteJob(name) {
    await this._repeated('DeleteJob', {name});
  }
  // Estimates what unwrapping a mesh of this size would need.
  async estimate({triangles, vertices = 0}, options) {
    const {spec} = newJob(undefined, undefined, options);
    const {size, refusal, ...answer} = await this._repeated('EstimateJob', {spec, size: {triangles, vertices}});
    return {...plain(answer), ...size, refusal: refusal ? errorOfStatus(refusal) : null};
  }
  async capabilities() {
    return plain(await this._repeated('GetCapabilities', {}));
  }
}

function plainJob({error, ...job}) {
  const {input, ...report} = job.report ?? {};
  return {...plain({...job, report: undefined}), error: error ? errorOfStatus(error, job.name) : null,
          report: job.report ? {...plain(report), triangles: input?.triangles ?? 0, vertices: input?.vertices ?? 0} : null};
}

// Follows the job of one call. Use once.
class Follower {
  constructor(client, {unwrap, watch = '', mesh, wantsUv = true, afterSequence = 0, onProgress, onEvent, onRetry, signal}) {
    Object.assign(this, {client, unwrap, mesh, wantsUv, onProgress, onEvent, onRetry, signal});
    this._patience = client._patienceForNewJob();
    this._name = watch;
    this._sequence = afterSequence;
    this._lostStream = false;  // a stream of the current job broke
    this._lostJobs = 0;
    this.job = undefined;
    this._pieces = [];
    this._uvBytes = 0;
  }

  get _isComplete() {
    if (!TERMINAL.includes(this.job?.state)) return false;
    return !this.wantsUv || this.job.state !== 'JOB_STATE_SUCCEEDED' || this._uvBytes >= this.job.uv.totalBytes;
  }

  async result() {
    await this.run();
    const {job, mesh} = this;
    if (job.state !== 'JOB_STATE_SUCCEEDED') throw errorOfJob(job);
    const corrupt = (what) => new PlanishError(`the UV that arrived are not the ones that the server made: ${what}`, {code: 'DATA_LOSS', reason: 'UV_CORRUPT', job: job.name});
    const bytes = new Uint8Array(Buffer.concat(this._pieces));  // a copy, whose buffer is aligned
    if (mesh && !job.uv.meshSha256.equals(mesh.sha256) && !job.uv.meshSha256.equals(createHash('sha256').update(mesh.draco).digest())) {
      throw new PlanishError('the job was made from other positions or triangles', {code: 'FAILED_PRECONDITION', reason: 'MESH_MISMATCH', job: job.name});
    }
    const isDouble = job.uv.precision === 'PRECISION_DOUBLE';
    if (bytes.length !== 2 * job.uv.cornerCount * (isDouble ? 8 : 4)) throw corrupt(`${bytes.length} bytes`);
    if (!createHash('sha256').update(bytes).digest().equals(job.uv.uvSha256)) throw corrupt('their SHA-256 differs');
    return new Result(isDouble ? new Float64Array(bytes.buffer) : new Float32Array(bytes.buffer), plainJob(job), mesh);
  }

  // Returns when the job has ended, in any state, with its UV if it succeeded and they are wanted.
  async run() {
    try {
      while (!this._isComplete) await this._runOneStream();
    } catch (error) {
      if (error instanceof PlanishError && !this.signal?.aborted) {
        error.job ||= this._name;
      } else if (this.unwrap && !this.unwrap.detached) {
        await this._cancelWhileLeaving();  // the call was aborted, or a callback threw
      }
      throw this.signal?.aborted ? this.signal.reason : error;
    }
  }

  async _cancelWhileLeaving() {
    try {
      const {spec, requestId} = this.unwrap;
      const name = this._name || (this._sent && (await this.client._once('CreateJob', {spec, requestId}, 5)).name);
      if (name) await this.client._once('CancelJob', {name}, 5);
    } catch { /* later the server cancels the job of a caller that is gone by itself */ }
  }

  async _runOneStream() {
    this.signal?.throwIfAborted();
    const stub = await this.client._stub();
    const metadata = this.client._connection.metadata(newTraceparent());
    const isNew = this.unwrap && !this._name;
    this._sent ||= Boolean(isNew);
    const stream = isNew ? stub.Unwrap(this.unwrap, metadata) : stub.WatchJob({
      name: this._name, afterSequence: this._sequence, includeUv: this.wantsUv, uvOffset: this._uvBytes,
      attach: Boolean(this.unwrap) && !this.unwrap.detached}, metadata);
    const abort = () => stream.cancel();
    this.signal?.addEventListener('abort', abort);
    let ofCallback;
    try {
      for await (const message of stream) {
        this.signal?.throwIfAborted();
        this.client._reached = true;
        this._patience.succeeded();
        if (message.uv) {
          this._takeUv(message.uv);
        } else {
          try {
            this._takeEvent(message.event);
          } catch (error) {
            ofCallback = error;
            throw error;
          }
        }
      }
    } catch (error) {
      if (ofCallback || this.signal?.aborted || (error instanceof PlanishError)) throw error;
      await this._onStreamError(this.client._error(error));
      return;
    } finally {
      this.signal?.removeEventListener('abort', abort);
      stream.cancel();  // does nothing to a stream that has ended
    }
    await this._onStreamEnd();
  }

  _takeEvent(event) {
    if (event.sequence <= this._sequence) return;  // seen before the connection broke
    this._sequence = event.sequence;
    if (event.job) {
      this.job = event.job;
      this._name = event.job.name;
    }
    this.onEvent?.({sequence: event.sequence, time: plain(event.time, 'time'), job: event.job ? plainJob(event.job) : null, progress: plain(event.progress)});
    if (event.progress) this.onProgress?.(plain(event.progress));
  }

  _takeUv({offset, data}) {
    if (offset > this._uvBytes) {
      throw new PlanishError(`the server skipped from byte ${this._uvBytes} of the UV to ${offset}`, {code: 'DATA_LOSS', reason: 'UV_CORRUPT'});
    }
    const piece = data.subarray(this._uvBytes - offset);
    this._pieces.push(piece);
    this._uvBytes += piece.length;
  }

  async _onStreamError(error) {
    const isNew = this.unwrap && !this._name;
    if (isNew && error.reason === 'DRAINING' && !this._lostStream) throw error;  // a draining server takes no new jobs
    if ((isNew && error.reason === 'UPLOAD_NOT_FOUND' && this.unwrap.spec.upload) ||
        (error.code === 'NOT_FOUND' && this.unwrap && this._lostStream && this._name)) {
      this._startAnew();  // the server has lost the upload, or the job or its UV
      return;
    }
    this._lostStream ||= isBroken(error);
    if (!isNew && !isBroken(error)) throw error;
    const seconds = await this._patience.pause(error, this.signal);
    this.onRetry?.(error, seconds);
  }

  async _onStreamEnd() {
    if (!this._isComplete) {
      await this._onStreamError(new PlanishError('the stream ended before the job did', {code: 'UNAVAILABLE', reason: 'CONNECTION_LOST'}));
    } else if (this.unwrap && ((this.job.state === 'JOB_STATE_CANCELLED' && this._lostStream) ||
               (this.job.state === 'JOB_STATE_FAILED' && this._lostJobs < MOST_LOST_JOBS && errorOfJob(this.job).reason === 'MESH_LOST'))) {
      this._startAnew();  // the server cancelled the job after the loss of its stream, or has lost its mesh
    }
  }

  _startAnew() {
    if (++this._lostJobs > MOST_LOST_JOBS) {
      throw new PlanishError(`the connection to the planish server at ${this.client.target} keeps breaking, and the job with it`,
                             {code: 'UNAVAILABLE', reason: 'CONNECTION_LOST'});
    }
    Object.assign(this, {_name: '', _sequence: 0, _lostStream: false, job: undefined, _pieces: [], _uvBytes: 0});
    this.unwrap.requestId = randomUUID();  // the old id belongs to the lost job
    delete this.unwrap.spec.upload;  // the upload may be lost with the job
    this.unwrap.spec.arrays = this.mesh.arrays;
  }
}

class Result {
  #mesh;
  constructor(uv, job, mesh) {
    this.uv = uv;
    this.report = job.report;
    this.job = job.name;
    this.#mesh = mesh;
  }
  get chartCount() { return this.report.chartTotals.charts; }
  get warnings() { return this.report.warnings; }
  get isUsable() {
    return this.report.chartTotals.notConverged === 0 && this.report.quality.flipped === 0 && this.report.quality.degenerate === 0;
  }
  perVertex() {
    if (!this.#mesh) throw new PlanishError('the mesh was not given to attach(), so there are no triangles to split', {code: 'FAILED_PRECONDITION', reason: 'NO_MESH'});
    return splitVertices(this.#mesh.vertexCount, this.#mesh.indices, this.uv);
  }
}
