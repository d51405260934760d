// How to connect to a server: options, the environment, TLS and tokens.
import grpc from '@grpc/grpc-js';
import {readFileSync} from 'node:fs';

import {invalid} from './errors.js';

const isUnix = (target) => /^unix(-abstract)?:/.test(target);

// Whether the connection stays within this machine.
function isWithinThisMachine(target) {
  const host = target.replace(/:[^:]*$/, '').replace(/^\[|\]$/g, '');
  return isUnix(target) || host === 'localhost' || host === '::1' || /^127(\.\d+){3}$/.test(host);
}

function flag(variable) {
  const value = (process.env[variable] ?? '').trim().toLowerCase();
  if (['1', 'true', 'on', 'yes', 'enable'].includes(value)) return true;
  if (['', '0', 'false', 'off', 'no', 'disable'].includes(value)) return false;
  throw invalid(`$${variable} is '${value}', which is neither true nor false`);
}

function read(what, path) {
  try {
    return path ? readFileSync(path) : null;
  } catch (error) {
    throw invalid(`cannot read ${what} ${path}: ${error.message}`);
  }
}

export class Connection {
  // `options`: ConnectionOptions (index.d.ts); an undefined option is taken from the environment.
  constructor(target, options = {}) {
    const env = (value, variable) => value ?? process.env[variable] ?? '';
    this.target = target;
    this.isUnix = isUnix(target);
    const ca = env(options.tlsCaFile, 'PLANISH_TLS_CA'), cert = env(options.tlsCertFile, 'PLANISH_TLS_CERT'), key = env(options.tlsKeyFile, 'PLANISH_TLS_KEY');
    const serverName = env(options.tlsServerName, 'PLANISH_TLS_SERVER_NAME');
    if (Boolean(cert) !== Boolean(key)) throw invalid('a client certificate takes two files: the certificate and its key');
    const usesTls = !this.isUnix && Boolean((options.tls ?? flag('PLANISH_TLS')) || ca || cert || serverName);
    this.credentials = usesTls ? grpc.credentials.createSsl(read('the CA', ca), read("the client's key", key), read('the client certificate', cert))
                               : grpc.credentials.createInsecure();
    const isGiven = options.token !== undefined || options.tokenFile !== undefined;
    this._tokenFile = options.tokenFile ?? (isGiven ? '' : process.env.PLANISH_TOKEN_FILE ?? '');
    this._token = options.token ?? (isGiven || this._tokenFile ? '' : process.env.PLANISH_TOKEN ?? '');
    if ((this._token || this._tokenFile) && !usesTls && !options.tokenOverPlaintext && !isWithinThisMachine(target)) {
      throw invalid(`the token would travel to ${target} unencrypted, for everybody on the way to read: use TLS`);
    }
    this.channelOptions = {
      'grpc.max_send_message_length': -1,
      'grpc.max_receive_message_length': -1,
      'grpc.initial_reconnect_backoff_ms': 100,
      'grpc.max_reconnect_backoff_ms': 2000,
      'grpc.keepalive_time_ms': 20000,
      'grpc.keepalive_timeout_ms': 10000,
      'grpc.use_local_subchannel_pool': 1,
      ...(isWithinThisMachine(target) ? {'grpc.enable_http_proxy': 0} : {}),
      ...(serverName ? {'grpc.ssl_target_name_override': serverName} : {}),
    };
  }

  // The metadata of a call: its trace, and the token of the caller.
  metadata(traceparent) {
    const metadata = new grpc.Metadata();
    metadata.set('traceparent', traceparent);
    const token = this._token || (this._tokenFile ? String(read('the token', this._tokenFile)).trim() : '');
    if (token) metadata.set('authorization', `Bearer ${token}`);
    return metadata;
  }
}
