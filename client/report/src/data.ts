// The data of the page, as client/cli/report_page.cc writes it.

export interface ChartInfo {
  triangles: number;
  stretch: number;
  angle: number; // mean error, degrees
  density: number; // texels per unit of length
  mirrored: boolean;
}

export interface Finding {
  kind: string;
  text: string;
  fault?: number; // its bit in MapData.faults
  charts?: number[];
  faces?: number[]; // triangles
}

// An image, and how a material reads it.
export interface ImageUse {
  image: number; // of PageInfo.images; -1: none that can be shown
  transform: number[]; // u' = t[0] u + t[1] v + t[2], and v' likewise; v downwards
  wrap: ['repeat' | 'mirror' | 'clamp', 'repeat' | 'mirror' | 'clamp'];
  nearest: boolean; // magnified without interpolation
}

// The base colour of a material, and its normal map.
export interface TextureInfo extends ImageUse {
  normals?: ImageUse & { scale: number };
  factor: [number, number, number, number]; // linear
  alpha: 'opaque' | 'mask' | 'blend';
  cutoff: number;
}

export interface ImageInfo {
  name: string;
  type: string; // "image/png"
  width: number; // in the page
  height: number;
  fileWidth: number; // in the file
  fileHeight: number;
}

export interface MapInfo {
  name: string;
  triangles: number;
  places: number;
  textureSize: number;
  padding: number; // texels
  tiles: number[]; // numbers of the tiles that hold something
  low: [number, number, number]; // lowest corner of the surface's bounding box
  size: number; // longest side of that box
  uvLow: [number, number];
  uvSize: number; // of a square round the map
  charts: ChartInfo[]; // from the section "charts"
  materials: { name: string; color: [number, number, number] }[];
  numbers: [string, string][]; // what `planish check` says, line by line
  findings: Finding[];
  textures?: TextureInfo[]; // if there are images
  sections: Record<string, number>; // bytes of each section, in their order
}

export interface ChartSolve {
  chart: number;
  triangles: number;
  method: string;
  solver: string;
  preconditioner: string;
  converged: boolean;
  newton_iterations: number;
  stretch_l2: number;
  residual: number; // the largest at the end
  steps?: number[]; // the largest residual at the start and after each Newton step; only some charts have it
}

export interface Unwrap {
  charts?: ChartSolve[];
  seconds?: Record<string, number>;
  warnings?: { reason: string; message: string; metadata?: Record<string, string> }[];
  largest?: number[]; // like ChartSolve.steps, the largest of all charts
  tolerance?: number;
}

export interface PageInfo {
  version: string;
  maps: MapInfo[];
  images?: ImageInfo[];
  imageNotes?: string[]; // about images that cannot be shown
  unwrap?: Unwrap; // how the last map was made
  title?: string; // what the page is about
  sheet?: string; // address of the contact sheet that this page belongs to
}

export interface MapData {
  info: MapInfo;
  indices: Uint32Array; // 3 places a triangle
  positions: Uint16Array; // 3 a place, in 65535ths of the size
  uv: Uint16Array; // 2 a place
  chart: Uint32Array; // per triangle
  stretch: Uint8Array; // 0 to 254: log2 from 0 to 4; 255: no area
  angle: Uint8Array; // 0 to 254: the root of the error over 180 degrees
  faults: Uint8Array;
  polygon: Uint32Array; // per triangle: its polygon in the file
  material: Int32Array; // -1: none
  outline: Uint32Array; // half-edges: corner c faces the edge
  visibility: Uint8Array; // per triangle, 0 to 254: the share of its surroundings that is open
  texture: Int32Array | null; // per triangle: of MapInfo.textures, -1: none
  colors: Uint8Array | null; // 4 a place, sRGB and alpha: what textures are multiplied by
  uvFine: Uint16Array | null; // 2 a place: what `uv` lacks, plus a half, in 65535ths of its steps
  seams: Uint8Array; // per half-edge of the outline: as visibility; 255: the surface ends there
}

export const STRETCH_RANGE = 4;
export const FAULTS = { flipped: 1, degenerate: 2, overlapping: 4, outside: 8, mirrored: 16 } as const;

export function stretchOf(byte: number): number {
  return 2 ** ((byte / 254) * STRETCH_RANGE);
}
export function angleOf(byte: number): number {
  return 180 * (byte / 254) ** 2;
}

class Reader {
  private at = 0;
  constructor(private readonly bytes: Uint8Array) {}

