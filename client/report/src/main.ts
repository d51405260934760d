// The page of `planish report`.
import * as THREE from 'three';
import { angleOf, FAULTS, readImages, readPage, STRETCH_RANGE, stretchOf, type Finding, type PageInfo } from './data';
import { Panels } from './panels';
import { escape } from './plots';
import { MODES, type Mode } from './shaders';
import './colors.css';
import './style.css';
import { Viewer, type Hit } from './viewer';

const MODE_NAMES: Record<Mode, string> = {
  checker: 'Checker', charts: 'Charts', stretch: 'Stretch', angle: 'Angles', seams: 'Seams', colour: 'Colour', textured: 'Textured',
};
const HELP = (modes: number): string => `1 to ${modes}: what is shown · W: wireframe · S: seams · P: padding · R: reset · B: before, after, both
arrows: turn · + and −: nearer, farther · T: dark or light · Esc: select nothing · drag, wheel and click in both views`;

type Toggle = 'wireframe' | 'seams' | 'padding' | 'isDark';

interface State {
  mode: Mode;
  wireframe: boolean;
  seams: boolean;
  padding: boolean;
  texturedSeams: boolean; // `seams` and `padding` of the mode "textured"
  texturedPadding: boolean;
  shown: number[];
  isDark: boolean;
  selected: { map: number; chart: number } | null;
  hovered: Hit | null;
}

function frame(title: string, summary: string, maps: string[], modes: readonly Mode[], sheet: string | undefined): string {
  return `
    <header>
      ${sheet === undefined ? '' : `<a href="${escape(encodeURI(sheet))}" title="The contact sheet">← all files</a>`}<h1>${escape(title)}</h1><p>${escape(summary)}</p>
      <span class="space"></span>
      ${maps.length > 1 ? `<div class="group" role="group" aria-label="Which maps">${['both', ...maps.keys()].map((m) => `<button data-show="${m}">${m === 'both' ? 'Both' : escape(maps[m as number]!)}</button>`).join('')}</div>` : ''}
      <button id="theme" title="Dark or light (T)" aria-label="Dark or light">◐</button>
    </header>
    <main>
      <section class="stage">
        <div class="toolbar" role="toolbar" aria-label="What is shown">
          <div class="group">${modes.map((m, i) => `<button data-mode="${m}" title="${MODE_NAMES[m]} (${i + 1})">${MODE_NAMES[m]}</button>`).join('')}</div>
          <div class="group">
            <button data-toggle="wireframe" title="Edges of all triangles (W)">Wireframe</button>
            <button data-toggle="seams" title="Seams on the surface (S)">Seam lines</button>
            <button data-toggle="padding" title="Half of the padding on either side (P)">Padding</button>
          </div>
          <button id="reset" title="See everything (R)">Reset</button>
          <button id="help" title="Keys" aria-label="Keys">?</button>
        </div>
        <div class="views"><canvas tabindex="0" aria-label="The surface on the left, its layout on the right"></canvas>
          <div id="labels"></div><div id="rings"></div><div id="legend"></div><div id="tip" hidden></div><div id="keys" hidden>${escape(HELP(modes.length)).replace('\n', '<br>')}</div></div>
      </section>
      <aside id="side"></aside>
    </main>`;
}

