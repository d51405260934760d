#!/usr/bin/env bash
# Measures, and writes a Markdown table and PNG plots:
#
#   tests/bench/run.sh paper            table 1 and figure 2 of the paper, and what each step away from it buys
#   tests/bench/run.sh scale [MESH...]  20,000 to 2 million triangles: time, CPU, iterations, memory
#   tests/bench/run.sh peers [MESH...]  Blender's ABF and CGAL's LSCM on the same meshes, in turn, on one core
#   tests/bench/run.sh atlas [MESH...]  whole atlases, beside Blender's Smart UV Project and xatlas, in turn, on one core
#   tests/bench/run.sh seams FOLDER     seams beside those of the artists who made the UV of FOLDER/*.obj, and xatlas'; pictures
#   tests/bench/run.sh memory [MESH...] peak memory and seconds of jobs, beside the estimates made of their counts
#   tests/bench/run.sh tuning           each constant of the solver, linear algebra and boundary control halved and doubled
#   tests/bench/run.sh farm             jobs a second that one PostgreSQL takes, 200 machines and 100,000 waiting jobs
#   tests/bench/run.sh chaos            1,000 jobs through a farm whose fronts, workers and database are killed
#   tests/bench/run.sh service          what a server costs beside the work, 1,000 watchers, 500 jobs and 50 kills
#   tests/bench/run.sh report           what a report of a million triangles adds to an unwrap, and how long it takes to open
#   tests/bench/run.sh textures         how models look after their images moved, what that costs, a scan onto its copy
#   tests/bench/run.sh mutations        100,000 damaged meshes and messages against a server (--quick: 2,000)
#
#   --quick      small sizes and few rounds, to see that it works; results go to BUILD/results
#   --build DIR  where to build (default build/bench)
#   --out DIR    where the results go (default tests/bench/results)
#
# MESH is a file, FILE@LEVELS for Loop subdivision, NAME:TRIANGLES or FAMILY:TRIANGLES:SEED (bench_meshes.h), measured
# beside those chosen here. atlas measures MESH instead of its own choice: scans (of ../shared/meshes where that optional
# folder is, else Spot and surfaces by formula), hard-surface parts, generated meshes of 50,000 to 2 million triangles, and
# small ones; memory measures shared meshes beside its own. Packages: deploy/install-packages.sh build test bench.
# What others' programs measure is left out, and said so, where they are missing. atlas gets xatlas through npm
# (WebAssembly). XATLAS names a program to use instead, made of xatlas' source, best without threads: it is called with
# MESH.obj MAP.obj PADDING SIZE and does what tests/bench/xatlas_unwrap.mjs does. In the environment, too: CORE, the
# core that everything on one core runs on (default 0), ROUNDS of atlas, farm and report (default 3), STANDBY_ROUNDS of farm's
# second half (default ROUNDS), LIMIT, the seconds after which atlas gives up on a tool (default 300), INPUTS of
# mutations (default 100,000), SEEDS of chaos, which choose what dies when (default "1 2 3"), and JOBS for the build
# (default 2).
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
spot=$root/tests/data/spot_seam.obj
font=DejaVu-Sans # of fonts-dejavu-core. ImageMagick's own default, Helvetica, is not free and often missing

fail() {
  echo "run.sh: $*" >&2
  exit 2
}

[ $# -gt 0 ] || { sed -n '2,/^set/{/^set/d;s/^# \{0,1\}//;p}' "$0" >&2; exit 2; }
bench=$1 quick="" build=$root/build/bench out="" meshes=()
shift
while [ $# -gt 0 ]; do
  case $1 in
    --quick) quick=1 ;;
    --build) [ $# -gt 1 ] || fail "--build DIR"; build=$2; shift ;;
    --out) [ $# -gt 1 ] || fail "--out DIR"; out=$2; shift ;;
    -*) fail "no such flag: $1" ;;
    *) meshes+=("$1") ;;
  esac
  shift
done
case $bench in
  paper | scale | peers | atlas | seams | memory | tuning | service | farm | chaos | mutations | report | textures) ;;
  *) fail "no such bench: $bench (paper, scale, peers, atlas, seams, memory, tuning, service, farm, chaos, mutations, report, textures)" ;;
esac
[ -n "$out" ] || { [ -n "$quick" ] && out=$build/results || out=$here/results; }
case $bench in
  memory | seams | tuning | service | farm | chaos | mutations | report | textures) ;;
  *) command -v gnuplot >/dev/null || fail "no gnuplot: deploy/install-packages.sh bench" ;;
esac

