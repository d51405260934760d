import type {Primitive, Transform} from '@gltf-transform/core';

import type {Client, ConnectionOptions, Progress, Result, UnwrapOptions} from './index.js';

export interface PlanishOptions extends UnwrapOptions {
  /** "host:port" or "unix:/path"; undefined: $PLANISH_SERVER, else a private server of this process. */
  server?: string;
  /** TLS and tokens for `server`. */
  connection?: ConnectionOptions;
  /** In the place of `server`: a client that there is. */
  client?: Client;
  /** The set of texture coordinates that is written; 0. */
  texcoord?: number;
  /** Whether primitives that have this set already get it anew; false. */
  overwrite?: boolean;
  /** What shares a texture: each primitive has its own, the primitives of a mesh share one, or all of the document do; `mesh`. */
  groupBy?: 'primitive' | 'mesh' | 'scene';
  onProgress?: (progress: Progress, primitives: Primitive[]) => void;
  /** Called for each group when its UV have been written. */
  onResult?: (result: Result, primitives: Primitive[]) => void;
  signal?: AbortSignal;
}

/** Unwraps the triangles of a document: `await document.transform(planish({textureSize: 2048}))`. A failure leaves the document as it was. */
export function planish(options?: PlanishOptions): Transform;
