import {Client} from './client.js';

export {Client} from './client.js';
export {PlanishError} from './errors.js';
export {splitVertices} from './mesh.js';
export {PrivateServer, closeDefaultServer, defaultServer, findPlanishd} from './private_server.js';

const clients = new Map();  // by what $PLANISH_SERVER says

// The client of unwrap(): of the server that $PLANISH_SERVER names, or of the private one of this process.
export function defaultClient() {
  const target = process.env.PLANISH_SERVER ?? '';
  if (!clients.has(target)) clients.set(target, new Client());
  return clients.get(target);
}

export async function unwrap(positions, indices, options, calls) {
  return defaultClient().unwrap(positions, indices, options, calls);
}