[ -f "$build/CMakeCache.txt" ] ||
  cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DPLANISH_BUILD_BENCHMARKS=ON >/dev/null
# seams and mutations need no measuring program.
[[ $bench == @(seams|mutations) ]] || grep -qE '^PLANISH_BUILD_BENCHMARKS:BOOL=(ON|TRUE|1)$' "$build/CMakeCache.txt" ||
  fail "$build has no measuring programs. Run: cmake -B $build -DPLANISH_BUILD_BENCHMARKS=ON, or leave --build out"
targets=(planish_bench)
case $bench in atlas | service | report) targets+=(planish planishd) ;; esac
[ "$bench" != seams ] || targets=(planish planishd)
[ "$bench" != tuning ] || targets=(planish_tuning_sweep planish_bench_report)
[ "$bench" != farm ] || targets=(planish_store_load planish_bench_report)
[ "$bench" != chaos ] || targets=(planish_farm_chaos)
[ "$bench" != textures ] || targets=(planish_texture_transfer planish planishd)
[ "$bench" != mutations ] || targets=(faults_test)
cmake --build "$build" -j "${JOBS:-2}" --target "${targets[@]}" >&2
bin=$build/bin
work=$build/bench-runs/$bench
rm -rf "$work"
mkdir -p "$work" "$out"
runs=$work/runs.jsonl

# Adds fields, given as the inside of a JSON object, to the objects on stdin, and the result to the runs.
record() { sed "s|^{|{$1,|" >>"$runs"; }

one_core() {
  if command -v taskset >/dev/null; then taskset -c "${CORE:-0}" "$@"; else "$@"; fi
}

blender_version() {
  blender --version 2>/dev/null | sed -n 's/^Blender \([0-9.]*\).*/Blender \1/p' | head -1 || true
}

heading() {
  echo "# $1"
  echo
  echo "\`tests/bench/run.sh $bench${quick:+ --quick}\`, $(date -u +%Y-%m-%d), commit" \
    "$(git -C "$root" rev-parse --short HEAD 2>/dev/null || echo unknown)," \
    "$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1).${quick:+ **Quick settings: not a measurement.**}"
  echo
  echo "$2"
}

plot() {
  gnuplot -e "$1" "$here/$2"
}

paper() {
  local limit=60 repeats=3 meshes=(ear:1796 head:5420 twists:6000 waves:10000 waves:24000 foot:20000 "$spot")
  [ -z "$quick" ] || { limit=5 repeats=1 meshes=(ear:1796 head:5420 twists:6000); }
  local solver mesh step system preconditioner tolerance
  # Unrelenting linear solves to 1e-8, as Newton's method without forcing terms needs them, until the last step.
  for solver in minres uzawa; do
    for mesh in "${meshes[@]}"; do
      echo "$solver $mesh" >&2
      while IFS=, read -r step system preconditioner tolerance; do
        one_core "$bin/planish_solve_time" "$mesh" --step "$step" --solver "$solver" --system "$system" \
          --preconditioner "$preconditioner" --linear-tolerance "$tolerance" --hessian convex \
          --time-limit "$limit" --runs "$repeats" </dev/null >>"$runs"
      done <<'STEPS'
as written,full,none,1e-8
Jacobi,full,jacobi,1e-8
reduced,reduced,none,1e-8
reduced and Jacobi,reduced,jacobi,1e-8
reduced and multigrid,reduced,amg,1e-8
and forcing,reduced,amg,0
STEPS
    done
  done
  for mesh in "${meshes[@]}"; do
    if [ "$mesh" = ear:1796 ]; then set -- "$work/spy"; else set --; fi
    "$bin/planish_kkt_nonzeros" "$mesh" "$@" >>"$runs"
  done
  heading "The paper again" "Meshes by formula of the paper's sizes and names (\`tests/bench/bench_meshes.h\`; the
paper's own are not public), and Spot from \`tests/data\`. Every constraint and the gradient to 1e-9 radians per angle; the linear
systems to 1e-8, except for the last step; a Hessian made positive where it is not; one core; given up after
$limit seconds. Seconds are CPU seconds of the solve, medians of $repeats runs." |
    "$bin/planish_bench_report" paper "$runs" "$work/paper" >"$out/paper.md"
  plot "columns='$work/paper.steps'; out='$out/paper.png'" paper.gp
  spy_count() { LC_ALL=C printf "%d" "$(wc -l <"$work/spy.$1")" | sed ':a;s/\B[0-9]\{3\}\>/,&/;ta'; }
  plot "spy='$work/spy'; rows=$(tail -1 "$work/spy.log" | awk '{print $2 + 1}'); left='$(spy_count product)';
    right='$(spy_count log)'; out='$out/figure2.png'" figure2.gp
}

