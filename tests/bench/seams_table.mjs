// node seams_table.mjs PLANISH FOLDER WORK [NODE_MODULES]: how planish's seams, and xatlas' where NODE_MODULES has it
// (xatlas_unwrap.mjs), compare with those of the people who made the UV of FOLDER/*.obj. Prints Markdown tables. All
// figures are those of `planish check`.
import { spawnSync } from "node:child_process";
import fs from "node:fs";
import path from "node:path";

const [planish, folder, work, modules] = process.argv.slice(2);
const here = import.meta.dirname ?? path.dirname(new URL(import.meta.url).pathname);
const run = (program, args) => spawnSync(program, args, { encoding: "utf8", maxBuffer: 1 << 28 });

function check(file) {
  return JSON.parse(run(planish, ["check", file, "--json"]).stdout);
}

// The map that a tool makes of a mesh; null: none.
const tools = {
  planish: (mesh, map) => run(planish, ["unwrap", mesh, "-o", map, "-q", "--progress=none"]).status === 0,
  "planish, keep,uv": (mesh, map) =>
    run(planish, ["unwrap", mesh, "-o", map, "-q", "--progress=none", "--seams=keep,uv"]).status === 0,
};
if (run(planish, ["unwrap", "--help"]).stdout.includes("--prefer")) {
  tools["planish, prefer texture"] = (mesh, map) =>
    run(planish, ["unwrap", mesh, "-o", map, "-q", "--progress=none", "--prefer=texture"]).status === 0;
}
if (modules) {
  tools.xatlas = (mesh, map) => {
    const bare = path.join(work, "bare.obj");
    const lines = fs.readFileSync(mesh, "utf8").split("\n");
    const places = lines.filter((line) => line.startsWith("v "));
    const faces = lines.filter((line) => line.startsWith("f ")).map((line) => line.replace(/\/\S*/g, ""));
    fs.writeFileSync(bare, [...places, ...faces, ""].join("\n"));
    const { status } = run("node", [path.join(here, "xatlas_unwrap.mjs"), modules, bare, map, "4", "1024"]);
    if (status !== 0) return false;
    fs.writeFileSync(map, [...places, fs.readFileSync(map, "utf8")].join("\n"));
    return true;
  };
}

const names = fs.readdirSync(folder).filter((name) => name.endsWith(".obj")).sort();
if (names.length === 0) throw new Error(`${folder} has no .obj`);
const artists = new Map(names.map((name) => [name, check(path.join(folder, name))]));
const geometric = (values) => Math.exp(values.reduce((sum, x) => sum + Math.log(Math.max(x, 1e-6)), 0) / values.length);
const mean = (values) => values.reduce((sum, x) => sum + x, 0) / values.length;
const median = (values) => values.toSorted((a, b) => a - b)[values.length >> 1];
const chartsOf = (map) => map.charts;

const rows = [];
const each = [];
for (const [tool, unwrap] of [["artist", null], ...Object.entries(tools)]) {
  const results = [];
  for (const name of names) {
    const map = path.join(work, `${tool.replace(/\W+/g, "_")}.${name}`);
    if (unwrap && !unwrap(path.join(folder, name), map)) {
      each.push(`| ${name} | ${tool} | no map | | | | | |`);
      continue;
    }
    const own = unwrap ? check(map) : artists.get(name), artist = artists.get(name);
    results.push({ own, artist });
    const symmetry = own.seam_symmetry === null ? "" : own.seam_symmetry.toFixed(2);
    each.push(
      `| ${name} | ${tool} | ${chartsOf(own)} | ${own.seam_length.toFixed(2)} | ${own.visible_seam_length.toFixed(2)} | ` +
        `${own.seam_turn_deg.toFixed(1)} | ${symmetry} | ${own.stretch_l2.toFixed(3)} |`,
    );
  }
  if (results.length === 0) continue;
  const ratio = (of) => geometric(results.map(({ own, artist }) => of(own) / Math.max(of(artist), 1e-6))).toFixed(2);
  const symmetric = results.filter(({ own }) => own.seam_symmetry !== null);
  rows.push(
    `| ${tool} | ${results.length} | ${ratio(chartsOf)} | ${ratio((m) => m.seam_length)} | ${ratio((m) => m.visible_seam_length)} | ` +
      `${mean(results.map(({ own }) => own.seam_turn_deg)).toFixed(1)} | ` +
      `${symmetric.length > 0 ? mean(symmetric.map(({ own }) => own.seam_symmetry)).toFixed(2) : ""} | ` +
      `${median(results.map(({ own }) => own.stretch_l2)).toFixed(3)} | ${tool === "xatlas" ? "" : mean(results.map(({ own }) => own.packing_efficiency)).toFixed(2)} |`,
  );
}
console.log("| | maps | charts | seam | visible seam | turn | symmetry | stretch | packing efficiency |");
console.log("|---|--:|--:|--:|--:|--:|--:|--:|--:|");
console.log(rows.join("\n"));
console.log("\n| mesh | | charts | seam | visible seam | turn | symmetry | stretch |");
console.log("|---|---|--:|--:|--:|--:|--:|--:|");
console.log(each.toSorted().join("\n"));
