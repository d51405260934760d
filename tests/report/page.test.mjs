// Pages of `planish report` in a browser, opened from disk.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, readFileSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { chromium } from 'playwright-core';
import { compareLooks } from './looks.mjs';
import { domes, png, spoiled, texturedTorus, threeMaterials } from './meshes.mjs';

const directory = mkdtempSync(join(tmpdir(), 'planish-report-'));
const at = (name) => join(directory, name);
const planish = (...args) => execFileSync(process.env.PLANISH, args, { stdio: ['ignore', 'pipe', 'pipe'] });
let browser;

before(async () => {
  browser = await chromium.launch({
    executablePath: process.env.CHROMIUM,
    // Drawn without a graphics card; as root there is no sandbox.
    args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
  });
});
after(async () => {
  await browser?.close();
  rmSync(directory, { recursive: true });
});

// A page that is open, with all it asked for and complained of.
class Report {
  static async open(file, options = {}) {
    const report = new this();
    report.page = await browser.newPage({ viewport: { width: 1280, height: 720 }, colorScheme: 'light', ...options });
    report.requests = [];
    report.complaints = [];
    report.page.on('request', (request) => report.requests.push(request.url()));
    report.page.on('console', (message) => {
      if (['error', 'warning'].includes(message.type())) report.complaints.push(message.text());
    });
    report.page.on('pageerror', (error) => report.complaints.push(String(error)));
    await report.page.goto(pathToFileURL(file).href);
    await report.settle();
    return report;
  }

  // Nothing but the file itself was asked for, and nothing went wrong.
  async close() {
    assert.equal(this.requests.length, 1, this.requests.join('\n'));
    assert.match(this.requests[0], /^file:/);
    // Software drawing makes chromium speak of slow reads.
    assert.deepEqual(this.complaints.filter((text) => !/GPU stall due to ReadPixels/.test(text)), []);
    await this.page.close();
  }

  async settle() {
    // waitForFunction() makes code from text, which the page's policy forbids.
    await this.page.evaluate(() => new Promise((done) => {
      const look = () => {
        const isIdle = window.planishReport?.isIdle() ?? false;
        requestAnimationFrame(isIdle ? () => requestAnimationFrame(done) : look);
      };
      look();
    }));
  }
  state() {
    return this.page.evaluate(() => window.planishReport.state());
  }
  async box() {
    return this.page.locator('canvas').boundingBox();
  }
  // The view of the surface, or of the layout, as an image.
  async pixels(isLayout, rows = 1, row = 0) {
    await this.settle();
    const box = await this.box(), height = box.height / rows;
    const size = Math.min(box.width / 2, height);
    const left = isLayout ? box.x + box.width - size : box.x;
    const width = isLayout ? size : box.width - size;
    const clip = { x: left + 4, y: box.y + row * height + 4, width: width - 8, height: height - 8 };
    return (await this.page.screenshot({ clip })).toString('base64');
  }
  // The pointer on a triangle; gives the place.
  async hover(map, face, isLayout) {
    const place = await this.page.evaluate(([m, f, l]) => window.planishReport.screenOf(m, f, l), [map, face, isLayout]);
    await this.page.mouse.move(place.x, place.y);
    await this.settle();
    return place;
  }
  async leave() {
    await this.page.mouse.move(200, 12);
    await this.settle();
  }
}

// A contact sheet, which draws nothing later.
class Sheet extends Report {
  async settle() {}
}

// A triangle of the surface that is seen.
async function seenFace(report) {
  const box = await report.box();
  const hit = await report.page.evaluate(([x, y, w, h]) => {
    for (let i = 0; i < 400; ++i) {
      const found = window.planishReport.pick(x + w * (0.1 + 0.018 * (i % 20)), y + h * (0.3 + 0.02 * Math.floor(i / 20)));
      // Its middle must be seen too.
      const middle = found && window.planishReport.screenOf(found.map, found.face, false);
      if (middle && window.planishReport.pick(middle.x, middle.y)?.face === found.face) return found;
    }
    return null;
  }, [box.x, box.y, box.width, box.height]);
  assert.notEqual(hit, null);
  return hit;
}

