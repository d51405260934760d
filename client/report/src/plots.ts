// Plots of how a map was solved, as SVG text.
import type { Unwrap } from './data';

const WIDTH = 320, HEIGHT = 190, LEFT = 42, RIGHT = 8, TOP = 8, BOTTOM = 30;

export function escape(text: string): string {
  return text.replace(/[&<>"]/g, (c) => ({ '&': '&amp;', '<': '&lt;', '>': '&gt;', '"': '&quot;' })[c]!);
}

// The largest residual after each Newton step, on a log axis: a line for the steps of a chart that the server told, and a
// ring where each chart ended.
export function residualPlot(unwrap: Unwrap): string {
  const series = new Map<number, [number, number][]>();
  for (const [chart, step, residual] of unwrap.newton ?? []) {
    if (residual > 0) series.set(chart, [...(series.get(chart) ?? []), [step, residual]]);
  }
  const ends = (unwrap.charts ?? []).filter((c) => c.residual > 0);
  const all = [...[...series.values()].flat(), ...ends.map((c): [number, number] => [c.newton_iterations, c.residual])];
  if (all.length === 0) return '';
  const steps = Math.max(1, ...all.map(([step]) => step));
  const values = all.map(([, residual]) => Math.log10(residual));
  const tolerance = unwrap.tolerance && unwrap.tolerance > 0 ? Math.log10(unwrap.tolerance) : null;
  const low = Math.floor(Math.min(...values, tolerance ?? 0)), high = Math.ceil(Math.max(...values) + 1e-9);
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
  for (const [chart, points] of series) {
    points.sort((a, b) => a[0] - b[0]);
    const path = points.map(([s, r], i) => `${i === 0 ? 'M' : 'L'}${x(s).toFixed(1)} ${y(Math.log10(r)).toFixed(1)}`).join('');
    svg += `<path class="line" d="${path}"><title>chart ${chart} of the solver</title></path>`;
    for (const [s, r] of points) svg += `<circle class="step" cx="${x(s).toFixed(1)}" cy="${y(Math.log10(r)).toFixed(1)}" r="1.6"/>`;
  }
  for (const chart of ends) {
    const at = `cx="${x(chart.newton_iterations).toFixed(1)}" cy="${y(Math.log10(chart.residual)).toFixed(1)}"`;
    svg += `<circle class="${chart.converged ? 'end' : 'end bad'}" ${at} r="3"><title>${chart.triangles.toLocaleString('en')} triangles, ${chart.newton_iterations} steps${chart.converged ? '' : ', not converged'}</title></circle>`;
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
