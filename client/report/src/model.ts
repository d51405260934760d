// One map on the graphics card, for both views.
import * as THREE from 'three';
import { FAULTS, type Finding, type ImageUse, type MapData, type TextureInfo } from './data';
import {
  FACE_FRAGMENT, FACE_VERTEX, LINE_FRAGMENT, LINE_VERTEX, PICK_FRAGMENT, SEAM_FRAGMENT, TEXTURE_WIDTH, WIRE_VERTEX, type Mode,
  MODES,
} from './shaders';

type Numbers = Uint8Array | Uint16Array | Uint32Array;

function dataTexture<T extends Numbers>(
  values: T, components: number, format: THREE.PixelFormat, type: THREE.TextureDataType, internal: THREE.PixelFormatGPU,
): THREE.DataTexture {
  const texels = values.length / components;
  const height = Math.max(1, Math.ceil(texels / TEXTURE_WIDTH));
  const size = TEXTURE_WIDTH * height * components;
  let padded: Numbers = values;
  if (values.length !== size) {
    padded = new (values.constructor as new (n: number) => T)(size);
    padded.set(values);
  }
  const texture = new THREE.DataTexture(padded, TEXTURE_WIDTH, height, format, type);
  texture.internalFormat = internal;
  texture.unpackAlignment = 1;
  texture.needsUpdate = true;
  return texture;
}

// Normals of the surface at each place, averaged where places have the same position. Each is two bytes, which unfold
// an octahedron.
function packedNormals(data: MapData): Uint16Array {
  const { positions, indices, info } = data;
  // Per place: the first place at the same position.
  let size = 1;
  while (size < 2 * info.places) size *= 2;
  const slots = new Int32Array(size).fill(-1);
  const first = new Uint32Array(info.places);
  for (let v = 0; v < info.places; ++v) {
    const x = positions[3 * v]!, y = positions[3 * v + 1]!, z = positions[3 * v + 2]!;
    let slot = (Math.imul(x, 73856093) ^ Math.imul(y, 19349663) ^ Math.imul(z, 83492791)) & (size - 1);
    for (;;) {
      const other = slots[slot]!;
      if (other < 0) {
        slots[slot] = v;
        first[v] = v;
        break;
      }
      if (positions[3 * other] === x && positions[3 * other + 1] === y && positions[3 * other + 2] === z) {
        first[v] = other;
        break;
      }
      slot = (slot + 1) & (size - 1);
    }
  }
  const sum = new Float32Array(3 * info.places);
  for (let f = 0; f < info.triangles; ++f) {
    const a = first[indices[3 * f]!]!, b = first[indices[3 * f + 1]!]!, c = first[indices[3 * f + 2]!]!;
    const ux = positions[3 * b]! - positions[3 * a]!, uy = positions[3 * b + 1]! - positions[3 * a + 1]!,
      uz = positions[3 * b + 2]! - positions[3 * a + 2]!;
    const vx = positions[3 * c]! - positions[3 * a]!, vy = positions[3 * c + 1]! - positions[3 * a + 1]!,
      vz = positions[3 * c + 2]! - positions[3 * a + 2]!;
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    for (const v of [a, b, c]) {
      sum[3 * v]! += nx;
      sum[3 * v + 1]! += ny;
      sum[3 * v + 2]! += nz;
    }
  }
  const packed = new Uint16Array(info.places);
  for (let v = 0; v < info.places; ++v) {
    let x = sum[3 * first[v]!]!, y = sum[3 * first[v]! + 1]!, z = sum[3 * first[v]! + 2]!;
    const scale = 1 / (Math.abs(x) + Math.abs(y) + Math.abs(z) || 1);
    x *= scale;
    y *= scale;
    z *= scale;
    if (z < 0) [x, y] = [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1)];
    packed[v] = Math.round(127.5 * (x + 1)) | (Math.round(127.5 * (y + 1)) << 8);
  }
  return packed;
}

function integers(values: Numbers, components: number): THREE.BufferAttribute {
  const attribute = new THREE.BufferAttribute(values, components);
  attribute.gpuType = THREE.IntType;
  return attribute;
}