test('the page of spot shows, links and selects', async () => {
  planish('unwrap', join(process.env.PLANISH_TEST_DATA, 'spot_seam.obj'), '-o', at('spot.obj'), `--report=${at('spot.html')}`);
  assert.ok(statSync(at('spot.html')).size <= 25 * 23062 + 1e6);
  const report = await Report.open(at('spot.html'));
  const { page } = report;

  // Every mode has its own pixels, and the same mode the same ones.
  const seen = new Map();
  for (const mode of ['checker', 'charts', 'stretch', 'angle', 'seams', 'colour']) {
    await page.click(`[data-mode=${mode}]`);
    const pixels = await report.pixels(false);
    assert.equal(await report.pixels(false), pixels, mode);
    assert.equal(seen.get(pixels), undefined, `${mode} looks like ${seen.get(pixels)}`);
    seen.set(pixels, mode);
    assert.equal((await report.state()).mode, mode);
  }
  await page.keyboard.press('7'); // for pages with images
  assert.equal((await report.state()).mode, 'colour');
  const still = await report.pixels(false);
  await page.click('[data-toggle=wireframe]');
  assert.notEqual(await report.pixels(false), still);
  await page.click('[data-toggle=wireframe]');
  assert.equal(await report.pixels(false), still);

  // Dragging turns the surface and leaves the layout; the wheel zooms; Reset takes both back.
  const layout = await report.pixels(true), box = await report.box();
  await page.mouse.move(box.x + 200, box.y + 300);
  await page.mouse.down();
  await page.mouse.move(box.x + 290, box.y + 320, { steps: 4 });
  await page.mouse.up();
  await report.leave();
  const turned = await report.pixels(false);
  assert.notEqual(turned, still);
  assert.equal(await report.pixels(true), layout);
  await page.mouse.move(box.x + 200, box.y + 300);
  await page.mouse.wheel(0, -300);
  await report.leave();
  assert.notEqual(await report.pixels(false), turned);
  await page.click('#reset');
  await report.leave();
  assert.equal(await report.pixels(false), still);
  await page.mouse.move(box.x + box.width - 150, box.y + 300);
  await page.mouse.wheel(0, -300);
  await report.leave();
  assert.notEqual(await report.pixels(true), layout);
  assert.equal(await report.pixels(false), still);
  await page.click('#reset');
  await report.leave();

  // Hovering on either side shows the triangle on the other one.
  const face = await seenFace(report);
  const chart = await page.evaluate((f) => window.planishReport.maps[0].chart[f], face.face);
  await report.hover(0, face.face, true);
  assert.deepEqual((await report.state()).hovered, face);
  assert.notEqual(await report.pixels(false), still);
  await report.leave();
  assert.equal((await report.state()).hovered, null);
  assert.equal(await report.pixels(false), still);
  const resting = await report.pixels(true);
  const place = await report.hover(0, face.face, false);
  assert.equal((await report.state()).hovered.face, face.face);
  assert.notEqual(await report.pixels(true), resting);
  assert.match(await page.textContent('#tip'), new RegExp(`face ${face.face} · chart ${chart}`));

  // The chart that is clicked is the chart that is selected, in the table too.
  await page.mouse.click(place.x, place.y);
  assert.deepEqual((await report.state()).selected, { map: 0, chart });
  assert.equal(await page.locator('tr.selected').count(), 1);
  assert.equal(await page.getAttribute('tr.selected', 'data-chart'), String(chart));
  await page.keyboard.press('Escape');
  assert.equal((await report.state()).selected, null);
  const others = await page.locator('tr[data-chart]').count();
  await page.locator('tr[data-chart]').nth(others - 1).click();
  assert.equal((await report.state()).selected.chart, others - 1);
  assert.equal(await page.getAttribute('tr.selected', 'data-chart'), String(others - 1));

  // How it was solved.
  assert.match(await page.textContent('tbody tr td:last-child'), /uzawa|minres|direct/);
  await page.click('[data-tab=solve]');
  assert.ok((await page.locator('.plot .end').count()) >= 1);
  assert.ok((await page.locator('.bar').count()) >= 5);
  await report.close();
});