scale() {
  local foot=(20000 63000 200000 630000 2000000) levels=(0 1 2 3) repeats=3 threads=(1)
  [ -z "$quick" ] || { foot=(5000 20000) levels=(0 1) repeats=1; }
  local flag=""
  if "$bin/planish_solve_time" --help | grep -q -- --threads; then
    flag=--threads threads=(1)
    [ "$(nproc)" -lt 2 ] || threads=(1 2)
  fi
  measure() {  # FAMILY THREADS MESH REPEATS
    echo "$3, threads: $2" >&2
    "$bin/planish_solve_time" "$3" --runs "$4" ${flag:+$flag $2} --time-limit 120 |
      record "\"threads\":$2,\"family\":\"$1\""
  }
  local t n mesh
  for t in "${threads[@]}"; do
    for n in "${foot[@]}"; do measure foot "$t" "foot:$n" "$repeats"; done
    for n in "${levels[@]}"; do measure "Spot, subdivided" "$t" "$spot@$n" "$repeats"; done
    for mesh in "${meshes[@]}"; do measure "$(basename "${mesh%%[.:]*}")" "$t" "$mesh" 1; done
  done
  heading "Up to two million triangles" "Disc check, solve, layout and placement with the default options, without
reading the file and without the verifier; medians of up to $repeats runs in one process, all but the first of which have
their memory already. \`foot\` is a surface by formula
(\`tests/bench/bench_meshes.h\`), \`spot_seam_L3\` is \`tests/data/spot_seam.obj\` after three Loop subdivisions. Peak bytes are
the most that the whole unwrapping, verifier included, held at once beyond the mesh itself." |
    "$bin/planish_bench_report" scale "$runs" "$work/scale" >"$out/scale.md"
  plot "columns='$work/scale.columns'; out='$out/scale.png'" scale.gp
}

peers() {
  local rounds=5 all=("$spot" waves:24000 foot:20000 "$spot@1") version
  [ -z "$quick" ] || { rounds=2 all=(ear:1796 foot:5000); }
  local tools=(planish) missing=""
  if command -v blender >/dev/null; then tools+=(blender); else missing+=" Blender was not there."; fi
  if [ -x "$bin/planish_cgal_lscm" ]; then tools+=(cgal); else missing+=" CGAL was not there."; fi
  version=$(blender_version)
  local mesh round tool file map seconds quality flag=""
  "$bin/planish_solve_time" --help | grep -q -- --threads && flag="--threads 1"
  for mesh in "${all[@]}" "${meshes[@]}"; do
    file=$work/mesh.obj
    local triangles label
    label=$("$bin/planish_write_mesh" "$mesh" "$file")
    triangles=$(grep -c '^f ' "$file")
    for round in $(seq "$rounds"); do
      echo "$mesh, round $round" >&2
      for tool in "${tools[@]}"; do
        map=$work/$tool.obj quality=
        case $tool in
          planish)
            # shellcheck disable=SC2086  # a flag and its value
            one_core "$bin/planish_solve_time" "$mesh" $flag --runs 2 |
              sed '2s/"tool":"planish"/"tool":"planish_warm"/' | record "\"round\":$round"
            continue
            ;;
          blender)
            seconds=$(one_core blender -b --factory-startup -t 1 -P "$here/blender_unwrap.py" -- abf "$file" "$map" \
              2>/dev/null | sed -n 's/^RESULT //p') || true
            ;;
          cgal) seconds=$(one_core "$bin/planish_cgal_lscm" "$file" "$map" | sed -n 's/^RESULT //p') || true ;;
        esac
        if [ -z "$seconds" ]; then
          echo "{\"mesh\":\"$label\",\"tool\":\"$tool\",\"round\":$round,\"triangles\":$triangles,\"ended\":\"failed\"}" \
            >>"$runs"
          continue
        fi
        # The same map in every round: judged once.
        [ "$round" -gt 1 ] || quality=$("$bin/planish_uv_quality" "$file" "$map")
        printf '%s\n' "${quality:-{\"triangles\":$triangles\}}" |
          record "\"mesh\":\"$label\",\"tool\":\"$tool\",\"round\":$round,$seconds"
      done
    done
  done
  heading "Against others" "Each round runs every tool once, one after the other, on one core; medians of $rounds rounds, and
each tool's CPU time over planish's in the same round. planish: disc check, solve, layout, placement, without its verifier,
in a new process; its second run there has its memory already, as a worker of the service has after its first job, and \"times its warm
solve\" is over the part of that run from target angles to UV. A new process can cost much more where a hypervisor has to find the memory.
${version:-Blender}: its ABF unwrap operator (Debian's package). CGAL: \`LSCM_parameterizer_3\` with its defaults,
the parameterization alone; a linear method, not ABF. The ABF energy (mean over all angles) and everything after it are measured by
planish's own code on each tool's UV as delivered.$missing" |
    "$bin/planish_bench_report" peers "$runs" "$work/peers" >"$out/peers.md"
  plot "columns='$work/peers.columns'; out='$out/peers.png'" peers.gp
}

# Runs a command on one core, its output to OUT, and sets `command_seconds`. Its exit code is that of the command.
timed() {  # OUT COMMAND...
  local out=$1 code=0 LC_ALL=C TIMEFORMAT=%R
  shift
  { time one_core timeout "${LIMIT:-300}" "$@" >"$out" 2>"$work/errors"; } 2>"$work/seconds" || code=$?
  command_seconds=$(cat "$work/seconds")
  return "$code"
}

# xatlas as npm's @gltf-transform/cli carries it, kept between runs. Prints its folder, or nothing.
install_xatlas() {
  local folder=$build/bench-runs/npm
  command -v node >/dev/null && command -v npm >/dev/null || return 0
  if [ ! -f "$folder/node_modules/watlas/package.json" ]; then
    npm install --prefix "$folder" --ignore-scripts --no-audit --no-fund --fetch-retries=1 @gltf-transform/cli@4 \
      >"$work/npm.log" 2>&1 || return 0
  fi
  echo "$folder/node_modules"
}

atlas() {
  local rounds=${ROUNDS:-3} padding=2 size=1024 shared=$root/../shared/meshes modules name tools=(planish) missing="" about=""
  local scans=("$spot" "$spot@1" foot:20000 waves:24000) parts=() all=()
  if [ -n "$quick" ]; then
    rounds=1 all=(ear:1796 foot:5000 assembly:2000:1)
  else
    if [ -d "$shared" ]; then
      scans=()
      for name in spot_23062 koala_99994 boot_g12_39906 human_neutral_20908 barramundi_uv_3864 corset_uv_18324; do
        if [ -f "$shared/$name.obj" ]; then scans+=("$shared/$name.obj"); else missing+=" $name was not there."; fi
      done
      for name in milk_truck box_animated; do
        if [ -f "$shared/$name.glb" ]; then parts+=("$shared/$name.glb"); else missing+=" $name was not there."; fi
      done
    fi
    parts+=(assembly:3000:1 assembly:6000:2 assembly:10000:3 assembly:15000:4 assembly:20000:5 assembly:30000:6
      assembly:50000:7 assembly:80000:8)
    all=("${scans[@]}" "${parts[@]}"
      surface_nets:50000:1 dual_contouring:100000:2 sparse_nets:200000:3 marching_cubes:400000:4 surface_nets:800000:5
      surface_nets:2000000:6
      surface_nets:1000:7 high_genus:2000:1 quantized:3000:2 skirts:4000:3 slivers:5000:4)
  fi
  [ ${#meshes[@]} -eq 0 ] || all=("${meshes[@]}")
  if command -v blender >/dev/null; then tools+=(blender); else missing+=" Blender was not there."; fi
  if [ -n "${XATLAS:-}" ]; then
    tools+=(xatlas)
    about=" (native, without threads)"
  elif modules=$(install_xatlas) && [ -n "$modules" ]; then
    tools+=(xatlas)
    about=" ($(node -p "['@gltf-transform/cli', 'watlas'].map(p => p + ' ' +
      JSON.parse(require('fs').readFileSync('$modules/' + p + '/package.json')).version).join(', ')"))"
  else
    missing+=" xatlas was not there: it takes node, npm and a registry."
  fi
  local mesh file=$work/mesh.obj label triangles round tool map result quality tile keep code report command_seconds
  for mesh in "${all[@]}"; do
    label=$("$bin/planish_write_mesh" "$mesh" "$file")
    triangles=$(grep -c '^f ' "$file")
    for round in $(seq "$rounds"); do
      for tool in "${tools[@]}"; do
        echo "$label, round $round, $tool" >&2
        map=$work/$label.$tool.obj result=$work/result code=0 report="" quality=""
        rm -f "$map"
        case $tool in
          planish)
            timed "$result" "$bin/planish" unwrap "$file" -o "$map" --threads=1 --texture-size="$size" \
              --padding="$padding" --json --progress=none || code=$?
            [ "$code" -ne 0 ] || report="\"report\":$(tr -d '\n' <"$result"),"
            ;;
          blender)
            timed "$result" blender -b --factory-startup -t 1 -P "$here/blender_unwrap.py" -- smart "$file" "$map" \
              "$(awk "BEGIN { print $padding / 2 / $size }")" || code=$?
            ;;
          xatlas)
            if [ -n "${XATLAS:-}" ]; then
              timed "$result" "$XATLAS" "$file" "$map" "$padding" "$size" || code=$?
            else
              timed "$result" node "$here/xatlas_unwrap.mjs" "$modules" "$file" "$map" "$padding" "$size" || code=$?
            fi
            ;;
        esac
        [ "$tool" = planish ] || report=$(sed -n 's/^RESULT \(.*\)/\1,/p' "$result")
        report+="\"mesh\":\"$label\",\"tool\":\"$tool\",\"round\":$round,\"command_seconds\":$command_seconds"
        if [ "$code" -ne 0 ] || [ ! -f "$map" ]; then
          cat "$work/errors" >&2
          local ended=failed
          [ "$code" -ne 124 ] || ended="over ${LIMIT:-300}"
          echo "{$report,\"triangles\":$triangles,\"ended\":\"$ended\"}" >>"$runs"
          continue
        fi
        # The same map in every round: judged once.
        if [ "$round" -eq 1 ]; then
          tile=$(sed -n 's/.*"tile":\[\([0-9]*\),\([0-9]*\)\].*/\1 \2/p' "$result")
          if [ -n "$tile" ]; then keep=$padding; else keep=$padding/$size tile="1 1"; fi
          # shellcheck disable=SC2086  # two numbers
          quality=$("$bin/planish_uv_quality" "$file" "$map" --tile $tile \
            --padding "$(awk "BEGIN { print 0.99 * $keep }")")
        else
          quality="{\"triangles\":$triangles}"
        fi
        echo "{$report,${quality#\{}" >>"$runs"
      done
    done
  done
  heading "Atlases, against others" "Default settings but for the padding, $padding texels of $size between charts for everyone. Each
round runs every tool once, one after the other, on one core; medians of $rounds rounds, and each tool's seconds over planish's
in the same round. \"Whole command\" has start, reading and writing as well.

- planish: \`planish unwrap --threads=1\`, seconds of its report from charts to the verifier.
- Meshes named NAME_TRIANGLES_SEED are made by \`tests/testing/families.h\`. \`assembly\` is parts as of hard-surface models: welded,
  touching, intersecting, some turned inside out or doubled.
$(command -v blender >/dev/null && echo "- $(blender_version): Smart UV Project at 66 degrees, then Pack Islands, seconds of these
  operators; 1/$size of the texture stays free round each chart, by the exact margin method.")
- xatlas$about: given up after ${LIMIT:-300} s; called as \`gltf-transform unwrap\` calls it, but with the padding, for which that has no
  flag, on the welded mesh without normals; seconds of xatlas alone. Where its atlas is not within 2 % of $size texels, its charts
  are packed again at that size, off the clock; charts keep their distance in texels of the size that comes out.

All maps are judged by planish's own code as delivered (\`tests/bench/uv_quality.cc\`). Charts: triangles joined where both ends of
an edge agree. Packing efficiency: area of the triangles over that of the atlas. L2 stretch and mean angle error (degrees): of the
triangles that have area in the map; those that have none are degenerate, and in no chart. Mirrored: turned over. Charts too
near: pairs nearer than the padding less a hundredth for rounding, overlapping ones included.$missing" |
    "$bin/planish_bench_report" atlas "$runs" "$work/atlas" >"$out/atlas.md"
  plot "columns='$work/atlas'; out='$out/atlas.png'" atlas.gp
}

service() {
  local load=$bin/planish_service_load
  if [ -n "$quick" ]; then
    { "$load" overhead 3; "$load" workers 4; "$load" watchers 1; "$load" chaos 20 3; } >"$runs"
  else
    { "$load" overhead 50; "$load" workers 30; "$load" watchers 7; "$load" chaos 500 50; } >"$runs"
  fi
  heading "A server beside its work" "All on one machine, over loopback, workers of one thread. Ratios are of one run." |
    "$bin/planish_bench_report" service "$runs" "$work/service" >"$out/service.md"
}

# A program of PostgreSQL; as the user postgres where this one is root, whom it refuses.
postgres() {
  local as=()
  [ "$(id -u)" -ne 0 ] || as=(setpriv --reuid=postgres --regid=postgres --clear-groups)
  (cd / && "${as[@]}" /usr/lib/postgresql/15/bin/"$@" </dev/null)
}

# Of a PostgreSQL in a folder that listens on a Unix socket there: with fsync, as a farm has it.
start_postgres() {  # FOLDER SETTING...
  local folder=$1 settings=()
  shift
  for setting in listen_addresses= max_connections=900 shared_buffers=512MB max_wal_size=4GB "$@"; do
    settings+=("-c $setting")
  done
  postgres pg_ctl -D "$folder/data" -l "$folder/log" -w -t 60 -o "-k $folder ${settings[*]}" start >/dev/null
  running+=("$folder")
}

stop_postgres() {
  local folder
  for folder in "${running[@]}"; do postgres pg_ctl -D "$folder/data" -m fast -w stop >/dev/null || true; done
  running=()
}

farm() {
  local running=() primary standby flags=(--rounds "${ROUNDS:-3}")
  [ -z "$quick" ] || flags=(--machines 10 --waiting 1000 --jobs 500 --rounds 1 --sleeping-machines 4)
  primary=$(mktemp -d) standby=$(mktemp -d)
  trap stop_postgres EXIT
  [ "$(id -u)" -ne 0 ] || chown postgres "$primary" "$standby"
  postgres initdb -D "$primary/data" -U planish --auth=trust --no-locale -E UTF8 >/dev/null
  start_postgres "$primary"
  load() {  # DATABASE STANDBY FLAG...
    local database=$1 how=$2
    shift 2
    postgres psql -h "$primary" -U planish -d postgres -qc "CREATE DATABASE $database"
    "$bin/planish_store_load" "postgresql://planish@/$database?host=$primary" "${flags[@]}" "$@" |
      record "\"standby\":\"$how\""
  }
  echo "one PostgreSQL" >&2
  load alone none
  postgres pg_basebackup -h "$primary" -U planish -D "$standby/data" -R -C -S standby -c fast >/dev/null
  start_postgres "$standby"
  postgres psql -h "$primary" -U planish -d postgres -qc "ALTER SYSTEM SET synchronous_standby_names = '*'" \
    -c "SELECT pg_reload_conf()" >/dev/null
  echo "with a synchronous standby" >&2
  load mirrored synchronous --sleeping-machines 0 ${STANDBY_ROUNDS:+--rounds "$STANDBY_ROUNDS"}
  stop_postgres
  trap - EXIT
  rm -rf "$primary" "$standby"
  heading "A farm's store" "One PostgreSQL 15 with fsync, its clients and, in the second half, a synchronous standby on this
machine's $(nproc) cores. Machines are threads with a connection and a listener each (\`tests/bench/store_load.cc\`); nothing is unwrapped." |
    "$bin/planish_bench_report" farm "$runs" "$work/farm" >"$out/farm.md"
}

memory() {
  local shared=$root/../shared/meshes name mesh seams threads all=() discs=() missing="" triangles
  for triangles in 1000 3000 10000 30000 100000 300000 1000000; do discs+=("foot:$triangles"); done
  discs+=(head:100000 waves:100000 "$spot" "$spot@1" "$spot@2")
  [ -z "$quick" ] || discs=(foot:1000 foot:20000)
  for name in human_neutral_20908 spot_23062 boot_g12_39906 koala_99994; do
    [ -z "$quick" ] || break
    if [ -f "$shared/$name.obj" ]; then all+=("$shared/$name.obj"); else missing+=" $name was not there."; fi
  done
  [ ${#all[@]} -eq 0 ] || all+=("$shared/spot_23062.obj@1" "$shared/spot_23062.obj@2" "$shared/koala_99994.obj@1")
  [ ${#meshes[@]} -eq 0 ] || all=("${meshes[@]}")
  measure_memory() {  # MESH SEAMS
    for threads in 1 2; do
      [ "$1$2" != foot:1000000auto ] || continue  # minutes
      echo "$1, seams $2, threads: $threads" >&2
      nice -n 5 "$bin/planish_memory_use" "$1" "$2" "$threads" >>"$runs" || echo "$1 failed" >&2
    done
  }
  for mesh in "${discs[@]}"; do
    for seams in none auto; do measure_memory "$mesh" "$seams"; done
  done
  for mesh in "${all[@]}"; do measure_memory "$mesh" auto; done
  heading "Memory and seconds against their estimates" "Each run is a process of its own: peak resident memory (VmHWM) less what
was resident before the encoded mesh was read; decoding, unwrapping with default options, UV as float; CPU seconds of all
threads. Estimates
(\`core/unwrap/estimate.h\`) know the counts that the first bytes of the Draco data declare, the size of the data and the
options.$missing" |
    "$bin/planish_bench_report" memory "$runs" "$work/memory" >"$out/memory.md"
}

tuning() {
  one_core "$bin/planish_tuning_sweep" ${quick:+--quick} >"$runs"
  heading "Constants of the solver, halved and doubled" "Each constant of \`FlattenTuning\` (\`core/abf/tuning.h\`, \`core/linalg/tuning.h\`) by itself, the
others at their defaults, on discs by formula (\`tests/bench/tuning_sweep.cc\`). Fractions like 0.95 are varied by their distance from 1,
factors like 1.5 by their excess over 1. One thread." |
    "$bin/planish_bench_report" tuning "$runs" "$work/tuning" >"$out/tuning.md"
}

chaos() {
  local jobs=1000
  [ -z "$quick" ] || jobs=100
  {
    heading "A farm that dies" "Two fronts behind HAProxy, three workers, PostgreSQL with a synchronous standby, eight callers who know only the
proxy (\`tests/farm/chaos.cc\`). A run for each seed. Every job ended once, without a gap for its caller,
and nothing was left of it but its record and its result."
    echo
    echo '```'
    for seed in ${SEEDS:-1 2 3}; do
      SEED=$seed CHAOS_JOBS=$jobs "$bin/planish_farm_chaos" | tee "$work/log" | grep ' jobs in ' || { cat "$work/log" >&2; exit 1; }
    done
    echo '```'
  } >"$out/chaos.md"
}