  varint(): number {
    let value = 0;
    for (let scale = 1; ; scale *= 128) {
      const byte = this.bytes[this.at++]!;
      value += (byte & 127) * scale;
      if (byte < 128) return value;
    }
  }
  signed(): number {
    const value = this.varint();
    return value % 2 === 0 ? value / 2 : -(value + 1) / 2;
  }
}

// Decodes 16-bit numbers and returns them interleaved: all components of one element, then those of the next. `bytes`
// has one component after the other, as the zigzag codes of the differences between successive numbers: first the low
// bytes of all codes, then the high bytes.
function fromPlanes(bytes: Uint8Array, count: number, components: number): Uint16Array {
  const values = new Uint16Array(count * components);
  for (let k = 0; k < components; ++k) {
    const low = bytes.subarray(2 * k * count, (2 * k + 1) * count);
    const high = bytes.subarray((2 * k + 1) * count, (2 * k + 2) * count);
    let last = 0;
    for (let i = 0; i < count; ++i) {
      const code = low[i]! | (high[i]! << 8);
      last = (last + ((code >>> 1) ^ -(code & 1))) & 65535;
      values[i * components + k] = last;
    }
  }
  return values;
}

function decode(info: MapInfo, bytes: Uint8Array): MapData {
  const section: Record<string, Uint8Array> = {};
  let at = 0;
  for (const [name, size] of Object.entries(info.sections)) {
    section[name] = bytes.subarray(at, at + size);
    at += size;
  }
  const lists = JSON.parse(new TextDecoder().decode(section.charts)) as Record<keyof ChartInfo, (number | null)[]>;
  info.charts = lists.triangles.map((triangles, i) => ({
    triangles: triangles!,
    stretch: lists.stretch[i] ?? Infinity,
    angle: lists.angle[i] ?? Infinity,
    density: lists.density[i] ?? Infinity,
    mirrored: lists.mirrored[i] === 1,
  }));
  const n = info.triangles;
  const indices = new Uint32Array(3 * n);
  const codes = new Reader(section.indices!);
  for (let i = 0, next = 0; i < indices.length; ++i) {
    const back = codes.varint();
    indices[i] = next - back;
    if (back === 0) ++next;
  }
  const running = <T extends Uint32Array | Int32Array>(name: string, into: T): T => {
    const reader = new Reader(section[name]!);
    for (let i = 0, last = 0; i < into.length; ++i) into[i] = last += reader.signed();
    return into;
  };
  return {
    info,
    indices,
    positions: fromPlanes(section.positions!, info.places, 3),
    uv: fromPlanes(section.uv!, info.places, 2),
    chart: running('chart', new Uint32Array(n)),
    stretch: section.stretch!,
    angle: section.angle!,
    faults: section.faults!,
    polygon: running('polygon', new Uint32Array(n)),
    material: running('material', new Int32Array(n)),
    outline: running('outline', new Uint32Array(countVarints(section.outline!))),
    texture: section.texture ? running('texture', new Int32Array(n)) : null,
    colors: section.colors ?? null,
    uvFine: section.uvFine ? fromPlanes(section.uvFine, info.places, 2) : null,
    visibility: section.visibility!,
    seams: section.seams!,
  };
}

function countVarints(bytes: Uint8Array): number {
  let count = 0;
  for (const byte of bytes) count += byte < 128 ? 1 : 0;
  return count;
}

function bytesOf(base64: string): Uint8Array {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

async function inflate(base64: string): Promise<Uint8Array> {
  const stream = new Blob([bytesOf(base64)]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

export async function readPage(): Promise<{ page: PageInfo; maps: MapData[] }> {
  const page = JSON.parse(document.getElementById('planish-page')!.textContent!) as PageInfo;
  const maps: MapData[] = [];
  for (const [i, info] of page.maps.entries()) {
    const element = document.getElementById(`planish-map-${i}`)!;
    maps.push(decode(info, await inflate(element.textContent!.trim())));
    element.remove(); // its text is of no more use, and may be large
  }
  return { page, maps };
}

// The images of the page, with the values that their files have. To be called once.
export function readImages(page: PageInfo): Promise<ImageBitmap[]> {
  return Promise.all((page.images ?? []).map(({ type }, i) => {
    const element = document.getElementById(`planish-image-${i}`)!;
    const blob = new Blob([bytesOf(element.textContent!.trim())], { type });
    element.remove();
    return createImageBitmap(blob, { premultiplyAlpha: 'none', colorSpaceConversion: 'none' });
  }));
}
