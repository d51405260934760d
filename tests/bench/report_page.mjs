// What a report costs: the time that `unwrap --report` adds, and how long the page takes to open in chromium, against
// an empty three.js page that draws the same buffers. Prints Markdown.
//   node report_page.mjs PLANISH CHROMIUM MESH WORK_DIR ROUNDS, where WORK_DIR/node_modules has playwright-core and three
import { execFileSync } from 'node:child_process';
import { readFileSync, statSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';

const [planish, chromiumPath, mesh, work, roundsText] = process.argv.slice(2);
const rounds = Number(roundsText);
const { chromium } = createRequire(join(resolve(work), 'x.js'))('playwright-core');
const at = (name) => join(resolve(work), name);
const median = (numbers) => numbers.toSorted((a, b) => a - b)[numbers.length >> 1];

function secondsOf(...flags) {
  const start = process.hrtime.bigint();
  const args = ['unwrap', mesh, '-o', at('map.obj'), '--threads=1', '--progress=none', '--quiet', ...flags];
  execFileSync(planish, args, { stdio: ['ignore', 'ignore', 'inherit'] });
  return Number(process.hrtime.bigint() - start) / 1e9;
}

// Reads a pixel, so that everything is drawn, and returns the milliseconds since the page was asked for.
const whenDrawn = () => new Promise((done) => {
  const look = () => {
    if (!(window.planishReport?.isIdle() ?? window.isDrawn)) return requestAnimationFrame(look);
    const gl = document.querySelector('canvas').getContext('webgl2');
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    return done(performance.now());
  };
  look();
});

async function opened(browser, file, look = null) {
  const page = await browser.newPage({ viewport: { width: 1280, height: 720 } });
  await page.goto(pathToFileURL(file).href, { waitUntil: 'commit' });
  const milliseconds = await page.evaluate(whenDrawn);
  const seen = look && await page.evaluate(look);
  await page.close();
  return { milliseconds, seen };
}

// What the report has unpacked, as base64, and how many triangles it is about.
const buffersOf = () => {
  const { indices, positions, uv } = window.planishReport.maps[0];
  return Object.fromEntries([['triangles', indices.length / 3], ...Object.entries({ indices, positions, uv }).map(([name, array]) => {
    const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
    let text = '';
    for (let i = 0; i < bytes.length; i += 32768) text += String.fromCharCode(...bytes.subarray(i, i + 32768));
    return [name, btoa(text)];
  })]);
};

// The surface on the left and its layout on the right, in a plain colour.
function emptyPage(buffers) {
  const three = readFileSync(at('node_modules/three/build/three.module.min.js'), 'utf8').replaceAll('</script', '<\\/script');
  return `<!doctype html><style>body { margin: 0 } canvas { width: 100vw; height: 100vh }</style><canvas></canvas>
${Object.entries(buffers).map(([name, text]) => `<script type="text/plain" id="${name}">${text}</script>`).join('\n')}
<script type="importmap">{ "imports": { "three": "data:text/javascript;base64,${Buffer.from(three).toString('base64')}" } }</script>
<script type="module">
import * as THREE from 'three';
const read = (name, Type) => {
  const text = atob(document.getElementById(name).textContent), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return new Type(bytes.buffer);
};
const index = new THREE.BufferAttribute(read('indices', Uint32Array), 1);
const meshOf = (name, components) => {
  const geometry = new THREE.BufferGeometry();
  geometry.setIndex(index);
  geometry.setAttribute('position', new THREE.BufferAttribute(read(name, Uint16Array), components, true));
  const mesh = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));
  mesh.frustumCulled = false;
  return mesh;
};
const renderer = new THREE.WebGLRenderer({ canvas: document.querySelector('canvas'), antialias: true });
renderer.setSize(innerWidth, innerHeight, false);
renderer.setScissorTest(true);
const camera = new THREE.OrthographicCamera(0, 1, 1, 0, -2, 2);
[meshOf('positions', 3), meshOf('uv', 2)].forEach((mesh, i) => {
  const view = [i * innerWidth / 2, 0, innerWidth / 2, innerHeight];
  renderer.setViewport(...view);
  renderer.setScissor(...view);
  renderer.render(mesh, camera);
});
window.isDrawn = true;
</script>`;
}

const table = [];
let bytes = 0;
for (const seams of ['auto', 'none']) {
  const plain = [], reported = [];
  for (let i = 0; i <= rounds; ++i) { // the first one is not counted
    const a = secondsOf(`--seams=${seams}`), b = secondsOf(`--seams=${seams}`, `--report=${at(`${seams}.html`)}`);
    if (i > 0) plain.push(a), reported.push(b);
    console.error(`seams=${seams}: ${a.toFixed(2)} s, with a report ${b.toFixed(2)} s`);
  }
  const ratios = plain.map((seconds, i) => reported[i] / seconds);
  if (seams === 'auto') bytes = statSync(at('auto.html')).size;
  table.push(`| writing, \`--seams=${seams}\` | ${median(plain).toFixed(2)} s | ${median(reported).toFixed(2)} s | ` +
    `${median(ratios).toFixed(3)} (${Math.min(...ratios).toFixed(3)} to ${Math.max(...ratios).toFixed(3)}) |`);
}
// Drawn without a graphics card; as root there is no sandbox.
const browser = await chromium.launch({
  executablePath: chromiumPath,
  args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});
const { seen: { triangles, ...buffers } } = await opened(browser, at('auto.html'), buffersOf);
writeFileSync(at('empty.html'), emptyPage(buffers));
const empty = [], report = [];
await opened(browser, at('empty.html'));
for (let i = 0; i < rounds; ++i) {
  empty.push((await opened(browser, at('empty.html'))).milliseconds);
  report.push((await opened(browser, at('auto.html'))).milliseconds);
  console.error(`opening: empty page ${empty.at(-1).toFixed(0)} ms, report ${report.at(-1).toFixed(0)} ms`);
}
await browser.close();
const ratios = empty.map((ms, i) => report[i] / ms);
table.push(`| opening in chromium | ${median(empty).toFixed(0)} ms | ${median(report).toFixed(0)} ms | ` +
  `${median(ratios).toFixed(2)} (${Math.min(...ratios).toFixed(2)} to ${Math.max(...ratios).toFixed(2)}) |`);
console.log(`
${triangles.toLocaleString('en')} triangles; a page of ${(bytes / triangles).toFixed(1)} bytes a triangle.

| | without | with a report | ratio, median (least to most) |
|---|--:|--:|--:|
${table.join('\n')}

Opening: "without" is the empty page; both until the first frame is drawn.`);
