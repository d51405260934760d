// Compiled, never run: what the declarations let through, and what not.
import {Document} from '@gltf-transform/core';
import {Client, PlanishError, PrivateServer, unwrap, type NewJob, type Progress} from 'planish';
import {planish} from 'planish/gltf-transform';

export async function main(signal: AbortSignal): Promise<number> {
  const onProgress = (progress: Progress): void => console.log(progress.stage, progress.stageFraction);
  const result = await unwrap(new Float32Array(9), [0, 1, 2], {textureSize: 64, seams: 'keep', seamEdges: [[0, 1]]}, {onProgress, signal});
  const split = result.perVertex();
  const server = await PrivateServer.start({workers: 2});
  const client = new Client(server.target, {token: 'secret', retry: {retrySeconds: 1}});
  const jobs: NewJob[] = [{positions: new Float64Array(9), indices: Uint32Array.of(0, 1, 2), labels: {batch: 'a'}}];
  for (const job of await client.createJobs(jobs)) {
    if (job instanceof PlanishError) throw job;
    await client.attach(job.name);
  }
  await new Document().transform(planish({client, texcoord: 1, overwrite: true, groupBy: 'scene', padding: 4}));
  // @ts-expect-error: no such word
  await unwrap([], [], {seams: 'never'});
  // @ts-expect-error: no such option
  planish({textureSizes: 3});
  return split.sourceVertex.length + result.report.quality.flipped;
}