report() {
  local mesh=$work/mesh.obj triangles=1000000
  [ -z "$quick" ] || triangles=20000
  command -v npm >/dev/null && command -v chromium >/dev/null || fail "no npm or no chromium"
  "$bin/planish_write_mesh" "foot:$triangles" "$mesh" >&2
  npm install --prefix "$work" --ignore-scripts --no-audit --no-fund playwright-core@1.49.1 three@0.170.0 >&2
  heading "A report" "\`foot\` by formula, the whole command, with one thread. The page is opened from disk and drawn without a graphics
card; the empty page is one by three.js that draws the same triangles, positions and UV in one colour, in two views (\`tests/bench/report_page.mjs\`)." \
    >"$out/report.md"
  node "$here/report_page.mjs" "$bin/planish" "$(command -v chromium)" "$mesh" "$work" "${ROUNDS:-3}" >>"$out/report.md"
}

seams() {
  [ ${#meshes[@]} -eq 1 ] && [ -d "${meshes[0]}" ] || fail "seams FOLDER: of meshes in OBJ with their artists' UV"
  command -v node >/dev/null || fail "no node: deploy/install-packages.sh bench"
  local folder=${meshes[0]} modules missing=""
  if [ -n "$quick" ]; then
    mkdir "$work/few"
    find "$folder" -name '*.obj' -size -300k | sort | head -2 | xargs -I{} cp {} "$work/few"
    folder=$work/few
  fi
  modules=$(install_xatlas) || modules=""
  [ -n "$modules" ] || missing=" xatlas was not there: it takes node, npm and a registry."
  heading "Seams, against people" "Figures of \`planish check\` (\`core/unwrap/seam_figures.h\`). Charts, seam length and visible seam length: geometric
means of the ratios to the artists'; turn (degrees), symmetry (where there is a mirror plane) and packing efficiency: means; stretch (L2): the
median. Of xatlas' maps, whose UV are texels, the packing efficiency says nothing. The fold of mirrored halves that an artist has
stacked is no seam of his here.$missing
" >"$out/seams.md"
  node "$here/seams_table.mjs" "$bin/planish" "$folder" "$work" ${modules:+"$modules"} >>"$out/seams.md"
  [ -n "$quick" ] || draw_seams "$folder"
}

# draw_seams FOLDER: $out/seams.jpg, eight of its meshes cut by their artists, for the texture, and by default.
draw_seams() {
  local mesh view width rows=()
  while read -r mesh view; do
    [ -f "$1/$mesh.obj" ] || continue
    # shellcheck disable=SC2086  # two angles
    draw_map "$1/$mesh.obj" "$work/$mesh.artist.png" $view --seams=keep,uv
    # shellcheck disable=SC2086
    draw_map "$1/$mesh.obj" "$work/$mesh.texture.png" $view --prefer=texture --max-stretch=1.05
    # shellcheck disable=SC2086
    draw_map "$1/$mesh.obj" "$work/$mesh.seams.png" $view
    rows+=("$work/$mesh".{artist,texture,seams}.png)
  done <<<"fox 20 15
human 10 10
spot 30 15
grey_snapper 30 15
vive 30 15
cannon 30 15
lee_perry_smith 30 15
oculus_hand 0 20"
  [ ${#rows[@]} -gt 0 ] || return 0
  montage "${rows[@]}" -tile 3x -geometry 640x320+4+4 "$work/rows.png"
  width=$(($(identify -format %w "$work/rows.png") / 3))
  convert -size "${width}x50" -background white -fill black -font "$font" -pointsize 28 -gravity center \
    label:"the artist's seams" label:"planish --prefer=texture --max-stretch=1.05" label:"planish" +append \
    "$work/head.png"
  convert "$work/head.png" "$work/rows.png" -append -resize 1200x -quality 80 "$out/seams.jpg"
  printf '\n![Some of the meshes: the artist'"'"'s seams, planish for the texture, planish](seams.jpg)\n' >>"$out/seams.md"
}

# draw_map MESH PNG AZIMUTH ELEVATION [FLAG...]
draw_map() {
  "$bin/planish" unwrap "$1" -o "$work/drawn.obj" -q --progress=none --picture="$2" --view "$3" "$4" "${@:5}"
}

textures() {
  local looks=() sizes=() side=4096 tool=$bin/planish_texture_transfer failed=0
  [ -z "$quick" ] || { looks=(--points=5000) sizes=(--detail=12 --texels=160) side=512; }
  command -v npm >/dev/null && command -v chromium >/dev/null || fail "no npm or no chromium"
  npm install --prefix "$work" --ignore-scripts --no-audit --no-fund playwright-core@1.49.1 >&2
  mkdir -p "$work/samples"
  "$tool" samples "$work/samples" "${sizes[@]}"
  rm "$work/samples/bumps.glb" # has no colours
  "$tool" write "$work/four.glb" "--texels=$side"
  {
    heading "Textures" "Colours at 100,000 points of generated models through the old map and image against the new ones, in 255ths: 2 in the mean
and 12 at the 99th percentile are allowed for smooth content, a tenth more than a resampler of 64 samples a texel for the rest; normals in
degrees, of which 2 are. Images are PNG at equal texel density, one JPEG. Colours are interpolated in linear light, as
glTF asks of a renderer, and compared as sRGB. A renderer that interpolates the encoded values instead draws black letters on white
thinner before and after: there, letters at the 99th percentile differ by 14 % more than the reference's, in the mean by 9 % less."
    echo
    "$tool" looks "${sizes[@]}" "${looks[@]}" || failed=1
    echo
    echo "The same models before and after, drawn by the page of \`planish unwrap --report\` from six sides, about a pixel a texel: the PSNR
over the pixels that the model covers, in dB. Smooth content must reach 36."
    echo
    node "$here/texture_pictures.mjs" "$bin/planish" "$(command -v chromium)" "$work" "$work"/samples/*.glb || failed=1
    printf '\n%s\n\n' "![Before and after](textures.jpg)"
    echo "A mesh of 100,000 triangles with four images of $side x $side: CPU seconds, and the most memory of the process."
    echo
    echo '```'
    "$tool" cost "$work/four.glb" || [ -n "$quick" ] || failed=1 # its limits are for the full size
    echo
    "$tool" project || failed=1
    echo '```'
  } >"$out/textures.md"
  (cd "$work" && montage -font "$font" -label '%t' {smooth_torus,smooth_box,smooth_pair,letters}.{before,after}.png \
    -tile 4x -geometry 360x360+6+6 -quality 82 "$(realpath "$out")/textures.jpg")
  return $failed
}

mutations() {
  local inputs=${INPUTS:-100000}
  [ -z "$quick" ] || inputs=2000
  PLANISH_FAULT_MUTATIONS=$inputs nice -n 5 "$build/tests/faults/faults_test" --gtest_filter='Mutations.*' \
    >"$work/log" || {
    cat "$work/log" >&2
    exit 1
  }
  {
    heading "Damaged meshes and messages" "Requests to a planishd with two isolated workers, four at a time, whose Draco data, or
some of whose fields, or whose bytes are damaged (\`tests/faults/mutations.h\`): the server lived, every call was answered, every accepted job
ended. A second attempt is made for a job that cost its worker, and 18 s of running at most."
    echo
    echo '```'
    sed -n '/inputs in/,/^\[/{/^\[/d;p}' "$work/log"
    echo '```'
  } >"$out/mutations.md"
}

"$bench"
echo "$out/$bench.md" >&2
