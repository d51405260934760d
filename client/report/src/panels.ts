// The side of the page: numbers, charts, warnings, and how the map was solved.
import type { ChartInfo, ChartSolve, Finding, MapInfo, PageInfo } from './data';
import { escape, residualPlot, stagePlot, type Solved } from './plots';

const ROWS_AT_ONCE = 200;
const MOST_LISTED = 12;

export interface Actions {
  selectChart(map: number, chart: number): void;
  showFinding(map: number, finding: Finding): void;
  setMap(map: number): void;
}

type Column = { key: keyof ChartInfo | 'id' | 'solve'; title: string; help: string; text: (row: Row) => string };
interface Row extends ChartInfo {
  id: number;
  solve: ChartSolve | undefined;
}

const COLUMNS: Column[] = [
  { key: 'id', title: '#', help: 'Number of the chart', text: (r) => String(r.id) },
  { key: 'triangles', title: 'triangles', help: 'Triangles in the chart', text: (r) => r.triangles.toLocaleString('en') },
  { key: 'stretch', title: 'stretch', help: 'Root mean square stretch of the chart by itself; 1: none', text: (r) => number(r.stretch, 3) },
  { key: 'angle', title: 'angle', help: 'Mean error of its angles, degrees', text: (r) => `${number(r.angle, 2)}°` },
  { key: 'density', title: 'texels', help: 'Texels per unit of length', text: (r) => (Number.isFinite(r.density) ? Number(r.density.toPrecision(3)).toString() : '∞') },
];
const METHOD: Column = {
  key: 'solve', title: 'method', help: 'How the chart was solved, and in how many Newton steps',
  text: (r) => (r.solve ? `${methodOf(r.solve)}, ${r.solve.newton_iterations}${r.solve.converged ? '' : ', not converged'}` : ''),
};

function number(value: number, digits: number): string {
  return Number.isFinite(value) ? value.toFixed(digits) : '∞';
}

function methodOf(solve: ChartSolve): string {
  const solver = solve.preconditioner === 'none' || solve.solver === 'direct' ? solve.solver : `${solve.solver}+${solve.preconditioner}`;
  return solve.method === 'abf' ? solver : solve.method;
}

// Matches charts of the solver with charts of the map by triangle count and stretch.
export function matchSolves(charts: ChartInfo[], solves: ChartSolve[]): (ChartSolve | undefined)[] {
  const left = new Map<number, ChartSolve[]>();
  for (const solve of solves) left.set(solve.triangles, [...(left.get(solve.triangles) ?? []), solve]);
  return charts.map((chart) => {
    const candidates = left.get(chart.triangles) ?? [];
    const found = candidates.findIndex((s) => Math.abs(s.stretch_l2 - chart.stretch) < 1e-5 * chart.stretch);
    return found < 0 ? undefined : candidates.splice(found, 1)[0];
  });
}

export class Panels {
  private map: number;
  private sortBy: Column['key'] = 'id';
  private isDescending = false;
  private selected = -1;
  private listed = ROWS_AT_ONCE;
  private tab = 'charts';
  private readonly rows: Row[][];

  constructor(private readonly root: HTMLElement, private readonly page: PageInfo, private readonly actions: Actions) {
    this.map = page.maps.length - 1;
    this.rows = page.maps.map((info, i) => {
      const isSolved = i === page.maps.length - 1 && page.unwrap?.charts !== undefined;
      const solves = isSolved ? matchSolves(info.charts, page.unwrap!.charts!) : [];
      return info.charts.map((chart, id) => ({ ...chart, id, solve: solves[id] }));
    });
    root.innerHTML = `
      <nav class="tabs" role="tablist">
        <button role="tab" data-tab="charts">Charts</button>
        <button role="tab" data-tab="warnings">Warnings <b id="warning-count"></b></button>
        <button role="tab" data-tab="numbers">Numbers</button>
        ${page.unwrap ? '<button role="tab" data-tab="solve">Solve</button>' : ''}
      </nav>
      ${page.maps.length > 1 ? `<div class="which">${page.maps.map((m, i) => `<button data-map="${i}">${escape(m.name)}</button>`).join('')}</div>` : ''}
      <div id="panel" role="tabpanel" tabindex="-1"></div>`;
    root.addEventListener('click', (event) => this.click(event.target as HTMLElement));
    root.addEventListener('keydown', (event) => {
      const row = (event.target as HTMLElement).closest<HTMLElement>('tr[data-chart], li[data-finding]');
      if (!row || (event.key !== 'Enter' && event.key !== ' ')) return;
      event.preventDefault();
      this.click(row);
    });
    this.render();
  }

