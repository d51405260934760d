// The contact sheet of many files: a picture and the key figures of each, and a link to its page.
import { escape } from './plots';
import './colors.css';
import './sheet.css';

// As client/cli/report.cc writes it.
interface Row {
  name: string;
  result: string;
  page?: string; // address, seen from the sheet
  message?: string;
  picture?: string; // a PNG file, base64
  triangles?: number;
  charts?: number;
  efficiency?: number;
  stretch?: number | null; // null: without bounds
  overlaps?: number;
  flipped?: number;
  warnings?: number;
  seconds?: number;
}

interface Sheet {
  title: string;
  version: string;
  rows: Row[];
}

interface Column {
  key: keyof Row | 'order';
  title: string;
  help: string;
  text: (row: Row) => string;
  value: (row: Row) => number | string | undefined;
  worstFirst: boolean; // on the first click
}

// The results of files, worst first.
const RESULTS: Record<string, string> = {
  failed: 'failed', not_usable: 'not usable', cancelled: 'cancelled', not_tried: 'not tried', queued: 'queued', usable: 'usable', shown: 'shown',
};
const RESULT_ORDER = Object.keys(RESULTS);

const count = (value: number | undefined): string => (value === undefined ? '' : value.toLocaleString('en'));
const fixed = (value: number | null | undefined, digits: number): string => (value === undefined ? '' : value === null ? '∞' : value.toFixed(digits));
const seconds = (value: number | undefined): string => (value === undefined ? '' : `${value.toFixed(value < 10 ? 2 : value < 100 ? 1 : 0)} s`);

const COLUMNS: Column[] = [
  { key: 'name', title: 'file', help: 'Name of the file', text: (r) => r.name, value: (r) => r.name, worstFirst: false },
  { key: 'result', title: 'result', help: 'What became of it', text: (r) => RESULTS[r.result] ?? r.result, value: (r) => RESULT_ORDER.indexOf(r.result), worstFirst: false },
  { key: 'triangles', title: 'triangles', help: 'Triangles of the file', text: (r) => count(r.triangles), value: (r) => r.triangles, worstFirst: true },
  { key: 'charts', title: 'charts', help: 'Charts of the map', text: (r) => count(r.charts), value: (r) => r.charts, worstFirst: true },
  { key: 'efficiency', title: 'efficiency', help: 'Area of the charts over that of the tiles in use', text: (r) => (r.efficiency === undefined ? '' : `${(100 * r.efficiency).toFixed(1)} %`), value: (r) => r.efficiency, worstFirst: false },
  { key: 'stretch', title: 'stretch', help: 'Root mean square stretch of the map; 1: none', text: (r) => fixed(r.stretch, 3), value: (r) => r.stretch ?? (r.stretch === null ? Infinity : undefined), worstFirst: true },
  { key: 'warnings', title: 'warnings', help: 'Warnings on its page', text: (r) => count(r.warnings), value: (r) => r.warnings, worstFirst: true },
  { key: 'seconds', title: 'seconds', help: 'Time of the unwrap', text: (r) => seconds(r.seconds), value: (r) => r.seconds, worstFirst: true },
];

const state = { sortBy: 'order' as Column['key'], isDescending: false, isTable: false, filter: '', isDark: matchMedia('(prefers-color-scheme: dark)').matches };
const sheet = JSON.parse(document.getElementById('planish-sheet')!.textContent!) as Sheet;
const columns = COLUMNS.filter((c) => sheet.rows.some((row) => row[c.key as keyof Row] !== undefined));

function isBad(row: Row): boolean {
  return !['usable', 'shown'].includes(row.result);
}

function address(page: string): string {
  return escape(page.split('/').map(encodeURIComponent).join('/'));
}

// Rows without a value come last in both directions.
function sorted(rows: Row[]): Row[] {
  const column = columns.find((c) => c.key === state.sortBy);
  if (!column) return rows;
  const sign = state.isDescending ? -1 : 1;
  return [...rows].sort((a, b) => {
    const x = column.value(a), y = column.value(b);
    if (x === undefined || y === undefined) return Number(x === undefined) - Number(y === undefined);
    return sign * (typeof x === 'string' ? x.localeCompare(y as string, 'en', { numeric: true }) : x - (y as number));
  });
}

function picture(row: Row): string {
  return row.picture ? `<img loading="lazy" decoding="async" width="320" height="160" alt="surface and layout of ${escape(row.name)}" src="data:image/png;base64,${row.picture}">` : `<span class="empty">${escape(RESULTS[row.result] ?? row.result)}</span>`;
}