test('every chart has all of its Newton steps', async () => {
  const json = JSON.parse(planish(
    'unwrap', join(process.env.PLANISH_TEST_DATA, 'spot_seam.obj'), '-o', at('charts.obj'), '--json', '--max-stretch=1.02',
    `--report=${at('charts.html')}`).toString());
  assert.ok(json.charts.length > 3);
  const report = await Report.open(at('charts.html'));
  const { page } = report;
  await page.click('[data-tab=solve]');
  // A chart that is flat takes no step, and has a ring only.
  const stepping = json.charts.filter((chart) => chart.newton_iterations > 0).length;
  assert.equal(await page.locator('.plot path.line').count(), stepping);
  // A residual of exactly 0 has no place on a logarithmic axis. A chart of one triangle has it from the start: no line is
  // left without its ring.
  const largest = (chart) => Math.max(...Object.values(chart.residual));
  assert.equal(await page.locator('.plot .end').count(), json.charts.filter((chart) => largest(chart) > 0).length);
  assert.ok(json.charts.every((chart) => largest(chart) > 0 || chart.newton_iterations === 0));
  assert.equal(await page.locator('.plot path.largest').count(), 1);
  // The thick line has a place for each step of the chart that took most, and falls below the tolerance at last.
  const most = Math.max(...json.charts.map((chart) => chart.newton_iterations));
  assert.equal((await page.getAttribute('.plot path.largest', 'd')).match(/[ML]/g).length, most + 1);
  const limit = Number((await page.getAttribute('.plot .limit', 'd')).match(/^M\S+ ([\d.]+)H/)[1]);
  const end = Number((await page.getAttribute('.plot path.largest', 'd')).match(/ ([\d.]+)$/)[1]);
  assert.ok(end >= limit, `${end} ${limit}`);

  // A ring selects its chart, whose line then stands out.
  assert.equal(await page.locator('.plot .chosen').count(), 0);
  const ring = page.locator('.plot .end[data-chart]').last();
  const chart = Number(await ring.getAttribute('data-chart'));
  await ring.click({ force: true });
  await report.settle();
  assert.equal((await report.state()).selected.chart, chart);
  assert.equal(await page.locator('.plot path.line.chosen').count(), 1);
  assert.match(await page.textContent('p.chosen'), new RegExp(`^Chart ${chart}: .* Newton steps?, residual`));
  await report.close();
});

test('one chart has all of its Newton steps', async () => {
  const json = JSON.parse(planish(
    'unwrap', join(process.env.PLANISH_TEST_DATA, 'spot_seam.obj'), '-o', at('disc.obj'), '--seams=none', '--json',
    `--report=${at('disc.html')}`).toString());
  const report = await Report.open(at('disc.html'));
  await report.page.click('[data-tab=solve]');
  assert.equal(await report.page.locator('.plot path.line').count(), 1);
  assert.equal(await report.page.locator('.plot g.largest .step').count(), json.charts[0].newton_iterations + 1);
  await report.close();
});