  select(map: number, chart: number): void {
    this.selected = chart;
    if (chart >= 0) this.map = map;
    const position = this.sorted().findIndex((row) => row.id === chart);
    this.listed = Math.max(this.listed, position + 1);
    this.render();
    this.root.querySelector('tr.selected')?.scrollIntoView({ block: 'nearest' });
  }

  private get info(): MapInfo {
    return this.page.maps[this.map]!;
  }

  private sorted(): Row[] {
    const value = (row: Row): number =>
      this.sortBy === 'solve' ? (row.solve?.newton_iterations ?? -1) : Number(row[this.sortBy]);
    const sign = this.isDescending ? -1 : 1;
    return [...this.rows[this.map]!].sort((a, b) => sign * (value(a) - value(b)) || a.id - b.id);
  }

  private click(target: HTMLElement): void {
    const data = target.closest<HTMLElement>('[data-tab], [data-map], [data-sort], [data-chart], [data-finding], [data-more]')?.dataset;
    if (!data) return;
    if (data.tab) this.tab = data.tab;
    if (data.map) {
      this.map = Number(data.map);
      this.selected = -1;
      this.actions.setMap(this.map);
    }
    if (data.sort) {
      const key = data.sort as Column['key'];
      this.isDescending = this.sortBy === key ? !this.isDescending : key !== 'id';
      this.sortBy = key;
    }
    if (data.more) this.listed *= 4;
    if (data.chart) {
      const chart = Number(data.chart);
      return this.actions.selectChart(this.map, chart === this.selected ? -1 : chart);
    }
    if (data.finding) return this.actions.showFinding(this.map, this.info.findings[Number(data.finding)]!);
    this.render();
  }

  private render(): void {
    for (const button of this.root.querySelectorAll<HTMLElement>('[data-tab]')) {
      button.setAttribute('aria-selected', String(button.dataset.tab === this.tab));
    }
    for (const button of this.root.querySelectorAll<HTMLElement>('[data-map]')) {
      button.setAttribute('aria-pressed', String(Number(button.dataset.map) === this.map));
    }
    const count = this.info.findings.length + this.unwrapWarnings().length;
    const badge = this.root.querySelector<HTMLElement>('#warning-count')!;
    badge.textContent = String(count);
    badge.classList.toggle('none', count === 0);
    const panel = this.root.querySelector<HTMLElement>('#panel')!;
    const scroll = panel.scrollTop;
    panel.innerHTML = { charts: () => this.charts(), warnings: () => this.warnings(), numbers: () => this.numbers(), solve: () => this.solve() }[this.tab]!();
    panel.scrollTop = scroll;
  }

  private charts(): string {
    const columns = this.rows[this.map]!.some((row) => row.solve) ? [...COLUMNS, METHOD] : COLUMNS;
    const rows = this.sorted();
    const head = columns
      .map((c) => `<th title="${c.help}" aria-sort="${c.key !== this.sortBy ? 'none' : this.isDescending ? 'descending' : 'ascending'}"><button data-sort="${c.key}">${c.title}</button></th>`)
      .join('');
    const body = rows
      .slice(0, this.listed)
      .map((r) => `<tr data-chart="${r.id}" tabindex="0"${r.id === this.selected ? ' class="selected" aria-selected="true"' : ''}>${columns.map((c) => `<td>${escape(c.text(r))}${c.key === 'id' && r.mirrored ? ' <abbr title="mirrored">⇋</abbr>' : ''}</td>`).join('')}</tr>`)
      .join('');
    const more = rows.length > this.listed ? `<button class="more" data-more="1">${(rows.length - this.listed).toLocaleString('en')} more charts</button>` : '';
    return `<table class="charts"><thead><tr>${head}</tr></thead><tbody>${body}</tbody></table>${more}`;
  }

