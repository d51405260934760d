// Plots of how a map was solved, as SVG text.
import type { ChartSolve, Unwrap } from './data';

const WIDTH = 320, HEIGHT = 190, LEFT = 42, RIGHT = 8, TOP = 8, BOTTOM = 30;

export function escape(text: string): string {
  return text.replace(/[&<>"]/g, (c) => ({ '&': '&amp;', '<': '&lt;', '>': '&gt;', '"': '&quot;' })[c]!);
}

// A chart of the solver on the plot.
export interface Solved {
  solve: ChartSolve;
  chart: number | undefined; // its number on the page
}

// Residuals after each Newton step, on a log axis: the largest of all charts, thin lines for charts, and a ring where each
// chart ended. `selected`: a chart of the page, which stands out.
export function residualPlot(unwrap: Unwrap, charts: Solved[], selected: number): string {
  const largest = (unwrap.largest ?? []).filter((residual) => residual > 0);
  const ends = charts.filter(({ solve }) => solve.residual > 0);
  const residuals = [...largest, ...ends.flatMap(({ solve }) => [solve.residual, ...(solve.steps ?? [])])].filter((r) => r > 0);
  if (residuals.length === 0) return '';
  const steps = Math.max(1, largest.length - 1, ...ends.map(({ solve }) => Math.max(solve.newton_iterations, (solve.steps?.length ?? 1) - 1)));
  const values = residuals.map(Math.log10);
  const tolerance = unwrap.tolerance && unwrap.tolerance > 0 ? Math.log10(unwrap.tolerance) : null;
  const low = Math.floor(values.reduce((a, b) => Math.min(a, b), tolerance ?? 0)), high = Math.ceil(values.reduce((a, b) => Math.max(a, b)) + 1e-9);
  const x = (step: number): number => LEFT + (step / steps) * (WIDTH - LEFT - RIGHT);
  const y = (log: number): number => TOP + ((high - log) / Math.max(1, high - low)) * (HEIGHT - TOP - BOTTOM);
  let svg = `<svg class="plot" viewBox="0 0 ${WIDTH} ${HEIGHT}" role="img" aria-label="Largest residual after each Newton step">`;
  const every = Math.max(1, Math.ceil((high - low) / 6));
  for (let e = high; e >= low; e -= every) {
    svg += `<path class="grid" d="M${LEFT} ${y(e)}H${WIDTH - RIGHT}"/><text x="${LEFT - 5}" y="${y(e) + 3}" text-anchor="end">1e${e}</text>`;
  }
  const stride = Math.max(1, Math.ceil(steps / 8));
  for (let s = 0; s <= steps; s += stride) {
    svg += `<text x="${x(s)}" y="${HEIGHT - BOTTOM + 13}" text-anchor="middle">${s}</text>`;
  }
  svg += `<text x="${(LEFT + WIDTH) / 2}" y="${HEIGHT - 3}" text-anchor="middle">Newton step</text>`;
  if (tolerance !== null) svg += `<path class="limit" d="M${LEFT} ${y(tolerance)}H${WIDTH - RIGHT}"/>`;
  const place = (step: number, residual: number): string => `${x(step).toFixed(1)} ${y(Math.log10(residual)).toFixed(1)}`;
  const line = (points: number[]): string => `M${points.flatMap((r, step) => (r > 0 ? [place(step, r)] : [])).join('L')}`;
  const dots = (points: number[]): string =>
    points.map((r, step) => (r > 0 ? `<circle class="step" cx="${x(step).toFixed(1)}" cy="${y(Math.log10(r)).toFixed(1)}" r="1.8"/>` : '')).join('');
  const title = ({ solve, chart }: Solved): string =>
    `<title>${chart === undefined ? 'a chart' : `chart ${chart}`}: ${solve.triangles.toLocaleString('en')} triangles, ${solve.newton_iterations} steps${solve.converged ? '' : ', not converged'}</title>`;
  const link = ({ chart }: Solved): string => (chart === undefined ? '' : ` data-chart="${chart}"`);
  // The selected curve comes last, above the others.
  const order = [...ends].sort((a, b) => Number(a.chart === selected) - Number(b.chart === selected));
  for (const each of order) {
    const of = each.chart === selected && selected >= 0 ? ' chosen' : '';
    if (each.solve.steps && each.solve.steps.length > 1) svg += `<path class="line${of}"${link(each)} d="${line(each.solve.steps)}">${title(each)}</path>`;
    if (of) svg += `<g class="chosen">${dots(each.solve.steps ?? [])}</g>`;
  }
  if (largest.length > 0) svg += `<path class="largest" d="${line(largest)}"><title>the largest of all charts</title></path><g class="largest">${dots(largest)}</g>`;
  for (const each of order) {
    const of = each.chart === selected && selected >= 0 ? ' chosen' : '';
    const at = `cx="${x(each.solve.newton_iterations).toFixed(1)}" cy="${y(Math.log10(each.solve.residual)).toFixed(1)}"`;
    svg += `<circle class="end${each.solve.converged ? '' : ' bad'}${of}"${link(each)} ${at} r="${of ? 4 : 3}">${title(each)}</circle>`;
  }
  return svg + '</svg>';
}

// Seconds of each stage, as bars.
export function stagePlot(seconds: Record<string, number>): string {
  const stages = Object.entries(seconds).filter(([name, value]) => name !== 'total' && value >= 0.0005);
  const largest = Math.max(...stages.map(([, value]) => value), 1e-9);
  return stages
    .map(([name, value]) => `<div class="bar"><span>${escape(name)}</span><i style="width:${((100 * value) / largest).toFixed(1)}%"></i><b>${value < 10 ? value.toFixed(value < 0.1 ? 3 : 2) : value.toFixed(0)} s</b></div>`)
    .join('');
}
