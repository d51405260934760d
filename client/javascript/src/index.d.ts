/** UV unwrapping of triangle meshes on a planish server. */

import type {UnwrapOptions} from './options.js';

export type Numbers = ArrayLike<number>;

export type {UnwrapOptions} from './options.js';

/** Data of corners and faces of the mesh. */
export interface MeshElements {
  /** Pairs of vertices between which a given seam runs. */
  seamEdges?: Numbers | [number, number][];
  /** Corners that face edges at which a given seam runs: corner 3 f + k, the k-th of triangle f, faces the edge between
      the other two. */
  seamCorners?: Numbers;
  /** A label for each triangle: a given seam runs wherever the labels of two triangles differ. */
  parts?: Numbers;
  /** Corners that face edges at which no seam is added. */
  uncutCorners?: Numbers;
  /** The polygon that each triangle comes from: no seam follows the diagonals of a polygon. */
  facePolygon?: Numbers;
  /** The atlas that each triangle goes into, from 0 on. */
  faceAtlas?: Numbers;
  /** For each triangle, a factor on the texels per length, from 0.01 to 100. */
  faceWeights?: Numbers;
}

export interface JobOptions {
  /** For finding the job again. */
  labels?: Record<string, string>;
  priority?: 'low' | 'normal' | 'high';
  /** Counted from acceptance: a job that has not ended by then fails with DEADLINE_EXCEEDED. */
  timeoutSeconds?: number;
  /** A job that runs longer is stopped, and delivers its best map so far. */
  computeBudgetSeconds?: number;
  /** Compute again even if the server has the result for this mesh and these options. */
  fresh?: boolean;
  /** The same id gets the same job. */
  requestId?: string;
}

export type Options = UnwrapOptions & MeshElements & JobOptions;

/** How far a job is. */
export interface Progress {
  stage: 'unspecified' | 'decode' | 'charts' | 'solve' | 'layout' | 'pack' | 'verify' | 'encode';
  /** 0-based. */
  chart: number;
  chartCount: number;
  newtonIteration: number;
  linearIterations: number;
  linearResidual: number;
  energy: number;
  stepLength: number;
  elapsedSeconds: number;
  tolerance: number;
  /** How much of the stage is done, from 0 to 1, roughly; 0 in stages that do not report it. */
  stageFraction: number;
  residual: Residual | null;
}
export interface Residual {
  triangle: number;
  vertex: number;
  wheel: number;
  gradient: number;
}
export interface Warning {
  reason: string;
  message: string;
  metadata: Record<string, string>;
}
/** Measured on the delivered UV with exact predicates. */
export interface Quality {
  flipped: number;
  degenerate: number;
  /** Pairs of UV triangles whose interiors meet. */
  overlapping: number;
  angleErrorMeanDeg: number;
  angleErrorMaxDeg: number;
  abfEnergy: number;
  conformalDistortionMean: number;
  conformalDistortionMax: number;
  stretchL2: number;
  packingEfficiency: number;
  seamLength: number;
}
/** What the server reports of a job that SUCCEEDED; fields as in planish.v1.Report. */
export interface Report {
  triangles: number;
  vertices: number;
  charts: Record<string, unknown>[];
  chartTotals: {charts: number; notConverged: number; newtonIterations: number; linearIterations: number; stretchL2Max: number};
  atlas: Record<string, unknown>;
  quality: Quality;
  /** Wall-clock seconds of each stage on the server. */
  seconds: Record<'queue' | 'decode' | 'charts' | 'solve' | 'layout' | 'pack' | 'verify' | 'encode', number>;
  peakMemoryBytes: number;
  threads: number;
  warnings: Warning[];
}
export interface Job {
  /** "jobs/..." */
  name: string;
  state: 'UNSPECIFIED' | 'QUEUED' | 'RUNNING' | 'STOPPING' | 'SUCCEEDED' | 'FAILED' | 'CANCELLED' | 'EXPIRED';
  labels: Record<string, string>;
  createTime: Date | null;
  startTime: Date | null;
  endTime: Date | null;
  expireTime: Date | null;
  queuePosition: number;
  progress: Progress | null;
  error: PlanishError | null;
  report: Report | null;
}
export interface Event {
  sequence: number;
  time: Date | null;
  job: Job | null;
  progress: Progress | null;
}
/** A mesh whose vertices have one UV each. The given vertices keep their numbers; copies come after them. */
export interface VertexSplit {
  /** The given vertex of each vertex. */
  sourceVertex: Uint32Array;
  indices: Uint32Array;
  uv: Float32Array | Float64Array;
}
export interface Result {
  /** uv[2 * (3 * f + k)] and the number after it are (u, v) of corner k of triangle f. */
  readonly uv: Float32Array | Float64Array;
  readonly report: Report;
  /** Name of the job. */
  readonly job: string;
  readonly chartCount: number;
  readonly warnings: Warning[];
  /** Every chart converged and no UV triangle is flipped or degenerate. */
  readonly isUsable: boolean;
  perVertex(): VertexSplit;
}