  private unwrapWarnings(): { reason: string; message: string }[] {
    return this.map === this.page.maps.length - 1 ? (this.page.unwrap?.warnings ?? []) : [];
  }

  private warnings(): string {
    const findings = this.info.findings
      .map((f, i) => `<li data-finding="${i}" tabindex="0"><b>${escape(f.kind)}</b> ${escape(f.text)}</li>`)
      .join('');
    const others = this.unwrapWarnings();
    const said = others
      .slice(0, MOST_LISTED)
      .map((w) => `<li class="said"><b>${escape(w.reason)}</b> ${escape(w.message)}</li>`)
      .join('');
    const rest = others.length > MOST_LISTED ? `<p>${others.length - MOST_LISTED} more</p>` : '';
    if (!findings && !said) return '<p class="good">Nothing to warn of: no overlap, no flipped, degenerate or missing triangle.</p>';
    return `${findings ? `<p>A click shows the triangles.</p><ul class="findings">${findings}</ul>` : ''}${said ? `<h3>What unwrap said</h3><ul class="findings">${said}</ul>${rest}` : ''}`;
  }

  private numbers(): string {
    const maps = this.page.maps;
    const names = maps[0]!.numbers.map(([name]) => name);
    for (const map of maps) for (const [name] of map.numbers) if (!names.includes(name)) names.push(name);
    const row = (name: string): string =>
      `<tr><th scope="row">${escape(name)}</th>${maps.map((m) => `<td>${escape(m.numbers.find(([n]) => n === name)?.[1] ?? '')}</td>`).join('')}</tr>`;
    const head = maps.length > 1 ? `<thead><tr><td></td>${maps.map((m) => `<th>${escape(m.name)}</th>`).join('')}</tr></thead>` : '';
    return `<table class="numbers">${head}<tbody>${names.map(row).join('')}</tbody></table>`;
  }

  private solve(): string {
    const unwrap = this.page.unwrap!, last = this.page.maps.length - 1;
    const chartOf = new Map(this.rows[last]!.flatMap((row) => (row.solve ? [[row.solve, row.id] as const] : [])));
    const charts: Solved[] = (unwrap.charts ?? []).map((solve) => ({ solve, chart: chartOf.get(solve) }));
    const selected = this.map === last ? this.selected : -1;
    const residuals = residualPlot(unwrap, charts, selected);
    const seconds = unwrap.seconds;
    const chosen = this.rows[last]![selected]?.solve;
    const left = this.page.maps[last]!.charts.length - charts.length;
    return `${residuals ? `<h3>Largest residual after each Newton step</h3>${residuals}
      <p>Thick: the worst of all charts. Thin: each chart${left > 0 ? `, but for ${left.toLocaleString('en')} of which the server told no more` : ''}; a click selects it. Rings: where each ended. Dashed: the tolerance.</p>` : ''}
      ${chosen ? `<p class="chosen"><b>Chart ${selected}</b>: ${chosen.triangles.toLocaleString('en')} triangles, ${escape(methodOf(chosen))}, ${chosen.newton_iterations} Newton ${chosen.newton_iterations === 1 ? 'step' : 'steps'}${chosen.converged ? '' : ', not converged'}, residual ${chosen.residual.toExponential(1)}</p>` : ''}
      ${seconds ? `<h3>Time by stage, ${(seconds.total ?? 0).toFixed(2)} s in all</h3>${stagePlot(seconds)}` : ''}`;
  }
}
