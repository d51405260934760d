import type {Primitive, Transform} from '@gltf-transform/core';

import type {Client, ConnectionOptions, Progress, Result, UnwrapOptions} from './index.js';

export interface PlanishOptions extends UnwrapOptions {
  /** "host:port" or "unix:/path"; undefined: $PLANISH_SERVER, else a private server of this process. */
  server?: string;
  /** TLS and tokens for `server`. */
  connection?: ConnectionOptions;
  /** An existing client, in place of `server`. */
  client?: Client;
  /** The set of texture coordinates that is written; default 0. */
  texcoord?: number;
  /** Whether to replace this set in primitives that have it already; default false. */
  overwrite?: boolean;
  /** Which primitives share a texture: none, those of a mesh, or all of the document; default 'mesh'. */
  groupBy?: 'primitive' | 'mesh' | 'scene';
  onProgress?: (progress: Progress, primitives: Primitive[]) => void;
  /** Called for each group of primitives that share a texture, when their UV have been written. */
  onResult?: (result: Result, primitives: Primitive[]) => void;
  signal?: AbortSignal;
}

/** Unwraps the triangles of a document: `await document.transform(planish({textureSize: 2048}))`. A failure leaves the document as it was. */
export function planish(options?: PlanishOptions): Transform;
