// An S3 server for tests (the package s3rver), on loopback. Says "port N" when it listens.
//   s3_server.mjs DIRECTORY
import S3rver from 's3rver';

const server = new S3rver({
  address: '127.0.0.1',
  port: 0,
  silent: true,
  directory: process.argv[2],
  configureBuckets: [{ name: 'blobs' }],
});
const { port } = await server.run();
console.error(`port ${port}`);