test('a glTF with three materials has its colours, positions and UV', async () => {
  const mesh = threeMaterials();
  writeFileSync(at('three.gltf'), mesh.json);
  planish('report', at('three.gltf'), '-o', at('three.html'));
  const report = await Report.open(at('three.html'), { colorScheme: 'dark' });
  const { page } = report;
  assert.equal((await report.state()).isDark, true);
  const dark = await report.pixels(true);
  await page.keyboard.press('t');
  assert.equal((await report.state()).isDark, false);
  assert.notEqual(await report.pixels(true), dark);

  const map = await page.evaluate(() => {
    const { info, indices, positions, uv, material } = window.planishReport.maps[0];
    return { info, indices: [...indices], positions: [...positions], uv: [...uv], material: [...material] };
  });
  assert.deepEqual(map.material, [0, 0, 1, 1, 2, 2]);
  assert.deepEqual(map.info.materials.map((m) => m.name), ['red', 'green', 'blue']);
  assert.equal(map.info.charts.length, 3);
  const corners = [0, 1, 2].flatMap((i) => [0, 1, 2, 0, 2, 3].map((v) => 4 * i + v));
  corners.forEach((vertex, corner) => {
    const place = map.indices[corner];
    for (let k = 0; k < 3; ++k) {
      const value = map.info.low[k] + (map.info.size * map.positions[3 * place + k]) / 65535;
      assert.ok(Math.abs(value - mesh.positions[3 * vertex + k]) <= map.info.size / 65535, `position of corner ${corner}`);
    }
    const u = map.info.uvLow[0] + (map.info.uvSize * map.uv[2 * place]) / 65535;
    const v = map.info.uvLow[1] + (map.info.uvSize * map.uv[2 * place + 1]) / 65535;
    assert.ok(Math.abs(u - mesh.uv[2 * vertex]) <= 1 / 65535, `u of corner ${corner}`);
    assert.ok(Math.abs(1 - v - mesh.uv[2 * vertex + 1]) <= 1 / 65535, `v of corner ${corner}`);
  });

  // The middle of each square in the layout has the colour of its material most of all.
  await page.keyboard.press('6');
  assert.equal((await report.state()).mode, 'colour');
  for (let i = 0; i < 3; ++i) {
    const { x, y } = await page.evaluate((f) => window.planishReport.screenOf(0, f, true), 2 * i);
    const png = await page.screenshot({ clip: { x: x - 2, y: y - 2, width: 4, height: 4 } });
    const color = await page.evaluate(async (data) => {
      const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
      const image = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
      const context = new OffscreenCanvas(4, 4).getContext('2d');
      context.drawImage(image, 0, 0);
      return [...context.getImageData(1, 1, 1, 1).data];
    }, png.toString('base64'));
    assert.equal(color.indexOf(Math.max(...color.slice(0, 3))), i, color.join());
  }
  await report.close();
});

test('warnings lead to their triangles', async () => {
  writeFileSync(at('spoiled.obj'), spoiled());
  planish('report', at('spoiled.obj'), '-o', at('spoiled.html'));
  const report = await Report.open(at('spoiled.html'));
  const { page } = report;
  await page.click('[data-tab=warnings]');
  const kinds = await page.locator('.findings li b').allTextContents();
  assert.deepEqual(kinds.slice(0, 3), ['overlap', 'flipped', 'mirrored']);
  assert.equal(await page.textContent('#warning-count'), String(kinds.length));
  const still = await report.pixels(false), layout = await report.pixels(true);
  await page.click('.findings li >> nth=1');
  await report.leave();
  assert.notEqual(await report.pixels(false), still);
  assert.notEqual(await report.pixels(true), layout);
  // The flight ended at the flipped triangle: it is what is seen in the middle.
  const flipped = await page.evaluate(() => window.planishReport.maps[0].faults.findIndex((f) => (f & 1) !== 0));
  const box = await report.box(), size = Math.min(box.width / 2, box.height);
  const place = await page.evaluate((f) => window.planishReport.screenOf(0, f, true), flipped);
  assert.ok(Math.hypot(place.x - (box.x + box.width - size / 2), place.y - (box.y + box.height / 2)) < size / 3);
  await report.hover(0, flipped, false);
  assert.match(await page.textContent('#tip'), /flipped/);
  await report.close();
});

test('before and after have the same camera', async () => {
  writeFileSync(at('in.gltf'), threeMaterials().json);
  planish('unwrap', at('in.gltf'), '-o', at('out.gltf'), `--report=${at('both.html')}`);
  const report = await Report.open(at('both.html'));
  const { page } = report;
  assert.deepEqual((await report.state()).shown, [0, 1]);
  assert.deepEqual(await page.locator('#labels span').allTextContents(), ['before', 'after']);
  assert.notEqual(await report.pixels(true, 2, 0), await report.pixels(true, 2, 1));
  const places = () => page.evaluate(() => [0, 1].map((map) => window.planishReport.screenOf(map, 0, false)));
  let [first, second] = await places();
  const box = await report.box();
  assert.ok(Math.abs(first.x - second.x) < 0.5 && Math.abs(second.y - first.y - box.height / 2) < 2);
  await page.keyboard.press('ArrowLeft');
  await report.settle();
  const x = first.x;
  [first, second] = await places();
  assert.ok(Math.abs(first.x - x) > 1);
  assert.ok(Math.abs(first.x - second.x) < 0.5);

  // A triangle is the same one in both.
  const resting = await report.pixels(false, 2, 1);
  await report.hover(0, 3, false);
  assert.notEqual(await report.pixels(false, 2, 1), resting);
  await report.leave();
  await page.keyboard.press('b');
  assert.deepEqual((await report.state()).shown, [0]);
  await page.click('[data-show="1"]');
  assert.deepEqual((await report.state()).shown, [1]);
  await report.close();
});

