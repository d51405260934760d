// Starts a private planishd, for programs that must work without a running server.
import {spawn} from 'node:child_process';
import {accessSync, closeSync, constants, mkdtempSync, openSync, readFileSync, rmSync, statSync, unlinkSync} from 'node:fs';
import os from 'node:os';
import {delimiter, isAbsolute, join} from 'node:path';
import {once} from 'node:events';

import {PlanishError} from './errors.js';

const failed = (message) => new PlanishError(message, {code: 'UNAVAILABLE', reason: 'PRIVATE_SERVER_FAILED'});

function isProgram(path) {
  try {
    accessSync(path, constants.X_OK);
    return statSync(path).isFile();
  } catch {
    return false;
  }
}

// The planishd that a PrivateServer starts: $PLANISHD, else the one in PATH; null if there is none.
export function findPlanishd() {
  if (process.env.PLANISHD) return isProgram(process.env.PLANISHD) ? process.env.PLANISHD : null;
  const found = (process.env.PATH ?? '').split(delimiter).map((folder) => join(folder || '.', 'planishd'));
  return found.find(isProgram) ?? null;
}

function newDirectory() {
  for (const base of [process.env.XDG_RUNTIME_DIR, process.env.TMPDIR, '/tmp']) {
    // The path of the socket in the new directory must stay below 108 bytes.
    if (!base || !isAbsolute(base) || base.length > 60) continue;
    try {
      return mkdtempSync(join(base, 'planish-'));
    } catch { /* tries the next folder */ }
  }
  throw failed("cannot make a directory for the server's socket in $XDG_RUNTIME_DIR, $TMPDIR or /tmp");
}

const running = new Set();
process.on('exit', () => running.forEach((server) => server._remove()));

export class PrivateServer {
  // Starts planishd and waits until it is ready.
  static async start(options = {}) {
    const server = new PrivateServer(options);
    try {
      await server._start();
    } catch (error) {
      await server.close();
      throw error;
    }
    return server;
  }

  constructor({executable, workers = 1, threads, startTimeoutSeconds = 10, extraArguments = []}) {
    this.executable = executable ?? findPlanishd();
    if (!this.executable) {
      const named = process.env.PLANISHD;
      throw failed(named ? `$PLANISHD is ${named}, which is not a program`
                         : 'cannot find planishd in $PLANISHD or PATH. It runs on Linux; on other systems $PLANISH_SERVER names a server elsewhere, host:port');
    }
    this._arguments = [`--workers=${workers}`, ...(threads ? [`--threads=${threads}`] : []), ...extraArguments];
    this._seconds = startTimeoutSeconds;
    this.directory = newDirectory();
    this.target = `unix:${this.directory}/socket`;
    running.add(this);
  }

  get isRunning() {
    return this._child !== undefined && this._child.exitCode === null && this._child.signalCode === null;
  }
  get pid() {
    return this.isRunning ? this._child.pid : 0;
  }
  // What planishd has written to stderr so far.
  log() {
    try {
      return readFileSync(join(this.directory, 'log'), 'utf8');
    } catch {
      return '';
    }
  }

  // Restarts planishd at the same address if it has crashed; its jobs are lost.
  async startAgain() {
    if (!this.isRunning) await (this._starting ??= this._start().finally(() => { this._starting = undefined; }));
  }

  async _start() {
    // Variables like PLANISHD_QUEUE configure the planishd of this machine, and not private ones.
    const env = Object.fromEntries(Object.entries(process.env).filter(([name]) => !name.startsWith('PLANISHD_')));
    try {
      unlinkSync(join(this.directory, 'socket'));
    } catch { /* there is no old socket */ }
    const log = openSync(join(this.directory, 'log'), 'w', 0o600);
    // planishd ends once this process's end of descriptor 3 is closed: by close(), or when this process ends.
    const child = this._child = spawn(this.executable, [`--listen=${this.target}`, '--supervisor-fd=3', '--log-level=warn', ...this._arguments],
                                      {env, detached: true, stdio: ['ignore', 'ignore', log, 'pipe']});
    closeSync(log);
    const supervisor = this._supervisor = child.stdio[3];
    supervisor.on('error', () => {});
    this._exited = new Promise((resolve) => child.once('exit', resolve).once('error', resolve));
    let timer;
    const said = await Promise.race([
      once(supervisor, 'data').then(([data]) => String(data)),
      once(child, 'exit').then(([code, signal]) => `${signal ? `was killed by ${signal}` : `exited with code ${code}`} while it started`),
      new Promise((resolve) => { timer = setTimeout(resolve, 1000 * this._seconds, 'did not become ready in time'); }),
    ]).catch((error) => `cannot be started: ${error.message}`);
    clearTimeout(timer);
    if (said !== 'ready\n') throw failed(`${this.executable} ${said}\n${this.log()}`.trimEnd());
    child.unref();  // neither planishd nor its pipe keeps a program from ending
    supervisor.unref();
  }

  _remove() {
    running.delete(this);
    rmSync(this.directory, {recursive: true, force: true});
  }

  // Stops the server; its jobs are cancelled.
  async close() {
    this._supervisor?.destroy();
    if (this._exited) {
      const timer = setTimeout(() => this._child.kill('SIGKILL'), 5000);
      await this._exited;
      clearTimeout(timer);
    }
    this._remove();
  }
}

let shared;  // a promise of the private server of this process

// The private server of this process, for clients without a target. Started by the first call, ended with the process,
// and restarted at the same address if it has crashed.
export async function defaultServer() {
  const workers = Math.max(1, Math.min(4, Math.floor((os.availableParallelism?.() ?? os.cpus().length) / 2)));
  shared ??= PrivateServer.start({workers}).catch((error) => {
    shared = undefined;
    throw error;
  });
  const server = await shared;
  await server.startAgain();
  return server;
}

// Restarts the private server of this process if it is the server at `target` and has crashed. Returns whether it was
// restarted. Throws if it was restarted for the same call before (`wasRevived`), which may be why it crashes.
export async function revive(target, wasRevived) {
  const server = await shared;
  if (!server || server.target !== target || server.isRunning) return false;
  if (wasRevived) throw failed(`planishd crashed, was started again and crashed again during one call\n${server.log()}`.trimEnd());
  await server.startAgain();
  return true;
}

export async function closeDefaultServer() {
  const server = await shared;
  shared = undefined;
  await server?.close();
}
