// The drawing area: for each map that is shown a view of the surface and one of the layout, all on one canvas. All
// surfaces have the same camera, and all layouts.
import * as THREE from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import type { MapData } from './data';
import { MapModel } from './model';
import { GRID_FRAGMENT, GRID_VERTEX, type Mode } from './shaders';

export interface Hit {
  map: number;
  face: number;
}

interface ProvokingVertex {
  FIRST_VERTEX_CONVENTION_WEBGL: number;
  provokingVertexWEBGL(mode: number): void;
}

interface Pane {
  map: number;
  isLayout: boolean;
  x: number; // CSS pixels, from the top left of the canvas
  y: number;
  width: number;
  height: number;
}

const GAP = 2;
const FLIGHT_MS = 350;
const FIELD = 38; // degrees along the shorter side of a view

// Degrees from the bottom to the top of a view.
function fieldOfView(aspect: number): number {
  const half = (FIELD * Math.PI) / 360;
  return (360 / Math.PI) * Math.atan(Math.tan(half) / Math.min(1, aspect));
}

export class Viewer {
  readonly models: MapModel[];
  onHover: (hit: Hit | null, x: number, y: number) => void = () => {};
  onClick: (hit: Hit | null) => void = () => {};
  onDraw: () => void = () => {};

  private readonly renderer: THREE.WebGLRenderer;
  private readonly camera = new THREE.PerspectiveCamera(FIELD, 1, 0.01, 100);
  private readonly uvCamera = new THREE.OrthographicCamera(-1, 1, 1, -1, -1, 1);
  private readonly uvView = { centre: new THREE.Vector2(0.5, 0.5), half: 0.54 }; // half of the shorter side
  private readonly controls: OrbitControls;
  private readonly pickTarget = new THREE.WebGLRenderTarget(1, 1, { depthBuffer: true });
  private readonly grid: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  private readonly gridScene = new THREE.Scene();
  private readonly sphere: THREE.Sphere;
  private readonly samples: THREE.Vector3[] = []; // places of the surfaces
  private panes: Pane[] = [];
  private shown: number[];
  private needsFrame = false;
  private isLoading = false;
  private pointer: { x: number; y: number } | null = null;
  private press: { x: number; y: number; isLayout: boolean; moved: boolean } | null = null;
  private flight: { start: number; from: THREE.Vector3[]; to: THREE.Vector3[]; uvFrom: number[]; uvTo: number[] } | null = null;
  frames = 0;