test('a textured model looks the same before and after', async () => {
  // Waves of a sixteenth of a cycle a texel, around which eyes and PSNR see the most.
  const waves = (x, y, c) => 0.5 + 0.22 * Math.sin((2 * Math.PI * (x + (c - 1) * y)) / 16 + c) + 0.22 * Math.cos((2 * Math.PI * y) / 32 + c);
  writeFileSync(at('torus.gltf'), texturedTorus(16, png(256, 256, waves)));
  planish('unwrap', at('torus.gltf'), '-o', at('torus_out.glb'), `--report=${at('torus.html')}`);
  const report = await Report.open(at('torus.html'));
  const { page } = report;
  assert.equal(await page.locator('.toolbar [data-mode]').count(), 7);
  const still = await report.pixels(false, 2, 0), layout = await report.pixels(true, 2, 1);
  await page.keyboard.press('7');
  assert.equal((await report.state()).mode, 'textured');
  assert.equal(await page.getAttribute('[data-mode=textured]', 'aria-pressed'), 'true');
  assert.notEqual(await report.pixels(false, 2, 0), still);
  assert.notEqual(await report.pixels(true, 2, 1), layout);
  assert.equal(await page.textContent('#legend'), '');
  const looks = await compareLooks(page, 200);
  for (const { view, psnr, covered } of looks) {
    assert.ok(covered > 4000, `${view} ${covered}`);
    assert.ok(psnr >= 36, `${view} ${psnr}`);
  }
  // Seam lines have a switch of their own here.
  assert.equal(await page.getAttribute('[data-toggle=seams]', 'aria-pressed'), 'false');
  const [bare] = await compareLooks(page, 64, { '+z': [0, 0, 1] });
  await page.keyboard.press('s');
  assert.equal(await page.getAttribute('[data-toggle=seams]', 'aria-pressed'), 'true');
  const [lined] = await compareLooks(page, 64, { '+z': [0, 0, 1] });
  assert.ok(lined.psnr < bare.psnr, `${lined.psnr} ${bare.psnr}`); // the maps are cut in different places
  await page.keyboard.press('1');
  assert.equal(await page.getAttribute('[data-toggle=seams]', 'aria-pressed'), 'true');
  // The camera is that of the other modes.
  assert.equal(await report.pixels(false, 2, 0), still);
  await report.close();
});

test('normal maps are lit from the upper left, before and after', async () => {
  writeFileSync(at('domes.gltf'), domes());
  planish('unwrap', at('domes.gltf'), '-o', at('domes_out.glb'), `--report=${at('domes.html')}`);
  const report = await Report.open(at('domes.html'));
  await report.page.keyboard.press('7');
  await report.settle();
  const halves = await report.page.evaluate(() => [0, 1].map((map) => {
    const side = 256, pixels = window.planishReport.picture(map, [0, 0, 1], side);
    const rows = [], columns = []; // of pixels that the squares cover
    for (let i = 0; i < side * side; ++i) {
      if (pixels[4 * i + 3] !== 255) continue;
      rows.push(Math.floor(i / side));
      columns.push(i % side);
    }
    // Between the squares is a fifth of a square.
    const low = Math.min(...rows), left = Math.min(...columns), square = (Math.max(...columns) - left + 1) / 2.2;
    return [0, 1].map((number) => {
      const centre = left + (0.5 + 1.2 * number) * square, sums = [0, 0, 0, 0];
      // Rows run upwards. A ring round the middle, by quarters: left, right, above, below.
      for (let i = 0; i < 64; ++i) {
        const a = (2 * Math.PI * i) / 64, r = 0.22 * square;
        const x = Math.round(centre + r * Math.cos(a)), y = Math.round(low + square / 2 + r * Math.sin(a));
        const value = pixels[4 * (y * side + x)];
        sums[Math.cos(a) < 0 ? 0 : 1] += value / 32;
        sums[Math.sin(a) > 0 ? 2 : 3] += value / 32;
      }
      return { left: sums[0], right: sums[1], above: sums[2], below: sums[3] };
    });
  }));
  for (const { left, right, above, below } of halves.flat()) {
    assert.ok(left > right + 15 && above > below + 15, JSON.stringify(halves));
  }
  await report.close();
});

