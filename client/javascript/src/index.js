import {Client} from './client.js';

export {Client} from './client.js';
export {PlanishError} from './errors.js';
export {splitVertices} from './mesh.js';
export {PrivateServer, closeDefaultServer, defaultServer, findPlanishd} from './private_server.js';

const clients = new Map();  // by the value of $PLANISH_SERVER

// The client of unwrap(), for the server that $PLANISH_SERVER names, else for the private server of this process.
export function defaultClient() {
  const target = process.env.PLANISH_SERVER ?? '';
  if (!clients.has(target)) clients.set(target, new Client());
  return clients.get(target);
}

export async function unwrap(positions, indices, options, calls) {
  return defaultClient().unwrap(positions, indices, options, calls);
}
