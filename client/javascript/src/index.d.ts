/** UV unwrapping of triangle meshes on a planish server. */

import type {UnwrapOptions} from './options.js';

export type Numbers = ArrayLike<number>;

export type {UnwrapOptions} from './options.js';

/** What belongs to corners and faces of the mesh. */
export interface MeshElements {
  /** Pairs of vertices between which a given seam runs. */
  seamEdges?: Numbers | [number, number][];
  /** Corner 3 f + k faces the edge between the other two corners of triangle f: a given seam. */
  seamCorners?: Numbers;
  /** A label for each triangle: a given seam runs wherever two differ. */
  parts?: Numbers;
  /** Corners that face edges at which no seam is added. */
  uncutCorners?: Numbers;
  /** The polygon that each triangle comes from: no seam follows its diagonals. */
  facePolygon?: Numbers;
  /** The atlas that each triangle goes into, from 0 on. */
  faceAtlas?: Numbers;
  /** So many times the texels per length, for each triangle. */
  faceWeights?: Numbers;
}

export interface JobOptions {
  /** Whatever helps to find the job again. */
  labels?: Record<string, string>;
  priority?: 'low' | 'normal' | 'high';
  /** From acceptance on: a job that has not ended then fails with DEADLINE_EXCEEDED. */
  timeoutSeconds?: number;
  /** Of running: a job that runs longer delivers the best map it has. */
  computeBudgetSeconds?: number;
  /** Compute anew even if the server has the result. */
  fresh?: boolean;
  /** The same id gets the same job. */
  requestId?: string;
}

export type Options = UnwrapOptions & MeshElements & JobOptions;

/** One point of a job's way. */
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
  /** Of the stage that is done, roughly; 0 in stages that do not tell. */
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
/** What became of the mesh; fields as in planish.v1.Report. */
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
/** A mesh whose vertices have one UV each. The vertices that came in keep their numbers; copies are behind them. */
export interface VertexSplit {
  /** The vertex that each came from. */
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
  /** Every event, in order. After the loss of both connection and job, they start again at 1 with another job. */
  onEvent?: (event: Event) => void;
  /** The connection broke, or the server is full; another attempt has been waited for, for so many seconds. */
  onRetry?: (error: PlanishError, seconds: number) => void;
  /** Aborting cancels the job on the server; the call then ends with the signal's reason. */
  signal?: AbortSignal;
}
/** undefined stands for the variable of the environment, $PLANISH_TLS and so on. */
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
  /** How long calls about a job wait for a server that was lost; 60. */
  reattachSeconds?: number;
  backoffSeconds?: number;
  /** How long a new job waits for room; 60. */
  queueFullWaitSeconds?: number;
  /** How long the other calls are repeated; 10. */
  retrySeconds?: number;
}

/** Why a call or a job failed. `message` is a sentence for people, `reason` a word for programs ("QUEUE_FULL"), `code` gRPC's name of the kind. */
export class PlanishError extends Error {
  readonly code: string;
  readonly reason: string;
  readonly metadata: Record<string, string>;
  readonly job: string;
  readonly retryAfterSeconds: number;
  /** Elements at fault, of the arrays that were given. */
  get faces(): number[];
  get vertices(): number[];
  get edges(): [number, number][];
}

export type NewJob = {positions: Numbers | number[][]; indices: Numbers | number[][]} & Options;

/** A connection to one server, made by the first call and again when it is lost. */
export class Client {
  /** `target`: "host:port" or "unix:/path"; undefined: $PLANISH_SERVER, else a private server of this process. */
  constructor(target?: string, options?: ConnectionOptions & {retry?: RetryPolicy});
  readonly target: string | undefined;
  unwrap(positions: Numbers | number[][], indices: Numbers | number[][], options?: Options, calls?: Callbacks & {detached?: boolean}): Promise<Result>;
  /** Follows a job until it ended and brings its UV; the mesh, if it is given, must be the job's. Aborting leaves the job alone. */
  attach(job: string, positions?: Numbers | number[][], indices?: Numbers | number[][], calls?: Callbacks): Promise<Result>;
  /** Follows a job until it ended, whatever the end. */
  watchJob(job: string, calls?: Callbacks & {afterSequence?: number}): Promise<Job>;
  /** Queues a job and returns as soon as the server has it. */
  createJob(positions: Numbers | number[][], indices: Numbers | number[][], options?: Options, calls?: {signal?: AbortSignal}): Promise<Job>;
  /** Queues several jobs with few calls: for each a job, or the error that it was refused with. */
  createJobs(jobs: NewJob[], calls?: {signal?: AbortSignal}): Promise<(Job | PlanishError)[]>;
  getJob(name: string): Promise<Job>;
  /** The job when it has ended, or after so many seconds as it is then. */
  waitJob(name: string, seconds?: number): Promise<Job>;
  /** Newest first, at most `limit` (50; 0: all), without reports. */
  listJobs(options?: {limit?: number; filter?: string}): Promise<Job[]>;
  /** Asks a job to end soon with the best valid map so far. */
  stopJob(name: string): Promise<Job>;
  cancelJob(name: string): Promise<Job>;
  deleteJob(name: string): Promise<void>;
  estimate(size: {triangles: number; vertices?: number}, options?: Options): Promise<{memoryBytes: number; runTimeSeconds: number; queueTimeSeconds: number; triangles: number; vertices: number; refusal: PlanishError | null}>;
  capabilities(): Promise<{version: string; maxMeshBytes: number; workers: number; queueCapacity: number; threads: number; maxTriangles: number; memoryBytes: number; durable: boolean; [name: string]: unknown}>;
  close(): void;
}

/** A planishd that only this user can reach. It ends with close(), and with this process however that ends. Needs Linux. */
export class PrivateServer {
  static start(options?: {executable?: string; workers?: number; threads?: number; startTimeoutSeconds?: number; extraArguments?: string[]}): Promise<PrivateServer>;
  readonly target: string;
  readonly executable: string;
  /** 0 if it does not run. */
  readonly pid: number;
  readonly isRunning: boolean;
  /** What it wrote to stderr so far. */
  log(): string;
  startAgain(): Promise<void>;
  close(): Promise<void>;
}

/** Flattens a mesh on the server that $PLANISH_SERVER names, or on a private one that the first call starts and that ends with this process. */
export function unwrap(positions: Numbers | number[][], indices: Numbers | number[][], options?: Options, calls?: Callbacks & {detached?: boolean}): Promise<Result>;
export function splitVertices(vertexCount: number, indices: Numbers, uv: Float32Array | Float64Array): VertexSplit;
/** The planishd that a private server would be: $PLANISHD, else the one in PATH. */
export function findPlanishd(): string | null;
export function defaultClient(): Client;
export function defaultServer(): Promise<PrivateServer>;
export function closeDefaultServer(): Promise<void>;