test('a model with a normal map looks the same before and after', async () => {
  const grey = png(8, 8, () => 0.6);
  // Bumps of 32 texels, 28 degrees steep.
  const bumps = (x, y, c) => {
    const n = [0.5 * Math.sin((2 * Math.PI * x) / 32), 0.5 * Math.sin((2 * Math.PI * y) / 32), 1];
    return 0.5 + (0.5 * n[c]) / Math.hypot(...n);
  };
  const pictures = [];
  for (const normals of [png(256, 256, bumps), undefined]) {
    const name = at(normals ? 'bumps' : 'smooth');
    writeFileSync(`${name}.gltf`, texturedTorus(24, grey, normals));
    planish('unwrap', `${name}.gltf`, '-o', `${name}_out.glb`, `--report=${name}.html`);
    const report = await Report.open(`${name}.html`);
    await report.page.keyboard.press('7');
    await report.settle();
    for (const { view, psnr, covered } of await compareLooks(report.page, 200)) {
      assert.ok(covered > 4000, `${view} ${covered}`);
      assert.ok(psnr >= 34, `${view} ${psnr}`);
    }
    pictures.push(await report.page.evaluate(() => [...window.planishReport.picture(1, [0, 0, 1], 200)]));
    await report.close();
  }
  const changed = pictures[0].filter((value, i) => Math.abs(value - pictures[1][i]) > 12).length;
  assert.ok(changed > 10000, `${changed} values`);
});

test('materials that were merged show their triangles', async () => {
  planish('unwrap', at('torus.gltf'), '-o', at('merged.glb'), '--merge-materials', `--report=${at('merged.html')}`);
  const report = await Report.open(at('merged.html'));
  await report.page.keyboard.press('7');
  await report.settle();
  for (const { view, psnr } of await compareLooks(report.page, 200, { '+z': [0, 0, 1] })) {
    assert.ok(psnr >= 36, `${view} ${psnr}`);
  }
  await report.close();
});

test('images that do not move are not on the page', () => {
  for (const flag of ['--textures=keep', '--textures=drop']) {
    planish('unwrap', at('torus.gltf'), '-o', at('plain.glb'), flag, `--report=${at('plain.html')}`);
    assert.ok(!/planish-image-|"textures":/.test(readFileSync(at('plain.html'), 'utf8').replace(/<script type="module">[^]*/, '')), flag);
  }
});

test('images that are too large, or missing, are shown smaller, or named', async () => {
  mkdirSync(at('large'));
  // Of 5000 texels a side, where 4096 are shown: in a band, since it is fast to make.
  writeFileSync(at('large/band.png'), png(5000, 4, (x, y, c) => 0.5 + 0.4 * Math.sin(x / 300 + c)));
  writeFileSync(at('large/band.mtl'), 'newmtl band\nmap_Kd band.png\nnewmtl gone\nmap_Kd gone.png\n');
  writeFileSync(at('large/band.obj'), `mtllib band.mtl
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
usemtl band\nf 1/1 2/2 3/3 4/4\nusemtl gone\nf 2/1 5/2 6/3 3/4\n`);
  planish('report', at('large/band.obj'), '-o', at('large.html'));
  const report = await Report.open(at('large.html'));
  await report.page.click('[data-mode=textured]');
  await report.settle();
  const said = await report.page.textContent('#legend');
  assert.match(said, /band\.png has 2500 × 2 of 5000 × 4 texels/);
  assert.match(said, /gone\.png is not shown: .*No such file/);
  await report.close();
});

