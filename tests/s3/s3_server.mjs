// An S3 server for tests (the package s3rver), on loopback. Says "port N" when it listens.
//   s3_server.mjs DIRECTORY
import { mkdir, rename, rm, writeFile } from 'node:fs/promises';
import { createHash, randomUUID } from 'node:crypto';
import path from 'node:path';
import S3rver from 's3rver';
import S3Error from 's3rver/lib/models/error.js';

// The package's store works on files, in several steps. A request that comes between two steps of another one sees half
// an object, answers with 500, or ends the process, as no S3 server does. Here each request to the store is whole before
// the next one begins.
function makeAtomic(store) {
  const plain = Object.fromEntries(
    ['getObject', 'listObjects', 'copyObject', 'deleteObject'].map((name) => [name, store[name].bind(store)]),
  );
  let last = Promise.resolve();
  const alone = (work) => {
    const result = last.then(work);
    last = result.catch(() => {});
    return result;
  };

  store.getObject = (...request) => alone(() => plain.getObject(...request));
  store.listObjects = (...request) => alone(() => plain.listObjects(...request));
  store.copyObject = (bucket, key, ...to) =>
    alone(async () => {
      if (!(await store.existsObject(bucket, key))) {
        throw new S3Error('NoSuchKey', 'The specified key does not exist.', { Key: key });
      }
      return plain.copyObject(bucket, key, ...to);
    });
  store.deleteObject = (bucket, key) =>
    alone(async () => {
      if (await store.existsObject(bucket, key)) await plain.deleteObject(bucket, key);
    });
  store.putObject = async ({ bucket, key, content, metadata }) => {
    // Of a sender that goes away nothing stays.
    const pieces = [];
    for await (const piece of content) pieces.push(piece);
    const bytes = Buffer.concat(pieces);
    const md5 = createHash('md5').update(bytes).digest('hex');
    return alone(async () => {
      const file = store.getResourcePath(bucket, key, 'object');
      await mkdir(path.dirname(file), { recursive: true });
      const unfinished = `${file}.${randomUUID()}`;
      try {
        await writeFile(unfinished, bytes);
        await store.putMetadata(bucket, key, metadata, md5);
        await rename(unfinished, file);
      } finally {
        await rm(unfinished, { force: true });
      }
      return { size: bytes.length, md5 };
    });
  };
}

const server = new S3rver({
  address: '127.0.0.1',
  port: 0,
  silent: true,
  directory: process.argv[2],
  configureBuckets: [{ name: 'blobs' }],
});
makeAtomic(server.store);
const { port } = await server.run();
// A test that has to wait for the processor keeps its connections.
server.httpServer.keepAliveTimeout = 120_000;
console.error(`port ${port}`);