// The triangles, each with a provoking vertex of its own, from which its flat values come. A place can be the provoking
// vertex of one triangle; if all three places of a triangle are taken, the last one is copied.
function drawable(data: MapData, places: Uint16Array, firstProvokes: boolean): THREE.BufferGeometry {
  const { indices, uv, info } = data, n = info.triangles;
  const taken = new Uint8Array(info.places);
  let copies = 0;
  const provoking = new Uint8Array(n); // corner of each triangle; 3: a copy of the last corner
  for (let f = 0; f < n; ++f) {
    let k = 0;
    while (k < 3 && taken[indices[3 * f + k]!]) ++k;
    provoking[f] = k;
    if (k < 3) taken[indices[3 * f + k]!] = 1;
    else ++copies;
  }
  const size = info.places + copies;
  const place = new Uint16Array(4 * size), texcoord = new Uint16Array(2 * size), face = new Uint32Array(size);
  const fine = data.texture ? new Uint16Array(2 * size).fill(32768) : null;
  const colors = data.texture ? new Uint8Array(4 * size).fill(255) : null;
  place.set(places);
  texcoord.set(uv);
  if (data.uvFine) fine?.set(data.uvFine);
  if (data.colors) colors?.set(data.colors);
  const index = new Uint32Array(3 * n);
  for (let f = 0, next = info.places; f < n; ++f) {
    const k = provoking[f]! % 3, corner = provoking[f] === 3 ? 2 : k;
    let vertex = indices[3 * f + corner]!;
    if (provoking[f] === 3) {
      place.copyWithin(4 * next, 4 * vertex, 4 * vertex + 4);
      texcoord.copyWithin(2 * next, 2 * vertex, 2 * vertex + 2);
      fine?.copyWithin(2 * next, 2 * vertex, 2 * vertex + 2);
      colors?.copyWithin(4 * next, 4 * vertex, 4 * vertex + 4);
      vertex = next++;
    }
    face[vertex] = f;
    const others = [indices[3 * f + ((corner + 1) % 3)]!, indices[3 * f + ((corner + 2) % 3)]!];
    index.set(firstProvokes ? [vertex, ...others] : [...others, vertex], 3 * f);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setIndex(new THREE.BufferAttribute(index, 1));
  geometry.setAttribute('aPlace', integers(place, 4));
  geometry.setAttribute('aUv', integers(texcoord, 2));
  geometry.setAttribute('aFace', integers(face, 1));
  if (fine) geometry.setAttribute('aFine', integers(fine, 2));
  if (colors) geometry.setAttribute('aColor', integers(colors, 4));
  return geometry;
}

// Splits a geometry by texture; the last part has the triangles without one.
function byTexture(geometry: THREE.BufferGeometry, texture: Int32Array, textures: TextureInfo[]): THREE.BufferGeometry[] {
  const slotOf = (t: number): number => (t >= 0 && t < textures.length ? t : textures.length);
  const sizes = new Uint32Array(textures.length + 1);
  for (const t of texture) sizes[slotOf(t)]! += 3;
  const all = geometry.getIndex()!.array as Uint32Array;
  const parts = Array.from(sizes, (size) => new Uint32Array(size));
  sizes.fill(0);
  texture.forEach((t, f) => {
    const slot = slotOf(t);
    for (let k = 0; k < 3; ++k) parts[slot]![sizes[slot]!++] = all[3 * f + k]!;
  });
  return parts.map((index) => {
    const part = new THREE.BufferGeometry();
    for (const [name, attribute] of Object.entries(geometry.attributes)) part.setAttribute(name, attribute);
    part.setIndex(new THREE.BufferAttribute(index, 1));
    return part;
  });
}

// For triangles without a material, if there are vertex colours: shows these colours alone.
const PLAIN: TextureInfo = {
  image: -1, transform: [1, 0, 0, 0, 1, 0], wrap: ['repeat', 'repeat'], nearest: false, factor: [1, 1, 1, 1], alpha: 'opaque', cutoff: 0,
};
const WHITE = new THREE.DataTexture(new Uint8Array(4).fill(255), 1, 1);
WHITE.needsUpdate = true;

const WRAPS = { repeat: THREE.RepeatWrapping, mirror: THREE.MirroredRepeatWrapping, clamp: THREE.ClampToEdgeWrapping };
const ALPHAS = ['opaque', 'mask', 'blend'];

// An image as a texture reads it, with mipmaps: colours in linear light, other values unchanged.
function imageTexture(image: ImageBitmap, info: ImageUse, isColor: boolean, anisotropy: number): THREE.Texture {
  const texture = new THREE.Texture(image);
  texture.wrapS = WRAPS[info.wrap[0]];
  texture.wrapT = WRAPS[info.wrap[1]];
  texture.magFilter = info.nearest ? THREE.NearestFilter : THREE.LinearFilter;
  texture.minFilter = THREE.LinearMipmapLinearFilter;
  texture.anisotropy = anisotropy;
  texture.colorSpace = isColor ? THREE.SRGBColorSpace : THREE.NoColorSpace;
  texture.flipY = false;
  texture.needsUpdate = true;
  return texture;
}

const matrixOf = ({ transform }: ImageUse): THREE.Matrix3 =>
  new THREE.Matrix3(...(transform as [number, number, number, number, number, number]), 0, 0, 1);

// One map. Both views draw it with the same uniforms, so modes and marks are the same in both.
export class MapModel {
  readonly surface = new THREE.Scene();
  readonly layout = new THREE.Scene();
  readonly surfacePick = new THREE.Scene();
  readonly layoutPick = new THREE.Scene();
  readonly box: THREE.Box3;
  readonly uvBox: THREE.Box2;
  private readonly faceValues: Uint8Array; // stretch, angle, faults, marked
  private readonly faceTexture: THREE.DataTexture;
  private readonly uniforms: Record<string, THREE.IUniform>;
  private readonly lines: { surface: THREE.RawShaderMaterial; outline: THREE.RawShaderMaterial; padding: THREE.RawShaderMaterial };
  private readonly paddingMesh: THREE.Mesh;
  private readonly surfaceLines: THREE.Mesh;
  private readonly geometry: THREE.BufferGeometry;
  private readonly faces: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>[] = []; // on the surface, in the layout
  private textured: THREE.Mesh[] = []; // instead of `faces`, once there are images
  private wires: THREE.LineSegments[] = []; // made when they are first asked for

  // firstProvokes: whether the flat values of a triangle come from its first vertex; otherwise from its last one.
  constructor(readonly data: MapData, firstProvokes: boolean) {
    const { info } = data;
    const size = new THREE.Vector3(1, 1, 1).multiplyScalar(info.size);
    this.box = new THREE.Box3(new THREE.Vector3(...info.low), new THREE.Vector3(...info.low).add(size));
    this.uvBox = new THREE.Box2(
      new THREE.Vector2(...info.uvLow), new THREE.Vector2(...info.uvLow).addScalar(info.uvSize),
    );
    const normals = packedNormals(data);
    const places = new Uint16Array(4 * info.places);
    for (let v = 0; v < info.places; ++v) {
      for (let k = 0; k < 3; ++k) places[4 * v + k] = data.positions[3 * v + k]!;
      places[4 * v + 3] = normals[v]!;
    }
    this.faceValues = new Uint8Array(4 * TEXTURE_WIDTH * Math.max(1, Math.ceil(info.triangles / TEXTURE_WIDTH)));
    const groups = new Uint32Array(2 * info.triangles);
    for (let f = 0; f < info.triangles; ++f) {
      this.faceValues[4 * f] = data.stretch[f]!;
      this.faceValues[4 * f + 1] = data.angle[f]!;
      this.faceValues[4 * f + 2] = data.faults[f]!;
      groups[2 * f] = data.chart[f]!;
      groups[2 * f + 1] = data.material[f]! + 1 + 2 ** 24 * data.visibility[f]!;
    }
    this.faceTexture = dataTexture(
      this.faceValues, 4, THREE.RGBAIntegerFormat, THREE.UnsignedByteType, 'RGBA8UI',
    );
    const colors = new Uint8Array(4 * (info.materials.length + 1));
    [{ color: [0.72, 0.72, 0.74] }, ...info.materials].forEach(({ color }, i) => {
      colors.set([...color.map((x) => Math.round(255 * Math.min(1, Math.max(0, x)))), 255], 4 * i);
    });
    const materials = new THREE.DataTexture(colors, info.materials.length + 1, 1);
    materials.needsUpdate = true;
    this.uniforms = {
      tPlace: { value: dataTexture(places, 4, THREE.RGBAIntegerFormat, THREE.UnsignedShortType, 'RGBA16UI') },
      tUv: { value: dataTexture(data.uv, 2, THREE.RGIntegerFormat, THREE.UnsignedShortType, 'RG16UI') },
      tFace: { value: this.faceTexture },
      tChart: { value: dataTexture(groups, 2, THREE.RGIntegerFormat, THREE.UnsignedIntType, 'RG32UI') },
      tMaterial: { value: materials },
      uLow: { value: new THREE.Vector3(...info.low) },
      uSize: { value: info.size },
      uUvLow: { value: new THREE.Vector2(...info.uvLow) },
      uUvSize: { value: info.uvSize },
      uMode: { value: 0 },
      uHover: { value: -1 },
      uSelected: { value: -1 },
      uMarks: { value: true },
      uChecker: { value: 48 },
      uStretchTop: { value: 1 },
      uAngleTop: { value: 20 },
      uLight: { value: 0.9 },
      uPage: { value: new THREE.Vector3() },
    };
    this.geometry = drawable(data, places, firstProvokes);
    for (const [scene, isLayout, isPick] of [
      [this.surface, false, false], [this.layout, true, false], [this.surfacePick, false, true], [this.layoutPick, true, true],
    ] as const) {
      const material = new THREE.RawShaderMaterial({
        glslVersion: THREE.GLSL3,
        uniforms: this.uniforms,
        vertexShader: FACE_VERTEX,
        fragmentShader: isPick ? PICK_FRAGMENT : FACE_FRAGMENT,
        defines: isLayout ? { LAYOUT: '' } : {},
        side: THREE.DoubleSide,
        depthTest: !isLayout,
        depthWrite: !isLayout,
        blending: THREE.NoBlending,
      });
      const mesh = new THREE.Mesh(this.geometry, material);
      mesh.frustumCulled = false;
      scene.add(mesh);
      if (!isPick) this.faces.push(mesh);
    }
    // Surface seams lie over the faces, padding below them, outlines on top.
    const line = (isLayout: boolean): THREE.RawShaderMaterial =>
      new THREE.RawShaderMaterial({
        glslVersion: THREE.GLSL3,
        uniforms: {
          ...this.uniforms,
          uViewport: { value: new THREE.Vector2(1, 1) },
          uWidth: { value: 1.5 },
          uWidthInMap: { value: false },
          uByVisibility: { value: false },
          uColor: { value: new THREE.Vector4(0, 0, 0, 1) },
        },
        vertexShader: LINE_VERTEX,
        fragmentShader: SEAM_FRAGMENT,
        defines: isLayout ? { LAYOUT: '' } : {},
        side: THREE.DoubleSide,
        transparent: true,
        depthTest: !isLayout,
        depthWrite: false,
      });
    this.lines = { surface: line(false), outline: line(true), padding: line(true) };
    const geometry = this.lineGeometry();
    const mesh = (material: THREE.RawShaderMaterial, order: number): THREE.Mesh => {
      const lines = new THREE.Mesh(geometry, material);
      lines.frustumCulled = false;
      lines.renderOrder = order;
      return lines;
    };
    this.surfaceLines = mesh(this.lines.surface, 1);
    this.surface.add(this.surfaceLines);
    this.paddingMesh = mesh(this.lines.padding, -1);
    this.layout.add(this.paddingMesh, mesh(this.lines.outline, 1));
  }

  private lineGeometry(): THREE.InstancedBufferGeometry {
    const { outline, indices, seams } = this.data;
    const ends = new Uint32Array(3 * outline.length);
    outline.forEach((c, i) => {
      const first = c - (c % 3);
      ends[3 * i] = indices[first + ((c + 1) % 3)]!;
      ends[3 * i + 1] = indices[first + ((c + 2) % 3)]!;
      ends[3 * i + 2] = seams[i]!;
    });
    const geometry = new THREE.InstancedBufferGeometry();
    const attribute = new THREE.InstancedBufferAttribute(ends, 3);
    attribute.gpuType = THREE.IntType;
    geometry.setAttribute('ends', attribute);
    geometry.setDrawRange(0, 6);
    geometry.instanceCount = outline.length;
    return geometry;
  }

  setImages(images: ImageBitmap[], anisotropy: number): void {
    const { texture, info, colors } = this.data, { textures = [] } = info;
    if (!texture) return;
    const drawn = new Map<string, THREE.Texture>();
    const imageOf = (info: ImageUse, isColor: boolean): THREE.Texture => {
      if (info.image < 0) return WHITE;
      const key = `${info.image} ${info.wrap.join()} ${info.nearest} ${isColor}`;
      if (!drawn.has(key)) drawn.set(key, imageTexture(images[info.image]!, info, isColor, anisotropy));
      return drawn.get(key)!;
    };
    for (const [i, geometry] of byTexture(this.geometry, texture, textures).entries()) {
      if (geometry.getIndex()!.count === 0) continue;
      const of = textures[i] ?? (colors ? PLAIN : undefined);
      for (const [k, scene] of [this.surface, this.layout].entries()) {
        let material = this.faces[k]!.material;
        if (of) {
          material = material.clone();
          material.defines = { ...material.defines, TEXTURED: '', ...(of.normals && { NORMALS: '' }) };
          material.uniforms = {
            ...this.uniforms,
            tImage: { value: imageOf(of, true) },
            uTransform: { value: matrixOf(of) },
            ...(of.normals && {
              tNormals: { value: imageOf(of.normals, false) },
              uToNormals: { value: matrixOf(of.normals) },
              uNormalScale: { value: of.normals.scale },
            }),
            uFactor: { value: new THREE.Vector4(...of.factor) },
            uAlpha: { value: ALPHAS.indexOf(of.alpha) },
            uCutoff: { value: of.cutoff },
          };
        }
        const mesh = new THREE.Mesh(geometry, material);
        mesh.frustumCulled = false;
        scene.add(mesh);
        this.textured.push(mesh);
      }
    }
  }
  setPage(color: THREE.Color): void {
    this.uniforms.uPage!.value.set(color.r, color.g, color.b);
  }

  setMode(mode: Mode, isDark: boolean): void {
    this.uniforms.uMode!.value = MODES.indexOf(mode);
    const isTextured = mode === 'textured' && this.textured.length > 0;
    for (const mesh of this.faces) mesh.visible = !isTextured;
    for (const mesh of this.textured) mesh.visible = isTextured;
    this.uniforms.uLight!.value = isDark ? 0.16 : 0.93;
    const isSeams = mode === 'seams';
    for (const lines of [this.lines.surface, this.lines.outline]) lines.uniforms.uByVisibility!.value = isSeams;
    this.lines.surface.uniforms.uColor!.value.set(...(isSeams ? [0.84, 0.15, 0.35, 1] : [0.05, 0.05, 0.1, 0.55]));
    this.lines.surface.uniforms.uWidth!.value = isSeams ? 3.2 : 1.4;
    this.lines.outline.uniforms.uColor!.value.set(...(isSeams ? [0.84, 0.15, 0.35, 1] : isDark ? [0.02, 0.02, 0.05, 0.9] : [0.1, 0.1, 0.18, 0.9]));
    this.lines.outline.uniforms.uWidth!.value = isSeams ? 2.2 : 1.2;
    this.lines.padding.uniforms.uColor!.value.set(...(isDark ? [0.3, 0.55, 0.95, 0.22] : [0.15, 0.4, 0.85, 0.16]));
  }
  setSeams(isShown: boolean, mode: Mode): void {
    this.surfaceLines.visible = isShown || mode === 'seams';
  }
  setRanges(stretch: number, angle: number): void {
    this.uniforms.uStretchTop!.value = stretch;
    this.uniforms.uAngleTop!.value = angle;
  }
  setWireframe(isOn: boolean): void {
    if (isOn && this.wires.length === 0) this.makeWires();
    for (const wires of this.wires) wires.visible = isOn;
    if (isOn) this.surfaceLines.visible = true; // seams are edges too
  }

  // Takes the edges that run from the lower place to the higher one. An edge between two triangles runs in opposite
  // directions in the two, and so is taken once. Edges of a single triangle are outlines, which are drawn anyway.
  private makeWires(): void {
    const { indices, info } = this.data;
    const edges = new Uint32Array(6 * info.triangles);
    let size = 0;
    for (let c = 0; c < 3 * info.triangles; ++c) {
      const a = indices[c]!, b = indices[c % 3 === 2 ? c - 2 : c + 1]!;
      if (a >= b) continue;
      edges[size++] = a;
      edges[size++] = b;
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setIndex(new THREE.BufferAttribute(edges.slice(0, size), 1));
    for (const name of ['aPlace', 'aUv']) geometry.setAttribute(name, this.geometry.getAttribute(name));
    for (const [scene, isLayout] of [[this.surface, false], [this.layout, true]] as const) {
      const material = new THREE.RawShaderMaterial({
        glslVersion: THREE.GLSL3,
        uniforms: { ...this.uniforms, uColor: { value: new THREE.Vector4(0.03, 0.03, 0.06, 0.42) } },
        vertexShader: WIRE_VERTEX,
        fragmentShader: LINE_FRAGMENT,
        defines: isLayout ? { LAYOUT: '' } : {},
        transparent: true,
        depthTest: !isLayout,
        depthWrite: false,
      });
      const wires = new THREE.LineSegments(geometry, material);
      wires.frustumCulled = false;
      wires.renderOrder = 0.5;
      scene.add(wires);
      this.wires.push(wires);
    }
  }
  setChecker(cells: number): void {
    this.uniforms.uChecker!.value = cells;
  }
  setHover(face: number): void {
    this.uniforms.uHover!.value = face;
  }
  setSelected(chart: number): void {
    this.uniforms.uSelected!.value = chart;
  }
  // Shows half of the padding on either side of every outline.
  setPadding(isShown: boolean): void {
    const { padding, textureSize } = this.data.info;
    this.paddingMesh.visible = isShown && padding > 0;
    this.lines.padding.uniforms.uWidthInMap!.value = true;
    this.lines.padding.uniforms.uWidth!.value = padding / textureSize;
  }
  setViewport(pixels: THREE.Vector2, ratio: number): void {
    for (const material of Object.values(this.lines)) material.uniforms.uViewport!.value.copy(pixels).divideScalar(ratio);
  }

  // Marks these triangles and no others.
  setMarked(faces: Iterable<number>): void {
    for (let i = 3; i < this.faceValues.length; i += 4) this.faceValues[i] = 0;
    for (const face of faces) this.faceValues[4 * face + 3] = 1;
    this.faceTexture.needsUpdate = true;
  }

  facesOf(finding: Finding): number[] {
    if (finding.faces) return finding.faces;
    const faces: number[] = [];
    const { faults, chart } = this.data;
    for (let f = 0; f < faults.length; ++f) {
      if (finding.fault !== undefined && (faults[f]! & finding.fault) !== 0) faces.push(f);
      else if (finding.charts?.includes(chart[f]!)) faces.push(f);
    }
    return faces;
  }
  facesOfChart(chart: number): number[] {
    const faces: number[] = [];
    this.data.chart.forEach((c, f) => {
      if (c === chart) faces.push(f);
    });
    return faces;
  }

  place(corner: number): THREE.Vector3 {
    const v = this.data.indices[corner]!, { positions, info } = this.data;
    return new THREE.Vector3(
      info.low[0] + (info.size * positions[3 * v]!) / 65535,
      info.low[1] + (info.size * positions[3 * v + 1]!) / 65535,
      info.low[2] + (info.size * positions[3 * v + 2]!) / 65535,
    );
  }
  uv(corner: number): THREE.Vector2 {
    const v = this.data.indices[corner]!, { uv, info } = this.data;
    return new THREE.Vector2(
      info.uvLow[0] + (info.uvSize * uv[2 * v]!) / 65535, info.uvLow[1] + (info.uvSize * uv[2 * v + 1]!) / 65535,
    );
  }

  // Where these triangles lie on the surface and in the map, and their mean normal.
  extentOf(faces: number[]): { centre: THREE.Vector3; radius: number; normal: THREE.Vector3; uv: THREE.Box2 } {
    const box = new THREE.Box3(), uv = new THREE.Box2(), normal = new THREE.Vector3();
    const step = Math.max(1, Math.floor(faces.length / 20000));
    for (let i = 0; i < faces.length; i += step) {
      const f = faces[i]!;
      const [a, b, c] = [this.place(3 * f), this.place(3 * f + 1), this.place(3 * f + 2)];
      for (const p of [a, b, c]) box.expandByPoint(p);
      for (let k = 0; k < 3; ++k) uv.expandByPoint(this.uv(3 * f + k));
      normal.add(b.sub(a).cross(c.sub(a)));
    }
    const centre = box.getCenter(new THREE.Vector3());
    const radius = Math.max(box.getSize(new THREE.Vector3()).length() / 2, 0.004 * this.data.info.size);
    if (normal.length() === 0) normal.set(0, 0, 1);
    return { centre, radius, normal: normal.normalize(), uv };
  }

  // The value up to which `part` of all values lie, for the ends of the colour scales. At most 254: 255 is no value.
  quantile(values: Uint8Array, part: number): number {
    const counts = new Uint32Array(256);
    for (const value of values) ++counts[value]!;
    let below = 0;
    for (let i = 0; i < 255; ++i) {
      below += counts[i]!;
      if (below >= part * values.length) return i;
    }
    return 254;
  }
}

export const FAULT_NAMES = Object.keys(FAULTS) as (keyof typeof FAULTS)[];