test('a sheet of a batch shows every file and leads to its page', async () => {
  mkdirSync(at('in/props'), { recursive: true });
  writeFileSync(at('in/three materials #1.gltf'), threeMaterials().json);
  writeFileSync(at('in/props/spoiled.obj'), spoiled());
  writeFileSync(at('in/props/bad.obj'), 'v 0 0 zero\n');
  assert.throws(() => planish('unwrap', at('in'), '-o', at('done'), `--report=${at('sheet.html')}`), { status: 1 });
  const sheet = await Sheet.open(at('sheet.html'));
  const { page } = sheet;
  const names = () => page.locator('.card h2').allTextContents();
  assert.deepEqual(await names(), ['props/bad.obj', 'props/spoiled.obj', 'three materials #1.gltf']);
  assert.match(await page.textContent('header p'), /^3 files: 1 failed, 2 usable/);
  assert.equal(await page.locator('.card.bad').count(), 1);
  assert.match(await page.textContent('.card.bad .message'), /bad\.obj/);
  assert.equal(await page.locator('a.card').count(), 2);
  // Pictures are there and no two are alike.
  const pictures = await page.locator('.card img').evaluateAll((images) => Promise.all(images.map(async (image) => {
    await image.decode();
    return [image.naturalWidth, image.src];
  })));
  assert.deepEqual(pictures.map(([width]) => width), [320, 320]);
  assert.notEqual(pictures[0][1], pictures[1][1]);

  // Sorted by each figure, up and down; what has none comes last.
  const charts = () => page.locator('.card .charts dd').allTextContents();
  await page.click('.toolbar [data-sort=charts]');
  const down = (await charts()).map(Number);
  assert.deepEqual(down, [...down].sort((a, b) => b - a));
  assert.equal((await names()).at(-1), 'props/bad.obj');
  await page.click('.toolbar [data-sort=charts]');
  assert.deepEqual((await charts()).map(Number), [...down].reverse());
  assert.equal((await names()).at(-1), 'props/bad.obj');
  await page.click('.toolbar [data-sort=result]');
  assert.equal((await names())[0], 'props/bad.obj');
  for (const key of ['efficiency', 'stretch', 'warnings', 'seconds']) await page.click(`.toolbar [data-sort=${key}]`);

  await page.click('[data-view=table]');
  assert.equal(await page.locator('tbody tr').count(), 3);
  await page.click('th [data-sort=name]');
  assert.equal(await page.getAttribute('th >> nth=0', 'aria-sort'), 'ascending');
  await page.keyboard.press('/');
  await page.keyboard.type('MATERIALS');
  assert.equal(await page.locator('tbody tr').count(), 1);
  const color = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  const light = await color();
  await page.click('#theme');
  assert.notEqual(await color(), light);
  const address = await page.evaluate(() => document.querySelector('tbody a').href);
  await sheet.close();

  // The page of a file leads back.
  const report = await Report.open(fileURLToPath(address));
  assert.equal(await report.page.textContent('header h1'), 'three materials #1.gltf');
  const back = await report.page.evaluate(() => document.querySelector('header a').href);
  assert.equal(fileURLToPath(back), at('sheet.html'));
  await report.close();
});

test('a sheet of maps that are there', async () => {
  planish('report', at('in/three materials #1.gltf'), at('in/props/spoiled.obj'), '-o', `${at('maps')}/`);
  const sheet = await Sheet.open(at('maps/index.html'));
  assert.deepEqual(await sheet.page.locator('.card h2').allTextContents(), ['three materials #1.gltf', 'spoiled.obj']);
  assert.equal(await sheet.page.locator('[data-sort=seconds]').count(), 0);
  await sheet.page.click('.toolbar [data-sort=warnings]');
  assert.equal(await sheet.page.textContent('.card h2 >> nth=0'), 'spoiled.obj');
  assert.ok(Number(await sheet.page.textContent('.card .warnings.some dd')) >= 3);
  await sheet.close();
});
