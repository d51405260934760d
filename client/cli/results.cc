#include "client/cli/results.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <map>
#include <utility>
#include <vector>

#include "client/cli/field_json.h"
#include "client/cli/text.h"

namespace planish::cli {
namespace {

// RFC 3339 with microseconds, UTC.
std::string TimeText(Job::Time time) {
  const auto since = std::chrono::duration_cast<std::chrono::microseconds>(time.time_since_epoch()).count();
  const std::time_t seconds = static_cast<std::time_t>(since / 1000000);
  std::tm parts = {};
  gmtime_r(&seconds, &parts);
  char date[32], text[48];
  std::strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%S", &parts);
  std::snprintf(text, sizeof text, "%s.%06dZ", date, static_cast<int>(since % 1000000));
  return text;
}

// Renames a key whose JSON name differs from its field.
void Rename(const char* name, const char* key, Json* json) {
  (*json)[key] = (*json)[name];
  json->erase(name);
}

Json ProgressJson(const Progress& progress) {
  Json json = FieldsJson(progress);
  Rename("elapsed", "elapsed_seconds", &json);
  return json;
}

constexpr int kFirstUdim = 1001;

// The name of an atlas, if it is known.
std::string NameOf(const AtlasPart& part, const std::vector<std::string>& names) {
  const auto number = static_cast<std::size_t>(part.atlas);
  return part.atlas >= 0 && number < names.size() ? names[number] : std::string();
}

Json AtlasJson(const Atlas& atlas, const std::vector<std::string>& names) {
  Json json = FieldsJson(atlas);
  if (atlas.atlases.empty()) {
    json.erase("layout");
    json.erase("atlases");
    return json;
  }
  for (std::size_t i = 0; i < atlas.atlases.size(); ++i) {
    Json& entry = json["atlases"][i];
    if (const std::string name = NameOf(atlas.atlases[i], names); !name.empty()) entry["name"] = name;
    Rename("first_tile", "udim", &entry);
    entry["udim"] = kFirstUdim + atlas.atlases[i].first_tile;
  }
  return json;
}

Json SecondsJson(const StageTimes& times) {
  Json json = FieldsJson(times);
  json["upload"] = times.upload.count();
  json["download"] = times.download.count();
  json["total"] = times.total.count();
  return json;
}

Json WarningsJson(const std::vector<Warning>& warnings) {
  Json json = Json::array();
  for (const Warning& warning : warnings) {
    Json entry = {{"reason", warning.reason}, {"message", warning.message}};
    if (!warning.metadata.empty()) entry["metadata"] = warning.metadata;
    json.push_back(entry);
  }
  return json;
}

void AddReport(const Report& report, Json& json, const std::vector<std::string>& atlas_names = {}) {
  json["input"] = {{"triangles", report.triangles}, {"vertices", report.vertices}};
  json.update(FieldsJson(report));
  for (Json& chart : json["charts"]) Rename("boundary", "type", &chart["boundary"]);
  json["atlas"] = AtlasJson(report.atlas, atlas_names);
  json["seconds"] = SecondsJson(report.times);
  json["warnings"] = WarningsJson(report.warnings);
}

Json ErrorJson(const Error& error) {
  return {{"code", ToString(error.code())},
          {"reason", error.reason()},
          {"message", error.what()},
          {"metadata", error.metadata()}};
}

}  // namespace

std::string ToLine(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string ToText(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string ValidUtf8(const std::string& text) {
  return Json::parse(ToLine(Json(text))).get<std::string>();
}

Json ToJson(const Job& job) {
  Json json = {{"job", job.name}, {"state", ToString(job.state)}, {"labels", Json(job.labels)}};
  if (!job.trace_id.empty()) json["trace_id"] = job.trace_id;
  if (job.create_time) json["create_time"] = TimeText(*job.create_time);
  if (job.start_time) json["start_time"] = TimeText(*job.start_time);
  if (job.end_time) json["end_time"] = TimeText(*job.end_time);
  json["mesh_bytes"] = job.mesh_bytes;
  if (job.state == JobState::kQueued) json["queue_position"] = job.queue_position;
  if (job.progress) json["progress"] = ProgressJson(*job.progress);
  json["scheduling"] = {{"priority", ToString(job.scheduling.priority)},
                        {"deadline_seconds", job.scheduling.timeout.count()},
                        {"budget_seconds", job.scheduling.compute_budget.count()},
                        {"fresh", job.scheduling.fresh}};
  json["attempts"] = job.attempts;
  json["stop_requested"] = job.stop_requested;
  json["cancel_requested"] = job.cancel_requested;
  json["memory_bytes"] = job.memory_bytes;
  if (!job.result_of.empty()) json["result_of"] = job.result_of;
  if (job.expire_time) json["expire_time"] = TimeText(*job.expire_time);
  if (job.error) json["error"] = ErrorJson(*job.error);
  if (job.report) AddReport(*job.report, json);
  return json;
}

Json ToJson(const Event& event) {
  Json json = {{"sequence", event.sequence}, {"time", TimeText(event.time)}, {"skipped", event.skipped}};
  if (event.job) json["job"] = ToJson(*event.job);
  if (event.progress) json["progress"] = ProgressJson(*event.progress);
  return json;
}

Json ToJson(const JobEstimate& estimate) {
  Json json = {{"triangles", estimate.triangles},
               {"vertices", estimate.vertices},
               {"memory_bytes", estimate.memory_bytes},
               {"run_seconds", estimate.run_time.count()},
               {"queue_seconds", estimate.queue_time.count()},
               {"accepted", !estimate.refusal.has_value()}};
  if (estimate.refusal) json["refusal"] = ErrorJson(*estimate.refusal);
  return json;
}

Json ToJson(const Capabilities& capabilities) {
  Json solvers = Json::array();
  for (const SolverOptions& combination : capabilities.solvers) {
    solvers.push_back({{"solver", ToString(combination.method)},
                       {"system", ToString(combination.system)},
                       {"preconditioner", ToString(combination.preconditioner)}});
  }
  Json seams = Json::array();
  for (const Seams policy : capabilities.seams) seams.push_back(ToString(policy));
  return {{"version", capabilities.version},
          {"max_mesh_bytes", capabilities.max_mesh_bytes},
          {"workers", capabilities.workers},
          {"threads", capabilities.threads},
          {"max_triangles", capabilities.max_triangles},
          {"memory_bytes", capabilities.memory_bytes},
          {"inline_mesh_bytes", capabilities.inline_mesh_bytes},
          {"upload_chunk_bytes", capabilities.upload_chunk_bytes},
          {"reattach_grace_seconds", capabilities.reattach_grace.count()},
          {"durable", capabilities.durable},
          {"isolated_workers", capabilities.isolated_workers},
          {"queue_capacity", capabilities.queue_capacity},
          {"seams", seams},
          {"solvers", solvers}};
}

Json ReportJson(const UnwrapResult& result, const Report& report, const std::string& output,
                const std::vector<std::string>& atlas_names) {
  Json json = {{"job", result.job}, {"state", ToString(JobState::kSucceeded)}};
  AddReport(report, json, atlas_names);
  json["trace_id"] = result.trace_id;
  json["precision"] = ToString(result.uv.precision());
  if (!output.empty()) json["output"] = output;
  return json;
}

Failure FailureOf(const Error& error) {
  Failure failure;
  failure.job = error.job();
  failure.trace_id = error.trace_id();
  failure.state = error.code() == ErrorCode::kCancelled ? JobState::kCancelled : JobState::kFailed;
  failure.code = ToString(error.code());
  failure.reason = error.reason();
  failure.message = error.what();
  failure.metadata = error.metadata();
  return failure;
}

Json ReportJson(const Failure& failure) {
  Json json = {{"job", failure.job},
               {"state", ToString(failure.state)},
               {"error",
                {{"code", failure.code},
                 {"reason", failure.reason},
                 {"message", failure.message},
                 {"metadata", failure.metadata}}},
               {"input", {{"triangles", failure.triangles}, {"vertices", failure.vertices}}},
               {"charts", Json::array()},
               {"seconds", {{"total", failure.total_seconds}}},
               {"warnings", Json::array()}};
  if (!failure.trace_id.empty()) json["trace_id"] = failure.trace_id;
  return json;
}

namespace {

constexpr std::size_t kMaxNamedCharts = 3;
constexpr std::size_t kMaxWarningsOfAKind = 3;
constexpr std::size_t kMaxListedCharts = 20;

std::string Join(const std::vector<std::string>& parts, const std::string& last_separator) {
  std::string text;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (i > 0) text += i + 1 == parts.size() ? last_separator : ", ";
    text += parts[i];
  }
  return text;
}

std::string Validity(const Quality& quality) {
  std::vector<std::string> bad;
  if (quality.flipped > 0) bad.push_back(Counted(quality.flipped, "flipped triangle", "flipped triangles"));
  if (quality.degenerate > 0) bad.push_back(Counted(quality.degenerate, "degenerate triangle", "degenerate triangles"));
  if (quality.overlapping > 0) bad.push_back(Counted(quality.overlapping, "overlapping pair", "overlapping pairs"));
  return bad.empty() ? "No flipped, degenerate or overlapping triangles" : Join(bad, " and ");
}

// "3 of 120 charts (12, 40 and 77) did not converge"; names the largest few of them.
std::string UnconvergedText(const Report& report) {
  std::vector<const ChartReport*> charts;
  for (const ChartReport& chart : report.charts) {
    if (!chart.converged) charts.push_back(&chart);
  }
  std::stable_sort(charts.begin(), charts.end(),
                   [](const ChartReport* a, const ChartReport* b) { return a->triangles > b->triangles; });
  std::vector<std::string> names;
  for (const ChartReport* chart : charts) {
    if (names.size() < kMaxNamedCharts) names.push_back(std::to_string(chart->chart));
  }
  const auto unnamed = report.chart_totals.not_converged - static_cast<std::int64_t>(names.size());
  if (unnamed > 0) names.push_back(WithCommas(unnamed) + " more");
  return WithCommas(report.chart_totals.not_converged) + " of " +
         Counted(report.chart_totals.charts, "chart", "charts") + " (" + Join(names, " and ") + ") did not converge";
}

// "uzawa+amg"
std::string SolverName(const ChartReport& chart) {
  std::string name = ToString(chart.solver);
  if (chart.preconditioner != Preconditioner::kNone && chart.solver != Solver::kDirect) {
    name += std::string("+") + ToString(chart.preconditioner);
  }
  return name;
}

// The solvers that were used, the one with the most triangles first: " (uzawa+amg, uzawa+cholesky)".
std::string SolversText(const std::vector<ChartReport>& charts) {
  std::map<std::string, std::int64_t> triangles;
  for (const ChartReport& chart : charts) triangles[SolverName(chart)] += chart.triangles;
  std::vector<std::pair<std::string, std::int64_t>> ranked(triangles.begin(), triangles.end());
  std::stable_sort(ranked.begin(), ranked.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
  std::vector<std::string> names;
  for (const auto& [name, count] : ranked) names.push_back(name);
  return names.empty() ? "" : " (" + Join(names, ", ") + ")";
}

// The state of the outlines with BOUNDARY_CONVEX, in one line for all charts.
std::string OutlinesText(const std::vector<ChartReport>& charts) {
  std::int64_t settled = 0, active = 0, vertices = 0;
  for (const ChartReport& chart : charts) {
    if (chart.boundary.boundary != Boundary::kConvex || !chart.boundary.settled) continue;
    ++settled;
    active += chart.boundary.active;
    vertices += chart.boundary.vertices;
  }
  if (settled == 0) return "";
  return (charts.size() == 1 ? "The outline is convex"
                             : "The outlines of " + Counted(settled, "chart", "charts") + " are convex") +
         std::string(": straight at ") + WithCommas(active) + (charts.size() == 1 ? " of its " : " of their ") +
         Counted(vertices, "vertex", "vertices") + ".\n";
}

std::string AtlasText(const Report& report) {
  const Atlas& atlas = report.atlas;
  const bool has_neighbours = report.chart_totals.charts > 1;
  if (!atlas.pack && !has_neighbours) return "";
  if (!atlas.pack) return "Not packed: the charts lie on top of each other, at the surface's scale.\n";
  const std::string size = WithCommas(atlas.texture_size);
  const bool is_stacked = !atlas.atlases.empty() && atlas.layout == AtlasLayout::kStacked;
  const std::string into = is_stacked ? Counted(static_cast<std::int64_t>(atlas.atlases.size()), "atlas", "atlases") +
                                            " of their own, tiles of "
                                      : Counted(atlas.tiles, "tile", "tiles") + " of ";
  const double kept = atlas.padding_kept;
  const std::string less = kept < atlas.padding ? " of the " + WithCommas(atlas.padding) + " asked for" : "";
  const std::string gap = Significant(kept, 3) + (kept == 1 ? " texel" : " texels") + less + " between charts, ";
  return "Packed into " + into + size + " x " + size + " texels: " + Fixed(100 * report.quality.packing_efficiency, 0) +
         " % of them used, " + (has_neighbours ? gap : "") + (is_stacked ? "at least " : "") +
         Significant(atlas.texels_per_unit, 3) + " texels per unit of length.\n";
}

constexpr std::size_t kMaxListedAtlases = 20;

// "Atlas skin: tile 1002, 12 charts, 61 % used, 480 texels per unit of length."
std::string AtlasesText(const Atlas& atlas, const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < std::min(atlas.atlases.size(), kMaxListedAtlases); ++i) {
    const AtlasPart& part = atlas.atlases[i];
    const std::string name = NameOf(part, names);
    const int first = kFirstUdim + part.first_tile, last = first + part.tiles - 1;
    text += "Atlas " + (name.empty() ? std::to_string(part.atlas) : Printable(name, true)) + ": tile" +
            (last > first ? "s " + std::to_string(first) + " to " : " ") + std::to_string(last) + ", " +
            Counted(part.charts, "chart", "charts") + ", " + Fixed(100 * part.packing_efficiency, 0) + " % used, " +
            Significant(part.texels_per_unit, 3) + " texels per unit of length.\n";
  }
  const auto left_out = static_cast<std::int64_t>(atlas.atlases.size()) - static_cast<std::int64_t>(kMaxListedAtlases);
  if (left_out > 0) text += "(" + Counted(left_out, "more atlas", "more atlases") + "; --json has them all)\n";
  return text;
}

std::string MostStretchedText(const Report& report) {
  if (report.chart_totals.charts <= 1 || report.charts.empty()) return "";
  const auto most =
      std::max_element(report.charts.begin(), report.charts.end(),
                       [](const ChartReport& a, const ChartReport& b) { return a.stretch_l2 < b.stretch_l2; });
  return ", " + Fixed(most->stretch_l2, 2) + " in the worst chart (" + std::to_string(most->chart) + ", " +
         Counted(most->triangles, "triangle", "triangles") + ")";
}

// A table of the largest charts.
std::string ChartsText(const Report& report) {
  std::vector<const ChartReport*> charts;
  for (const ChartReport& chart : report.charts) charts.push_back(&chart);
  std::stable_sort(charts.begin(), charts.end(),
                   [](const ChartReport* a, const ChartReport* b) { return a->triangles > b->triangles; });
  if (charts.size() > kMaxListedCharts) charts.resize(kMaxListedCharts);
  std::string text = "CHART  TRIANGLES  SOLVER             NEWTON  LINEAR  RESIDUAL  STRETCH\n";
  for (const ChartReport* chart : charts) {
    text += Padded(std::to_string(chart->chart), 5, true) + "  " + Padded(WithCommas(chart->triangles), 9, true) +
            "  " + Padded(SolverName(*chart), 17) + "  " + Padded(std::to_string(chart->newton_iterations), 6, true) +
            "  " + Padded(WithCommas(chart->linear_iterations), 6, true) + "  " +
            Padded(Scientific(chart->residual.Worst()), 8, true) + "  " + Padded(Fixed(chart->stretch_l2, 3), 7, true) +
            "\n";
  }
  const auto left_out = report.chart_totals.charts - static_cast<std::int64_t>(charts.size());
  if (left_out > 0) text += "(" + Counted(left_out, "smaller chart is", "smaller charts are") + " left out here)\n";
  return text;
}

// "Solved in 40 Newton iterations, worst residual 3.0e-12 (uzawa+amg)."
std::string SolveText(const Report& report) {
  const ChartTotals& totals = report.chart_totals;
  return "Solved in " + Counted(totals.newton_iterations, "Newton iteration", "Newton iterations") +
         ", worst residual " + Scientific(totals.residual.Worst()) + SolversText(report.charts) + ".\n";
}

std::string StretchText(const Report& report) {
  const Quality& quality = report.quality;
  return "Stretch " + Fixed(quality.stretch_l2, 2) + MostStretchedText(report) + "; angles off by " +
         Fixed(quality.angle_error_mean_deg, 2) + " degrees on average, " + Fixed(quality.angle_error_max_deg, 1) +
         " at most.\n" +
         (quality.seam_length > 0
              ? "Seams are " + Fixed(quality.seam_length, 1) + " times as long as the root of the surface's area, " +
                    Fixed(quality.visible_seam_length, 1) + " of that in view; they turn by " +
                    Fixed(quality.seam_turn_deg, 0) + " degrees from edge to edge" +
                    (quality.seam_symmetry
                         ? "; " + Fixed(100 * *quality.seam_symmetry, 0) + " % have their mirror image"
                         : "") +
                    ".\n"
              : "");
}

// The lines that --verbose adds.
std::string Details(const Report& report) {
  const StageTimes& times = report.times;
  std::string text = "Seconds:";
  const auto add = [&](const char* stage, Seconds value) {
    text += (text.back() == ':' ? " " : ", ") + std::string(stage) + " " + Fixed(value.count(), 3);
  };
  add("upload", times.upload);
  add("queue", times.queue);
  add("decode", times.decode);
  add("charts", times.charts);
  add("solve", times.solve);
  add("layout", times.layout);
  add("pack", times.pack);
  add("verify", times.verify);
  add("encode", times.encode);
  add("download", times.download);
  return SolveText(report) + text + ".\nMemory of the worker: " + Megabytes(report.peak_memory_bytes) +
         " at most, with " + Counted(report.threads, "thread", "threads") + ".\n" + ChartsText(report);
}

// A line for each warning. Unless `all`, only the first few warnings with the same reason get a line of their own.
std::string WarningsText(const std::vector<Warning>& warnings, const std::vector<std::string>& places, bool all,
                         const Terminal& terminal) {
  std::map<std::string, std::size_t> count;
  std::string text;
  const std::string mark = Colored(terminal, "\x1b[33m", "warning:") + " ";
  for (std::size_t i = 0; i < warnings.size(); ++i) {
    const Warning& warning = warnings[i];
    if (++count[warning.reason] > kMaxWarningsOfAKind && !all) continue;
    const std::string place = i < places.size() && !places[i].empty() ? "; at " + places[i] : std::string();
    text += mark + Printable(warning.message + place + " [" + warning.reason + "]", true) + "\n";
  }
  for (const auto& [reason, number] : count) {
    if (number <= kMaxWarningsOfAKind || all) continue;
    text += mark + WithCommas(static_cast<std::int64_t>(number - kMaxWarningsOfAKind)) + " more of [" + reason +
            "]; --json has them all\n";
  }
  return text;
}

std::string Hint(const Error& error) {
  if (error.reason() == "SERVER_UNREACHABLE") {
    return "check the address, start a server (planishd --listen=ADDR), or leave out --server to use a private one";
  }
  if (error.reason() == "TLS_FAILED") {
    return "--tls, --tls-ca=PEM, --tls-cert=PEM with --tls-key=PEM and --tls-server-name=NAME say how to connect";
  }
  if (error.code() == ErrorCode::kUnauthenticated) {
    return "say who you are with --token-file=FILE or PLANISH_TOKEN, or with --tls-cert=PEM and --tls-key=PEM";
  }
  if (error.reason() == "PRIVATE_SERVER_FAILED") {
    return "install planishd beside planish, set PLANISHD=/path/to/planishd, or use a running one: --server=ADDR";
  }
  if (error.reason() == "QUEUE_FULL") return "try again later, or another server";
  if (error.reason() == "DEADLINE_EXCEEDED") return "allow more with --timeout=SECONDS";
  return "";
}

}  // namespace

std::string WhyNotUsable(const Report& report) {
  std::vector<std::string> reasons;
  const ChartTotals& totals = report.chart_totals;
  if (totals.not_converged > 0) {
    reasons.push_back(totals.charts == 1 ? "the solve did not converge" : UnconvergedText(report));
  }
  const Quality& quality = report.quality;
  if (quality.flipped > 0) {
    reasons.push_back(Counted(quality.flipped, "triangle is flipped", "triangles are flipped"));
  }
  if (quality.degenerate > 0) {
    reasons.push_back(Counted(quality.degenerate, "triangle has no area", "triangles have no area"));
  }
  return Join(reasons, " and ");
}

std::string Summary(const Report& report, const SummaryOptions& options, const Terminal& terminal) {
  const ChartTotals& totals = report.chart_totals;
  const std::string& output = options.output;
  const std::string start =
      options.start_seconds > 0 ? " (" + Duration(options.start_seconds) + " to start the private server)" : "";
  std::string text = Colored(terminal, "\x1b[1m", "Flattened " + Counted(report.triangles, "triangle", "triangles")) +
                     " in " + Duration(report.times.total.count()) + start +
                     (output.empty() || output == "-" ? "" : " into " + Printable(output, true)) + ": " +
                     Counted(totals.charts, "chart", "charts") + ".\n";
  text += AtlasText(report);
  text += AtlasesText(report.atlas, options.atlas_names);
  text += StretchText(report);
  text += OutlinesText(report.charts);
  text += Validity(report.quality) + ".\n";
  if (options.verbose) text += Details(report);
  text += WarningsText(report.warnings, options.places, options.verbose, terminal);
  if (const std::string why = WhyNotUsable(report); !why.empty()) {
    text += Colored(terminal, "\x1b[31m", "planish: not usable:") + " " + why +
            (output.empty() ? "" : "; it was written all the same, for you to look at") + "\n";
  }
  return ForTerminal(text, terminal);
}

std::string ErrorText(const Error& error, const std::string& places, const Terminal& terminal) {
  std::string text = Colored(terminal, "\x1b[31m", "planish: error:") + " " + PrintableLines(error.what(), true);
  if (error.reason() != ToString(error.code())) text += " [" + Printable(error.reason(), true) + "]";
  text += "\n";
  if (!places.empty()) text += "  at " + Printable(places, true) + "\n";
  if (!error.job().empty()) text += "  job " + Printable(error.job(), true) + "\n";
  if (const std::string hint = Hint(error); !hint.empty()) text += "  hint: " + hint + "\n";
  return ForTerminal(text, terminal);
}

}  // namespace planish::cli