export interface Callbacks {
  onProgress?: (progress: Progress) => void;
  /** Called for every event, in order. If both connection and job are lost, events start again at 1 with the name of a
      new job. */
  onEvent?: (event: Event) => void;
  /** Called when the connection broke or the server is full, with the error and the seconds waited before the next
      attempt. */
  onRetry?: (error: PlanishError, seconds: number) => void;
  /** Aborting cancels the job on the server; the call then ends with the signal's reason. */
  signal?: AbortSignal;
}
/** How to encrypt a connection and identify the caller. An undefined option is taken from the environment: $PLANISH_TLS
    and so on. */
export interface ConnectionOptions {
  tls?: boolean;
  tlsCaFile?: string;
  tlsCertFile?: string;
  tlsKeyFile?: string;
  tlsServerName?: string;
  token?: string;
  tokenFile?: string;
  /** Send the token to another machine even without TLS. */
  tokenOverPlaintext?: boolean;
}
export interface RetryPolicy {
  /** How long calls about a job wait for a lost server, in seconds; default 60. */
  reattachSeconds?: number;
  backoffSeconds?: number;
  /** How long a new job waits for room on a full server, in seconds; default 60. */
  queueFullWaitSeconds?: number;
  /** How long other calls are retried, in seconds; default 10. */
  retrySeconds?: number;
}

/** Why a call or a job failed. `message` is a sentence for people, `reason` a word for programs ("QUEUE_FULL"), `code` gRPC's name of the kind. */
export class PlanishError extends Error {
  readonly code: string;
  readonly reason: string;
  readonly metadata: Record<string, string>;
  readonly job: string;
  readonly retryAfterSeconds: number;
  /** Ids of the elements at fault, in the given arrays. */
  get faces(): number[];
  get vertices(): number[];
  get edges(): [number, number][];
}

export type NewJob = {positions: Numbers | number[][]; indices: Numbers | number[][]} & Options;

/** A connection to one server, made by the first call and re-established when lost. */
export class Client {
  /** `target`: "host:port" or "unix:/path"; undefined: $PLANISH_SERVER, else a private server of this process. */
  constructor(target?: string, options?: ConnectionOptions & {retry?: RetryPolicy});
  readonly target: string | undefined;
  unwrap(positions: Numbers | number[][], indices: Numbers | number[][], options?: Options, calls?: Callbacks & {detached?: boolean}): Promise<Result>;
  /** Follows a job until it ends and returns its UV. If a mesh is given, it must be the job's. Aborting does not affect
      the job. */
  attach(job: string, positions?: Numbers | number[][], indices?: Numbers | number[][], calls?: Callbacks): Promise<Result>;
  /** Follows a job until it ends, in any state, and returns it. */
  watchJob(job: string, calls?: Callbacks & {afterSequence?: number}): Promise<Job>;
  /** Queues a job and returns it once the server has accepted it. */
  createJob(positions: Numbers | number[][], indices: Numbers | number[][], options?: Options, calls?: {signal?: AbortSignal}): Promise<Job>;
  /** Queues several jobs with few calls. Returns for each the job, or the error with which it was refused. */
  createJobs(jobs: NewJob[], calls?: {signal?: AbortSignal}): Promise<(Job | PlanishError)[]>;
  getJob(name: string): Promise<Job>;
  /** Waits until the job has ended, at most `seconds`, and returns it. */
  waitJob(name: string, seconds?: number): Promise<Job>;
  /** The jobs, newest first, at most `limit` (default 50; 0: all), without reports. */
  listJobs(options?: {limit?: number; filter?: string}): Promise<Job[]>;
  /** Asks a job to end soon with the best valid map so far. */
  stopJob(name: string): Promise<Job>;
  cancelJob(name: string): Promise<Job>;
  deleteJob(name: string): Promise<void>;
  estimate(size: {triangles: number; vertices?: number}, options?: Options): Promise<{memoryBytes: number; runTimeSeconds: number; queueTimeSeconds: number; triangles: number; vertices: number; refusal: PlanishError | null}>;
  capabilities(): Promise<{version: string; maxMeshBytes: number; workers: number; queueCapacity: number; threads: number; maxTriangles: number; memoryBytes: number; durable: boolean; [name: string]: unknown}>;
  close(): void;
}

/** A planishd that only this user can reach. It ends with close(), and when this process ends. Needs Linux. */
export class PrivateServer {
  static start(options?: {executable?: string; workers?: number; threads?: number; startTimeoutSeconds?: number; extraArguments?: string[]}): Promise<PrivateServer>;
  readonly target: string;
  readonly executable: string;
  /** The process id of planishd; 0 if it does not run. */
  readonly pid: number;
  readonly isRunning: boolean;
  /** What planishd has written to stderr so far. */
  log(): string;
  startAgain(): Promise<void>;
  close(): Promise<void>;
}

/** Flattens a mesh on the server that $PLANISH_SERVER names, or on a private one that the first call starts and that ends with this process. */
export function unwrap(positions: Numbers | number[][], indices: Numbers | number[][], options?: Options, calls?: Callbacks & {detached?: boolean}): Promise<Result>;
export function splitVertices(vertexCount: number, indices: Numbers, uv: Float32Array | Float64Array): VertexSplit;
/** The planishd that a private server would run: $PLANISHD, else the one in PATH; null if there is none. */
export function findPlanishd(): string | null;
export function defaultClient(): Client;
export function defaultServer(): Promise<PrivateServer>;
export function closeDefaultServer(): Promise<void>;