function card(row: Row): string {
  const figures = columns
    .filter((c) => !['name', 'result'].includes(c.key) && c.text(row) !== '')
    .map((c) => `<div class="${c.key}${c.key === 'warnings' && row.warnings ? ' some' : ''}" title="${c.help}"><dt>${c.title}</dt><dd>${escape(c.text(row))}</dd></div>`)
    .join('');
  const said = row.message ? `<p class="message">${escape(row.message)}</p>` : '';
  const badge = row.result === 'shown' || row.result === 'usable' ? '' : `<b class="badge">${escape(RESULTS[row.result] ?? row.result)}</b>`;
  const inside = `<span class="picture">${picture(row)}</span><h2>${escape(row.name)}</h2>${badge}${said}<dl>${figures}</dl>`;
  return row.page ? `<a class="card${isBad(row) ? ' bad' : ''}" href="${address(row.page)}">${inside}</a>` : `<div class="card${isBad(row) ? ' bad' : ''}">${inside}</div>`;
}

function head(): string {
  return columns
    .map((c) => `<th title="${c.help}" aria-sort="${c.key !== state.sortBy ? 'none' : state.isDescending ? 'descending' : 'ascending'}"><button data-sort="${c.key}">${c.title}</button></th>`)
    .join('');
}

function line(row: Row): string {
  const cells = columns.map((c) => {
    const text = escape(c.text(row));
    if (c.key === 'name') return `<td>${row.page ? `<a href="${address(row.page)}">${text}</a>` : text}${row.message ? `<p class="message">${escape(row.message)}</p>` : ''}</td>`;
    return `<td class="${c.key}${c.key === 'warnings' && row.warnings ? ' some' : ''}">${text}</td>`;
  });
  return `<tr class="${isBad(row) ? 'bad' : ''}">${cells.join('')}</tr>`;
}

const app = document.getElementById('app')!;

function summary(): string {
  const counts = RESULT_ORDER.map((result) => [RESULTS[result]!, sheet.rows.filter((row) => row.result === result).length] as const).filter(([, n]) => n > 0);
  return `${count(sheet.rows.length)} ${sheet.rows.length === 1 ? 'file' : 'files'}: ${counts.map(([name, n]) => `${count(n)} ${name}`).join(', ')} · planish ${sheet.version}`;
}

function render(): void {
  document.documentElement.dataset.theme = state.isDark ? 'dark' : 'light';
  const words = state.filter.toLowerCase().split(/\s+/).filter((word) => word !== '');
  const rows = sorted(sheet.rows.filter((row) => words.every((word) => `${row.name} ${RESULTS[row.result]}`.toLowerCase().includes(word))));
  for (const button of app.querySelectorAll<HTMLElement>('.toolbar [data-sort]')) {
    const isOn = button.dataset.sort === state.sortBy;
    button.setAttribute('aria-pressed', String(isOn));
    button.dataset.direction = isOn && state.sortBy !== 'order' ? (state.isDescending ? 'down' : 'up') : '';
  }
  for (const button of app.querySelectorAll<HTMLElement>('[data-view]')) {
    button.setAttribute('aria-pressed', String((button.dataset.view === 'table') === state.isTable));
  }
  const main = app.querySelector('main')!;
  main.innerHTML = rows.length === 0 ? '<p class="none">No file has such a name or result.</p>'
    : state.isTable ? `<table><thead><tr>${head()}</tr></thead><tbody>${rows.map(line).join('')}</tbody></table>`
    : `<div class="cards">${rows.map(card).join('')}</div>`;
}

document.title = `${sheet.title} – planish report`;
app.innerHTML = `
  <header>
    <h1>${escape(sheet.title)}</h1><p>${escape(summary())}</p>
    <button id="theme" title="Dark or light (T)" aria-label="Dark or light">◐</button>
  </header>
  <div class="toolbar" role="toolbar" aria-label="What is shown">
    <span>Sort by</span>
    <div class="group"><button data-sort="order" title="As they were named">order</button>${columns.map((c) => `<button data-sort="${c.key}" title="${c.help}">${c.title}</button>`).join('')}</div>
    <div class="group"><button data-view="cards">Pictures</button><button data-view="table">Table</button></div>
    <input type="search" placeholder="Name or result (/)" aria-label="Show only files with this name or result">
  </div>
  <main></main>`;
const search = app.querySelector<HTMLInputElement>('input')!;
search.addEventListener('input', () => {
  state.filter = search.value;
  render();
});
app.addEventListener('click', (event) => {
  const button = (event.target as HTMLElement).closest<HTMLElement>('button');
  if (!button) return;
  const { sort, view } = button.dataset;
  if (sort) {
    state.isDescending = state.sortBy === sort ? !state.isDescending && sort !== 'order' : (columns.find((c) => c.key === sort)?.worstFirst ?? false);
    state.sortBy = sort as Column['key'];
  }
  if (view) state.isTable = view === 'table';
  if (button.id === 'theme') state.isDark = !state.isDark;
  render();
  if (sort && button.closest('th')) main().querySelector<HTMLElement>(`th [data-sort="${sort}"]`)?.focus();
});
function main(): HTMLElement {
  return app.querySelector('main')!;
}
window.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target === search) return;
  if (event.key === '/') {
    event.preventDefault();
    search.focus();
  }
  if (event.key.toLowerCase() === 't') app.querySelector<HTMLElement>('#theme')!.click();
});
render();