async function start(): Promise<void> {
  const app = document.getElementById('app')!;
  app.innerHTML = '<p class="loading">Unpacking…</p>';
  const { page, maps } = await readPage();
  const last = page.maps.at(-1)!;
  const title = page.title ?? page.maps.map((m) => m.name).filter((name, i, all) => all.indexOf(name) === i).join(' → ');
  const modes = page.images ? MODES : MODES.filter((mode) => mode !== 'textured');
  document.title = `${title} – planish report`;
  app.innerHTML = frame(
    title,
    `${last.triangles.toLocaleString('en')} triangles, ${last.charts.length.toLocaleString('en')} charts · planish ${page.version}`,
    page.maps.map((m) => m.name),
    modes,
    page.sheet,
  );
  const element = <T extends HTMLElement>(selector: string): T => app.querySelector<T>(selector)!;
  const canvas = element<HTMLCanvasElement>('canvas');
  let viewer: Viewer;
  try {
    viewer = new Viewer(canvas, maps);
  } catch {
    element('.views').innerHTML = '<p class="loading">This browser has no WebGL 2, which the views need.</p>';
    return;
  }
  const { models } = viewer;
  const state: State = {
    mode: 'checker', wireframe: false, seams: true, padding: true, texturedSeams: false, texturedPadding: false, shown: page.maps.map((_, i) => i),
    isDark: matchMedia('(prefers-color-scheme: dark)').matches, selected: null, hovered: null,
  };
  // "report.html#charts" opens in that mode.
  state.mode = modes.find((mode) => mode === location.hash.slice(1)) ?? state.mode;
  // Both maps have the same colour scales, which 2 % of the triangles may exceed.
  const stretchTop = Math.max(0.25, ...models.map((m) => (m.quantile(m.data.stretch, 0.98) / 254) * STRETCH_RANGE));
  const angleTop = Math.max(2, ...models.map((m) => angleOf(m.quantile(m.data.angle, 0.98))));

  // Lines hide what images look like, so they are switched by themselves there.
  const keyOf = (key: Toggle): 'wireframe' | 'seams' | 'padding' | 'texturedSeams' | 'texturedPadding' | 'isDark' =>
    state.mode !== 'textured' ? key : key === 'seams' ? 'texturedSeams' : key === 'padding' ? 'texturedPadding' : key;
  let images: Promise<void> | null = null; // once they are asked for
  const apply = (): void => {
    if (state.mode === 'textured') images ??= viewer.loadImages(readImages(page)).then(apply);
    document.documentElement.dataset.theme = state.isDark ? 'dark' : 'light';
    const style = getComputedStyle(document.documentElement);
    const color = (name: string): string => style.getPropertyValue(name).trim();
    viewer.setColors(color('--stage'), color('--tile'), color('--ink'));
    viewer.setMode(state.mode, state.isDark, state[keyOf('seams')]);
    models.forEach((model, i) => {
      model.setWireframe(state.wireframe); // after setMode(), which decides on seams
      model.setPadding(state[keyOf('padding')]);
      model.setRanges(stretchTop, angleTop);
      model.setSelected(state.selected?.map === i ? state.selected.chart : -1);
    });
    for (const button of app.querySelectorAll<HTMLElement>('[data-mode]')) {
      button.setAttribute('aria-pressed', String(button.dataset.mode === state.mode));
    }
    for (const button of app.querySelectorAll<HTMLElement>('[data-toggle]')) {
      button.setAttribute('aria-pressed', String(state[keyOf(button.dataset.toggle as Toggle)]));
    }
    for (const button of app.querySelectorAll<HTMLElement>('[data-show]')) {
      const isBoth = button.dataset.show === 'both';
      const isOn = isBoth ? state.shown.length > 1 : state.shown.length === 1 && state.shown[0] === Number(button.dataset.show);
      button.setAttribute('aria-pressed', String(isOn));
    }
    element('#legend').innerHTML = state.mode === 'textured' ? imageLegend(page) : legend(state.mode, stretchTop, angleTop);
    element('#labels').innerHTML = state.shown.length < 2 ? '' : state.shown
      .map((m, row) => `<span style="top:calc(${(100 * row) / state.shown.length}% + 8px)">${escape(page.maps[m]!.name)}</span>`)
      .join('');
    viewer.redraw();
  };

  const panels = new Panels(element('#side'), page, {
    selectChart: (map, chart) => select(map, chart, true),
    showFinding: (map, finding) => showFinding(map, finding),
    setMap: () => select(0, -1, false),
  });
  const select = (map: number, chart: number, flies: boolean): void => {
    state.selected = chart < 0 ? null : { map, chart };
    panels.select(map, chart);
    if (flies && chart >= 0) viewer.flyTo(map, models[map]!.facesOfChart(chart));
    apply();
  };
  const showFinding = (map: number, finding: Finding): void => {
    const faces = models[map]!.facesOf(finding);
    models.forEach((model, i) => model.setMarked(i === map ? faces : []));
    state.selected = null;
    if (!state.shown.includes(map)) show([map]);
    // Flies to the first of many triangles, since the middle of all of them may be somewhere else.
    viewer.flyTo(map, finding.charts !== undefined || faces.length <= 4 ? faces : faces.slice(0, 1));
    apply();
  };
  const show = (shown: number[]): void => {
    state.shown = shown;
    viewer.show(shown);
    apply();
  };
  const cycle = (): void => {
    if (page.maps.length < 2) return;
    show(state.shown.length > 1 ? [0] : state.shown[0] === 0 ? [1] : [0, 1]);
  };

  const sameSurface = page.maps.every((m) => m.triangles === page.maps[0]!.triangles);
  viewer.onHover = (hit, x, y) => {
    if (hit?.map === state.hovered?.map && hit?.face === state.hovered?.face) return place(x, y);
    state.hovered = hit;
    models.forEach((model, i) => model.setHover(hit && (i === hit.map || sameSurface) ? hit.face : -1));
    const tip = element('#tip');
    tip.hidden = hit === null;
    if (hit) {
      const data = maps[hit.map]!, faults = data.faults[hit.face]!;
      const wrong = Object.entries(FAULTS).filter(([, bit]) => faults & bit).map(([name]) => name);
      const material = data.material[hit.face]!;
      const area = data.stretch[hit.face] === 255 ? 'no area' : `stretch ${stretchOf(data.stretch[hit.face]!).toFixed(2)}, angle off by ${angleOf(data.angle[hit.face]!).toFixed(1)}°`;
      tip.innerHTML = `<b>face ${data.polygon[hit.face]}</b> · chart ${data.chart[hit.face]}${material >= 0 ? ` · ${escape(data.info.materials[material]!.name)}` : ''}<br>${area}${wrong.length ? `<br><em>${wrong.join(', ')}</em>` : ''}`;
      place(x, y);
    }
    viewer.redraw();
  };
  // Draws rings round the hovered triangle in every view, as it may be smaller than a pixel.
  viewer.onDraw = () => {
    const rings: string[] = [], face = state.hovered?.face ?? -1;
    for (const map of state.shown) {
      if (face < 0 || (map !== state.hovered!.map && !sameSurface)) continue;
      for (const isLayout of [false, true]) {
        const at = viewer.screenOf(map, face, isLayout);
        if (at?.isInside) rings.push(`<i class="ring" style="left:${at.x.toFixed(1)}px;top:${at.y.toFixed(1)}px"></i>`);
      }
    }
    element('#rings').innerHTML = rings.join('');
  };
  const place = (x: number, y: number): void => {
    const tip = element('#tip'), box = element('.views').getBoundingClientRect();
    tip.style.left = `${Math.max(4, Math.min(x + 14, box.width - tip.offsetWidth - 6))}px`;
    tip.style.top = `${y + 18 + tip.offsetHeight > box.height ? y - tip.offsetHeight - 10 : y + 18}px`;
  };
  viewer.onClick = (hit) => {
    models.forEach((model) => model.setMarked([]));
    if (!hit) return select(0, -1, false);
    const chart = maps[hit.map]!.chart[hit.face]!;
    const isSame = state.selected?.map === hit.map && state.selected.chart === chart;
    select(hit.map, isSame ? -1 : chart, false);
  };

  const toggle = (key: Toggle): void => {
    state[keyOf(key)] = !state[keyOf(key)];
    apply();
  };
  app.addEventListener('click', (event) => {
    const button = (event.target as HTMLElement).closest<HTMLElement>('header button, .toolbar button');
    if (!button) return;
    if (button.dataset.mode) state.mode = button.dataset.mode as Mode;
    if (button.dataset.toggle) return toggle(button.dataset.toggle as Toggle);
    if (button.dataset.show) return show(button.dataset.show === 'both' ? page.maps.map((_, i) => i) : [Number(button.dataset.show)]);
    if (button.id === 'theme') return toggle('isDark');
    if (button.id === 'reset') viewer.reset();
    if (button.id === 'help') element('#keys').hidden = !element('#keys').hidden;
    apply();
  });
  const keys: Record<string, () => void> = {
    w: () => toggle('wireframe'), s: () => toggle('seams'), p: () => toggle('padding'), t: () => toggle('isDark'),
    r: () => viewer.reset(), b: cycle,
    ArrowLeft: () => viewer.orbit(-0.12, 0), ArrowRight: () => viewer.orbit(0.12, 0),
    ArrowUp: () => viewer.orbit(0, 0.12), ArrowDown: () => viewer.orbit(0, -0.12),
    '+': () => viewer.zoom(0.87), '=': () => viewer.zoom(0.87), '-': () => viewer.zoom(1.15),
    '?': () => element('#help').click(),
    Escape: () => {
      models.forEach((model) => model.setMarked([]));
      element('#keys').hidden = true;
      select(0, -1, false);
    },
  };
  window.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const isInPanel = (event.target as HTMLElement).closest('aside') !== null;
    if (isInPanel && event.key.startsWith('Arrow')) return;
    const mode = modes[Number(event.key) - 1];
    const action = keys[event.key] ?? keys[event.key.toLowerCase()];
    if (mode) state.mode = mode;
    if (!mode && !action) return;
    event.preventDefault();
    action?.();
    apply();
  });
  apply();

  // For tests and for those who script a page.
  Object.assign(window, {
    planishReport: {
      state: () => ({ ...state, chartOfHovered: state.hovered ? maps[state.hovered.map]!.chart[state.hovered.face] : null }),
      screenOf: (map: number, face: number, isLayout: boolean) => {
        const at = viewer.screenOf(map, face, isLayout), box = canvas.getBoundingClientRect();
        return at && { x: at.x + box.left, y: at.y + box.top };
      },
      pick: (x: number, y: number) => {
        const box = canvas.getBoundingClientRect();
        return viewer.pick(x - box.left, y - box.top);
      },
      // Draws a surface from a direction: RGBA of size x size pixels, from the bottom.
      picture: (map: number, direction: [number, number, number], size: number) =>
        viewer.picture(map, new THREE.Vector3(...direction).normalize(), size),
      isIdle: () => viewer.isIdle,
      maps,
    },
  });
}

function legend(mode: Mode, stretchTop: number, angleTop: number): string {
  if (mode === 'stretch') {
    return `<span>1</span><i class="viridis"></i><span>${(2 ** stretchTop).toFixed(2)}×</span>`;
  }
  if (mode === 'angle') return `<span>0°</span><i class="cividis"></i><span>${angleTop.toFixed(angleTop < 10 ? 1 : 0)}°</span>`;
  if (mode === 'seams') return '<span>hidden</span><i class="seams"></i><span>in the open</span>';
  return '';
}

// Says which images are smaller than in the files, or missing.
function imageLegend({ images = [], imageNotes = [] }: PageInfo): string {
  const notes = [...imageNotes], [first] = images.filter((image) => image.width < image.fileWidth);
  if (first) notes.unshift(`Images are smaller here than in the files: ${first.name} has ${first.width} × ${first.height} of ${first.fileWidth} × ${first.fileHeight} texels`);
  return notes.map((note) => `<span>${escape(note)}</span>`).join('');
}

start().catch((error: unknown) => {
  document.getElementById('app')!.innerHTML = `<p class="loading">This page cannot be read: ${escape(String(error))}</p>`;
  throw error;
});