  constructor(private readonly canvas: HTMLCanvasElement, maps: MapData[]) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, powerPreference: 'high-performance' });
    this.renderer.autoClear = false;
    // By default the last vertex provokes, which is slow in some graphics interfaces: asks for the first one.
    const provoking = this.renderer.getContext().getExtension('WEBGL_provoking_vertex') as ProvokingVertex | null;
    provoking?.provokingVertexWEBGL(provoking.FIRST_VERTEX_CONVENTION_WEBGL);
    this.models = maps.map((data) => new MapModel(data, provoking !== null));
    this.shown = maps.map((_, i) => i);
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace; // the shaders write display colours
    this.sphere = this.tightSphere();
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener('change', () => this.redraw());
    this.grid = new THREE.Mesh(
      new THREE.BufferGeometry(),
      new THREE.RawShaderMaterial({
        glslVersion: THREE.GLSL3,
        vertexShader: GRID_VERTEX,
        fragmentShader: GRID_FRAGMENT,
        depthTest: false,
        depthWrite: false,
        uniforms: {
          uCentre: { value: this.uvView.centre },
          uHalf: { value: new THREE.Vector2() },
          uViewport: { value: new THREE.Vector2() },
          uTexels: { value: 1024 },
          uTiles: { value: new THREE.Vector4(0, 0, 1, 1) },
          uPage: { value: new THREE.Color() },
          uTile: { value: new THREE.Color() },
          uInk: { value: new THREE.Color() },
        },
      }),
    );
    this.grid.geometry.setDrawRange(0, 3);
    this.grid.frustumCulled = false;
    this.gridScene.add(this.grid);
    this.listen();
    this.reset(false);
    new ResizeObserver(() => {
      const { clientWidth, clientHeight } = canvas.parentElement!;
      const size = this.renderer.getSize(new THREE.Vector2());
      if (size.x !== clientWidth || size.y !== clientHeight) this.resize();
    }).observe(canvas.parentElement!);
    this.resize();
  }

  // The sphere around the vertices themselves: a box has corners where the surface has none.
  private tightSphere(): THREE.Sphere {
    for (const model of this.models) {
      const { info } = model.data;
      const step = Math.max(1, Math.floor(info.triangles / 20000));
      for (let f = 0; f < info.triangles; f += step) {
        for (let k = 0; k < 3; ++k) this.samples.push(model.place(3 * f + k));
      }
    }
    const box = new THREE.Box3().setFromPoints(this.samples);
    const sphere = box.getBoundingSphere(new THREE.Sphere());
    sphere.radius = Math.max(sphere.radius, 1e-30);
    return sphere;
  }

  // What the surfaces show in the mode "textured".
  async loadImages(images: Promise<ImageBitmap[]>): Promise<void> {
    this.isLoading = true;
    try {
      const loaded = await images;
      for (const model of this.models) model.setImages(loaded, this.renderer.capabilities.getMaxAnisotropy());
    } finally {
      this.isLoading = false;
    }
  }

  show(maps: number[]): void {
    this.shown = maps;
    this.resize();
  }

  setColors(page: string, tile: string, ink: string): void {
    const { uPage, uTile, uInk } = this.grid.material.uniforms;
    // Takes the numbers as they are: the page's colours are sRGB, and so is what the shaders write.
    for (const [uniform, text] of [[uPage, page], [uTile, tile], [uInk, ink]] as const) {
      (uniform!.value as THREE.Color).setStyle(text, THREE.LinearSRGBColorSpace);
    }
    for (const model of this.models) model.setPage(uPage!.value as THREE.Color);
    this.redraw();
  }

  setMode(mode: Mode, isDark: boolean, seams: boolean): void {
    for (const model of this.models) {
      model.setMode(mode, isDark);
      model.setSeams(seams, mode);
    }
    this.redraw();
  }

  reset(isAnimated = true): void {
    const direction = new THREE.Vector3(0.62, 0.34, 0.9).normalize();
    const position = this.sphere.center.clone().addScaledVector(direction, this.fittingDistance(direction));
    const uv = this.uvHome();
    if (isAnimated) return this.fly(position, this.sphere.center, uv.centre, uv.half);
    this.camera.position.copy(position);
    this.controls.target.copy(this.sphere.center);
    this.uvView.centre.copy(uv.centre);
    this.uvView.half = uv.half;
    this.controls.update();
    this.redraw();
  }

  // The distance from the middle of everything at which all of it is seen in a square view.
  private fittingDistance(direction: THREE.Vector3, above = new THREE.Vector3(0, 1, 0)): number {
    const right = above.clone().cross(direction).normalize(), up = direction.clone().cross(right);
    const slope = Math.tan((FIELD * Math.PI) / 360) * 0.94;
    let distance = 0;
    for (const p of this.samples) {
      const offset = p.clone().sub(this.sphere.center);
      const aside = Math.max(Math.abs(offset.dot(right)), Math.abs(offset.dot(up)));
      distance = Math.max(distance, offset.dot(direction) + aside / slope);
    }
    return Math.max(distance, 0.1 * this.sphere.radius);
  }

  private uvHome(): { centre: THREE.Vector2; half: number } {
    const box = new THREE.Box2(new THREE.Vector2(0, 0), new THREE.Vector2(1, 1));
    for (const model of this.models) box.union(model.uvBox);
    const size = box.getSize(new THREE.Vector2());
    return { centre: box.getCenter(new THREE.Vector2()), half: 0.53 * Math.max(size.x, size.y) };
  }

  // Flies to these triangles of a map, in both views.
  flyTo(map: number, faces: number[]): void {
    if (faces.length === 0) return;
    const { centre, radius, normal, uv } = this.models[map]!.extentOf(faces);
    const distance = (Math.max(radius, 0.01 * this.sphere.radius) / Math.sin((FIELD * Math.PI) / 360)) * 2.2;
    const size = uv.getSize(new THREE.Vector2());
    const texels = 24 / this.models[map]!.data.info.textureSize;
    this.fly(
      centre.clone().addScaledVector(normal, distance), centre, uv.getCenter(new THREE.Vector2()),
      Math.max(size.x, size.y, texels) * 1.1,
    );
  }

  private fly(position: THREE.Vector3, target: THREE.Vector3, centre: THREE.Vector2, half: number): void {
    this.flight = {
      start: performance.now(),
      from: [this.camera.position.clone(), this.controls.target.clone()],
      to: [position.clone(), target.clone()],
      uvFrom: [this.uvView.centre.x, this.uvView.centre.y, Math.log(this.uvView.half)],
      uvTo: [centre.x, centre.y, Math.log(half)],
    };
    this.redraw();
  }

  private stepFlight(): void {
    if (!this.flight) return;
    const { start, from, to, uvFrom, uvTo } = this.flight;
    const t = Math.min(1, (performance.now() - start) / FLIGHT_MS), s = t * t * (3 - 2 * t);
    this.camera.position.lerpVectors(from[0]!, to[0]!, s);
    this.controls.target.lerpVectors(from[1]!, to[1]!, s);
    const at = uvFrom.map((x, i) => x + (uvTo[i]! - x) * s);
    this.uvView.centre.set(at[0]!, at[1]!);
    this.uvView.half = Math.exp(at[2]!);
    if (t === 1) this.flight = null;
    this.controls.update();
    if (this.flight) this.redraw();
  }

  orbit(right: number, up: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const angles = new THREE.Spherical().setFromVector3(offset);
    angles.theta -= right;
    angles.phi = Math.min(Math.PI - 0.01, Math.max(0.01, angles.phi - up));
    this.camera.position.copy(this.controls.target).add(offset.setFromSpherical(angles));
    this.controls.update();
    this.redraw();
  }
  zoom(factor: number): void {
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.uvView.half *= factor;
    this.controls.update();
    this.redraw();
  }

  // Whether nothing moves, and the last requested frame is drawn.
  get isIdle(): boolean {
    return !this.needsFrame && !this.flight && !this.isLoading;
  }

  redraw(): void {
    if (this.needsFrame) return;
    this.needsFrame = true;
    requestAnimationFrame(() => {
      this.needsFrame = false;
      this.stepFlight();
      if (this.pointer) this.hover();
      this.draw();
    });
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.panes = [];
    const rows = this.shown.length;
    // Surfaces on the left, their layouts beside them; on a narrow page below.
    const isWide = width > height * 0.9 || rows > 1;
    this.shown.forEach((map, row) => {
      const h = height / rows, y = row * h;
      if (isWide) {
        const left = Math.round(width - Math.min(width * 0.5, h));
        this.panes.push({ map, isLayout: false, x: 0, y, width: left - GAP, height: h - (row + 1 < rows ? GAP : 0) });
        this.panes.push({ map, isLayout: true, x: left, y, width: width - left, height: h - (row + 1 < rows ? GAP : 0) });
      } else {
        this.panes.push({ map, isLayout: false, x: 0, y, width, height: h / 2 - GAP });
        this.panes.push({ map, isLayout: true, x: 0, y: y + h / 2, width, height: h / 2 });
      }
    });
    // Draws at once, as the canvas is empty now; but the first frame waits for the rest of the page.
    if (this.frames > 0) this.draw();
    else this.redraw();
  }

  private aim(pane: Pane): THREE.Camera {
    if (pane.isLayout) {
      const { centre, half } = this.uvView, shorter = Math.min(pane.width, pane.height);
      const x = (half * pane.width) / shorter, y = (half * pane.height) / shorter;
      this.uvCamera.left = centre.x - x;
      this.uvCamera.right = centre.x + x;
      this.uvCamera.bottom = centre.y - y;
      this.uvCamera.top = centre.y + y;
      this.uvCamera.updateProjectionMatrix();
      return this.uvCamera;
    }
    const distance = this.camera.position.distanceTo(this.sphere.center);
    this.camera.aspect = pane.width / pane.height;
    this.camera.far = distance + 1.05 * this.sphere.radius;
    this.camera.near = Math.max(this.camera.far / 5000, distance - 1.05 * this.sphere.radius);
    this.camera.fov = fieldOfView(this.camera.aspect);
    this.camera.updateProjectionMatrix();
    return this.camera;
  }

  draw(): void {
    ++this.frames;
    const ratio = this.renderer.getPixelRatio(), height = this.canvas.clientHeight;
    this.renderer.setRenderTarget(null);
    this.renderer.setScissorTest(false);
    const { uPage } = this.grid.material.uniforms;
    this.renderer.setClearColor(uPage!.value as THREE.Color, 1);
    this.renderer.clear();
    this.renderer.setScissorTest(true);
    for (const pane of this.panes) {
      const model = this.models[pane.map]!, bottom = height - pane.y - pane.height;
      this.renderer.setViewport(pane.x, bottom, pane.width, pane.height);
      this.renderer.setScissor(pane.x, bottom, pane.width, pane.height);
      const camera = this.aim(pane);
      const pixels = new THREE.Vector2(pane.width * ratio, pane.height * ratio);
      model.setViewport(pixels, ratio);
      if (pane.isLayout) this.drawGrid(pane, model, pixels);
      this.renderer.render(pane.isLayout ? model.layout : model.surface, camera);
    }
    this.renderer.setScissorTest(false);
    this.onDraw();
  }

  // Draws a whole surface from a direction: RGBA, rows from the bottom; alpha is 0 in the background.
  picture(map: number, direction: THREE.Vector3, size: number): Uint8Array {
    const up = new THREE.Vector3(...(Math.abs(direction.y) > 0.9 ? [0, 0, 1] : [0, 1, 0]));
    const camera = new THREE.PerspectiveCamera(FIELD, 1), distance = this.fittingDistance(direction, up);
    camera.up.copy(up);
    camera.position.copy(this.sphere.center).addScaledVector(direction, distance);
    camera.lookAt(this.sphere.center);
    camera.near = Math.max(distance / 5000, distance - 1.05 * this.sphere.radius);
    camera.far = distance + 1.05 * this.sphere.radius;
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    const target = new THREE.WebGLRenderTarget(size, size, { samples: 4 }), pixels = new Uint8Array(4 * size * size);
    this.renderer.setRenderTarget(target);
    this.renderer.setScissorTest(false);
    this.renderer.setClearColor(0, 0);
    this.renderer.clear();
    this.models[map]!.setViewport(new THREE.Vector2(size, size), 1);
    this.renderer.render(this.models[map]!.surface, camera);
    this.renderer.readRenderTargetPixels(target, 0, 0, size, size, pixels);
    this.renderer.setRenderTarget(null);
    target.dispose();
    this.redraw();
    return pixels;
  }

  private drawGrid(pane: Pane, model: MapModel, pixels: THREE.Vector2): void {
    const { uHalf, uViewport, uTexels, uTiles } = this.grid.material.uniforms, shorter = Math.min(pane.width, pane.height);
    uHalf!.value.set((this.uvView.half * pane.width) / shorter, (this.uvView.half * pane.height) / shorter);
    uViewport!.value.copy(pixels);
    uTexels!.value = model.data.info.textureSize;
    const tiles = [0, ...model.data.info.tiles];
    uTiles!.value.set(0, 0, Math.max(...tiles.map((t) => t % 10)) + 1, Math.max(...tiles.map((t) => Math.floor(t / 10))) + 1);
    this.renderer.render(this.gridScene, this.uvCamera);
  }

  private paneAt(x: number, y: number): Pane | null {
    return this.panes.find((p) => x >= p.x && y >= p.y && x < p.x + p.width && y < p.y + p.height) ?? null;
  }

  // The triangle that is seen at a place of the canvas.
  pick(x: number, y: number): Hit | null {
    const pane = this.paneAt(x, y);
    if (!pane) return null;
    const camera = this.aim(pane) as THREE.PerspectiveCamera | THREE.OrthographicCamera;
    camera.setViewOffset(pane.width, pane.height, x - pane.x, y - pane.y, 1, 1);
    const model = this.models[pane.map]!;
    this.renderer.setRenderTarget(this.pickTarget);
    this.renderer.setScissorTest(false);
    this.renderer.setClearColor(0, 0);
    this.renderer.clear();
    this.renderer.render(pane.isLayout ? model.layoutPick : model.surfacePick, camera);
    const pixel = new Uint8Array(4);
    this.renderer.readRenderTargetPixels(this.pickTarget, 0, 0, 1, 1, pixel);
    this.renderer.setRenderTarget(null);
    camera.clearViewOffset();
    const id = pixel[0]! + pixel[1]! * 256 + pixel[2]! * 65536 + pixel[3]! * 16777216;
    return id === 0 ? null : { map: pane.map, face: id - 1 };
  }

  private hover(): void {
    const { x, y } = this.pointer!;
    this.pointer = null;
    this.onHover(this.press ? null : this.pick(x, y), x, y);
  }

  // Where the middle of a triangle is on the canvas, in CSS pixels.
  screenOf(map: number, face: number, isLayout: boolean): { x: number; y: number; isInside: boolean } | null {
    const pane = this.panes.find((p) => p.map === map && p.isLayout === isLayout);
    if (!pane) return null;
    const model = this.models[map]!, centre = new THREE.Vector3();
    for (let k = 0; k < 3; ++k) {
      if (isLayout) {
        const uv = model.uv(3 * face + k);
        centre.add(new THREE.Vector3(uv.x, uv.y, 0));
      } else {
        centre.add(model.place(3 * face + k));
      }
    }
    const camera = this.aim(pane);
    camera.updateMatrixWorld();
    centre.divideScalar(3).project(camera);
    const isInside = Math.abs(centre.x) <= 1 && Math.abs(centre.y) <= 1;
    return { x: pane.x + ((centre.x + 1) / 2) * pane.width, y: pane.y + ((1 - centre.y) / 2) * pane.height, isInside };
  }

  private listen(): void {
    const canvas = this.canvas;
    const place = (event: MouseEvent): { x: number; y: number } => {
      const box = canvas.getBoundingClientRect();
      return { x: event.clientX - box.left, y: event.clientY - box.top };
    };
    // Runs before the controls, and disables them over the layout: they move only the surface.
    const choose = (event: MouseEvent): void => {
      const { x, y } = place(event);
      this.controls.enabled = this.paneAt(x, y)?.isLayout === false;
    };
    canvas.parentElement!.addEventListener('pointerdown', choose, true);
    canvas.parentElement!.addEventListener('wheel', choose, true);
    canvas.addEventListener('pointerdown', (event) => {
      const { x, y } = place(event), pane = this.paneAt(x, y);
      if (pane) this.press = { x, y, isLayout: pane.isLayout, moved: false };
      this.flight = null;
    });
    window.addEventListener('pointermove', (event) => {
      const { x, y } = place(event);
      if (this.press) {
        if (Math.hypot(x - this.press.x, y - this.press.y) > 3) this.press.moved = true;
        if (this.press.isLayout && this.press.moved) this.panLayout(event.movementX, event.movementY);
        return;
      }
      if (event.target !== canvas) return;
      this.pointer = { x, y };
      this.redraw();
    });
    window.addEventListener('pointerup', (event) => {
      const press = this.press;
      this.press = null;
      if (!press || press.moved || event.target !== canvas) return;
      const { x, y } = place(event);
      this.onClick(this.pick(x, y));
      this.redraw();
    });
    canvas.addEventListener('pointerleave', () => {
      this.pointer = null;
      this.onHover(null, 0, 0);
    });
    canvas.addEventListener('wheel', (event) => {
      const { x, y } = place(event), pane = this.paneAt(x, y);
      event.preventDefault();
      if (!pane?.isLayout) return;
      this.flight = null;
      const factor = Math.exp(Math.sign(event.deltaY) * Math.min(0.3, Math.abs(event.deltaY) * 0.0015));
      const scale = (2 * this.uvView.half) / Math.min(pane.width, pane.height);
      const dx = (x - pane.x - pane.width / 2) * scale, dy = (pane.y + pane.height / 2 - y) * scale;
      this.uvView.centre.x += dx * (1 - factor);
      this.uvView.centre.y += dy * (1 - factor);
      this.uvView.half *= factor;
      this.redraw();
    }, { passive: false });
  }

  private panLayout(dx: number, dy: number): void {
    const pane = this.panes.find((p) => p.isLayout)!;
    const scale = (2 * this.uvView.half) / Math.min(pane.width, pane.height);
    this.uvView.centre.x -= dx * scale;
    this.uvView.centre.y += dy * scale;
    this.redraw();
  }
}
