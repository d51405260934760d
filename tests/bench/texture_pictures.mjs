// How textured models look before and after: pictures by the page of `planish unwrap --report`, from six sides, about a
// pixel a texel, with the page's own filtering (trilinear mipmaps, anisotropic). Prints a table of PSNR in Markdown and
// writes WORK_DIR/NAME.before.png and .after.png of the view from +z. Exit code 1 if a model whose name begins with
// "smooth_" is below 36 dB in a view.
//   node texture_pictures.mjs PLANISH CHROMIUM WORK_DIR MODEL.glb..., where WORK_DIR/node_modules has playwright-core
import { execFileSync } from 'node:child_process';
import { writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { basename, join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { compareLooks, VIEWS } from '../report/looks.mjs';

const LEAST = 36, LARGEST_PICTURE = 1536; // dB, pixels a side
const [planish, chromiumPath, work, ...models] = process.argv.slice(2);
const { chromium } = createRequire(join(resolve(work), 'x.js'))('playwright-core');
const at = (name) => join(resolve(work), name);

const settle = (page) => page.evaluate(() => new Promise((done) => {
  const look = () => requestAnimationFrame(window.planishReport?.isIdle() ? () => requestAnimationFrame(done) : look);
  look();
}));

const browser = await chromium.launch({
  executablePath: chromiumPath,
  args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});
let isGood = true;
console.log(`| model | pixels a side | ${Object.keys(VIEWS).join(' | ')} | page |\n|---|---|${'---|'.repeat(Object.keys(VIEWS).length)}---|`);
for (const model of models) {
  const name = basename(model, '.glb'), report = at(`${name}.html`);
  execFileSync(planish, ['unwrap', model, '-o', at(`${name}.glb`), `--report=${report}`, '--progress=none', '--quiet']);
  const page = await browser.newPage({ viewport: { width: 800, height: 600 } });
  await page.goto(pathToFileURL(report).href);
  await settle(page);
  const size = await page.evaluate(() => {
    const { charts, size } = window.planishReport.maps[1].info;
    return Math.ceil((charts[0].density * size) / 0.94);
  });
  const pixels = Math.min(size, LARGEST_PICTURE);
  await page.keyboard.press('7');
  await settle(page);
  if ((await page.evaluate(() => window.planishReport.state().mode)) !== 'textured') throw new Error(`${name}: no textures on the page`);
  const looks = await compareLooks(page, pixels, VIEWS, true);
  for (const [i, kind] of ['before', 'after'].entries()) {
    const [, data] = looks.find(({ view }) => view === '+z').pictures[i].split(',');
    writeFileSync(at(`${name}.${kind}.png`), Buffer.from(data, 'base64'));
  }
  const isLow = name.startsWith('smooth_') && looks.some(({ psnr }) => psnr < LEAST);
  isGood &&= !isLow;
  const bytes = await page.evaluate(() => performance.getEntriesByType('navigation')[0].decodedBodySize);
  console.log(`| ${name}${isLow ? ' **fails**' : ''} | ${pixels} | ${looks.map(({ psnr }) => psnr.toFixed(1)).join(' | ')} | ${(bytes / 1e6).toFixed(1)} MB |`);
  await page.close();
}
await browser.close();
process.exit(isGood ? 0 : 1);
