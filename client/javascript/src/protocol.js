// Loads the published protos, and converts values between messages and users of JavaScript: for users, enumerations are
// words ("auto", "solve"; states of jobs in capitals), durations are seconds, times are Dates.
import grpc from '@grpc/grpc-js';
import protoLoader from '@grpc/proto-loader';
import {fileURLToPath} from 'node:url';

const includeDirs = [fileURLToPath(new URL('../proto', import.meta.url))];
export const definition = protoLoader.loadSync(['planish/v1/planish.proto', 'google/rpc/error_details.proto'],
                                               {includeDirs, enums: String, longs: Number, defaults: true, arrays: true, objects: true, oneofs: true});
export const {Planish} = grpc.loadPackageDefinition(definition).planish.v1;

const words = new Map();  // by the name of a value: its word
const enums = new Map();  // by the name of an enumeration: the names of its values by word
for (const {format, type} of Object.values(definition)) {
  if (format !== 'Protocol Buffer 3 EnumDescriptorProto') continue;
  const prefix = type.value[0].name.slice(0, -'UNSPECIFIED'.length);
  const names = new Map();
  for (const {name} of type.value) {
    const word = name.slice(prefix.length);
    words.set(name, type.name === 'JobState' ? word : word.toLowerCase());
    names.set(word.toLowerCase(), name);
  }
  enums.set(type.name, names);
}

const fields = new Map(definition['planish.v1.UnwrapOptions'].type.field.map((field) => [field.jsonName || camel(field.name), field]));
fields.delete('pack');

function camel(name) {
  return name.replace(/_([a-z])/g, (_, letter) => letter.toUpperCase());
}

// The name of the value that a word has in an enumeration; undefined if there is none.
export function enumValue(type, word) {
  const value = enums.get(type)?.get(String(word).toLowerCase());
  return value?.endsWith('_UNSPECIFIED') ? undefined : value;
}
export const enumWords = (type) => [...enums.get(type).keys()].filter((word) => word !== 'unspecified');

// The descriptors of the fields of UnwrapOptions, by their names in JavaScript.
export const optionFields = fields;

const TIMES = new Set(['createTime', 'startTime', 'endTime', 'expireTime', 'time']);
const RENAMED = {times: 'seconds', runTime: 'runTimeSeconds', queueTime: 'queueTimeSeconds', reattachGrace: 'reattachGraceSeconds'};

// Converts a message to the object that users see.
export function plain(value, key = '') {
  if (Array.isArray(value)) return value.map((each) => plain(each));
  if (typeof value === 'string') return words.get(value) ?? value;
  if (value === null || typeof value !== 'object' || Buffer.isBuffer(value)) return value;
  if (key === 'labels' || key === 'metadata') return {...value};
  const keys = Object.keys(value);
  if (keys.length === 2 && 'seconds' in value && 'nanos' in value) {
    return TIMES.has(key) ? new Date(1000 * value.seconds + value.nanos / 1e6) : value.seconds + 1e-9 * value.nanos;
  }
  return Object.fromEntries(keys.map((name) => [RENAMED[name] ?? name, plain(value[name], name)]));
}

export const duration = (seconds) => ({seconds: Math.floor(seconds), nanos: Math.round(1e9 * (seconds % 1))});
