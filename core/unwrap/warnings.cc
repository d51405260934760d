#include <algorithm>
#include <functional>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/mesh/diagnosis.h"
#include "core/unwrap/holes.h"
#include "core/unwrap/steps.h"

namespace planish {
namespace {

// The numbers of the charts that fulfil `predicate`.
std::vector<int> ChartsWith(const std::vector<ChartReport>& charts,
                            const std::function<bool(const ChartReport&)>& predicate) {
  std::vector<int> found;
  for (std::size_t i = 0; i < charts.size(); ++i) {
    if (predicate(charts[i])) found.push_back(static_cast<int>(i));
  }
  return found;
}

// " (chart 3)" or " (charts 3, 7 and 5 more)"; empty for a mesh with one chart.
std::string Where(const std::vector<ChartReport>& charts, const std::vector<int>& found) {
  if (charts.size() == 1) return "";
  constexpr std::size_t kMaxInMessage = 4;
  const std::vector<int> first(found.begin(), found.begin() + std::min(found.size(), kMaxInMessage));
  return absl::StrCat(found.size() == 1 ? " (chart " : " (charts ", absl::StrJoin(first, ", "),
                      found.size() > kMaxInMessage ? absl::StrCat(" and ", found.size() - kMaxInMessage, " more") : "",
                      ")");
}

std::map<std::string, std::string> ChartMetadata(const std::vector<int>& found) {
  const auto first = std::span(found).first(std::min(found.size(), kMaxNamed));
  return {{"charts", absl::StrJoin(first, ",")}, {"chart_count", absl::StrCat(found.size())}};
}

// Adds a warning about `count` faces, edges or pairs, unless it is 0.
void WarnOf(std::int64_t count, const std::string& reason, const std::string& message,
            const std::vector<std::int32_t>& faces, std::vector<UnwrapWarning>* warnings) {
  if (count > 0) warnings->push_back({reason, message, {{"count", absl::StrCat(count)}}, faces});
}

}  // namespace

std::string FirstFaces(const std::vector<std::int32_t>& faces) {
  return absl::StrJoin(std::span(faces).first(std::min(faces.size(), kMaxNamed)), ",");
}

void WarnOfSurface(const Surface& surface, const Polygons& polygons, const std::vector<char>& ignored,
                   std::vector<UnwrapWarning>* warnings) {
  std::vector<std::int32_t> faces;
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(ignored.size()); ++f) {
    if (ignored[f]) faces.push_back(f);
  }
  // If three corners of a polygon are collinear, one of its triangles may have no area although the polygon has.
  std::int64_t flat_polygons = 0, flat_triangles = std::ssize(faces);
  for (std::int32_t i = 0; i < polygons.count() && !faces.empty(); ++i) {
    std::int64_t flat = 0, all = 0;
    polygons.ForEachFace(i, [&](std::int32_t f) {
      ++all;
      flat += ignored[f] != 0;
    });
    if (flat < all) continue;
    ++flat_polygons;
    flat_triangles -= all;
  }
  std::vector<std::string> flat;
  if (flat_polygons > 0) flat.push_back(Counted(flat_polygons, "face has no area", "faces have no area"));
  if (flat_triangles > 0) {
    flat.push_back(Counted(flat_triangles, "triangle inside of a polygon has no area",
                           "triangles inside of polygons have no area"));
  }
  WarnOf(std::ssize(faces), "FACES_WITHOUT_AREA",
         absl::StrCat(absl::StrJoin(flat, ", "), "; they get UV, but no promise holds for them"), faces, warnings);
  const std::int64_t edges = surface.non_manifold_edges;
  WarnOf(edges, "EDGES_NON_MANIFOLD",
         absl::StrCat("more than two faces meet at ", Counted(edges, "edge", "edges"),
                      "; pairs of them stay joined, the flattest first"),
         {}, warnings);
  WarnOf(
      surface.clashing_edges, "ORIENTATION_INCONSISTENT",
      absl::StrCat(
          "the two faces at ", Counted(surface.clashing_edges, "edge", "edges"),
          " have opposite orientations; charts end there. Turn all faces the same way round for fewer charts (Blender: "
          "Mesh, Normals, Recalculate Outside)"),
      {}, warnings);
}

void WarnOfTornPolygons(const std::vector<std::int32_t>& first_faces, std::vector<UnwrapWarning>* warnings) {
  const std::int64_t count = std::ssize(first_faces);
  WarnOf(
      count, "POLYGON_TORN",
      absl::StrCat(Counted(count, "polygon", "polygons"),
                   " could not stay in one piece: the triangles unfold onto each other, or make no disc; some corners "
                   "have different UV in different triangles"),
      first_faces, warnings);
}

void WarnOfWidened(const std::vector<std::int32_t>& widened, const Polygons& polygons, Precision precision,
                   std::vector<UnwrapWarning>* warnings) {
  WarnOf(std::ssize(widened), "FACES_WIDENED",
         absl::StrCat(Counted(polygons.CountIn(widened), "face is thinner", "faces are thinner"), " than ",
                      precision == Precision::kFloat ? "float" : "double",
                      " can hold; the map stretches them across, so that they are neither flipped nor collapsed"),
         widened, warnings);
}

AddedSeams FindAddedSeams(const Mesh& mesh, const Charts& charts, std::int32_t first_count) {
  AddedSeams added;
  added.split = charts.count() - first_count;
  added.given_up = charts.given_up;
  for (const MappedChart& mapped : charts.charts) {
    if (!mapped.is_slit()) continue;
    const Chart& chart = mapped.chart;
    ++(HoledPieceOf(mesh, chart) ? added.with_holes : added.others);
    std::vector<char> is_closed(chart.slits.size(), 0);
    for (const std::int32_t i : mapped.map.closed_slits) is_closed[i] = 1;
    for (std::size_t i = 0; i < chart.slits.size(); ++i) {
      if (is_closed[i]) continue;
      ++added.slit_edges;
      added.faces.push_back(chart.faces[chart.slits[i].first / 3]);
    }
  }
  return added;
}

void WarnOfAddedSeams(const AddedSeams& added, SeamPolicy policy, std::vector<UnwrapWarning>* warnings) {
  const std::int64_t slit = added.with_holes + added.others;
  if (slit == 0 && added.split == 0) return;
  std::vector<std::string> parts;
  if (added.with_holes > 0) {
    parts.push_back(absl::StrFormat(
        "%s slit open from hole to outline, since without a slit the map would overlap itself or be stretched %s",
        Counted(added.with_holes, "chart with holes was", "charts with holes were"),
        policy == SeamPolicy::kKeep ? absl::StrFormat("beyond %g", kMuchStretch) : "much more"));
  }
  if (added.others > 0) {
    parts.push_back(absl::StrCat(
        Counted(added.others, "chart that is closed or has handles was", "charts that are closed or have handles were"),
        " slit open to lie flat"));
  }
  if (added.split > 0) {
    parts.push_back(absl::StrCat(Counted(added.split, "chart was", "charts were"),
                                 " split off, as the map would have overlapped itself or been stretched beyond use"));
  }
  if (added.given_up > 0) {
    parts.push_back(absl::StrCat(Counted(added.given_up, "solve was", "solves were"),
                                 " given up before, since it took too much work"));
  }
  const std::string where =
      slit == 0 ? "" : absl::StrCat(". The slits have ", Counted(added.slit_edges, "edge", "edges"));
  warnings->push_back({"SEAMS_ADDED",
                       absl::StrCat("seams beside the given ones: ", absl::StrJoin(parts, "; "), where),
                       {{"slit", absl::StrCat(slit)},
                        {"slit_edges", absl::StrCat(added.slit_edges)},
                        {"split", absl::StrCat(added.split)},
                        {"given_up", absl::StrCat(added.given_up)}},
                       added.faces});
}

void WarnOfMuchStretch(const std::vector<double>& stretch, const std::vector<std::int32_t>& worst_face,
                       SeamPolicy policy, std::vector<UnwrapWarning>* warnings) {
  std::vector<int> found;
  for (std::size_t i = 0; i < stretch.size(); ++i) {
    if (stretch[i] > kMuchStretch) found.push_back(static_cast<int>(i));
  }
  if (found.empty()) return;
  std::stable_sort(found.begin(), found.end(), [&](int i, int j) { return stretch[i] > stretch[j]; });
  std::vector<std::string> named;
  for (const int i : std::span(found).first(std::min<std::size_t>(found.size(), 4))) {
    named.push_back(absl::StrFormat("chart %d by %.3g", i, stretch[i]));
  }
  std::string where = absl::StrJoin(named, ", ");
  if (found.size() > named.size()) absl::StrAppend(&where, " and ", found.size() - named.size(), " more");
  std::map<std::string, std::string> metadata = ChartMetadata(found);
  metadata["stretch"] = absl::StrFormat("%g", stretch[found.front()]);
  std::vector<std::int32_t> faces;
  for (const int i : found) faces.push_back(worst_face[i]);
  // With kNone the caller cannot give seams.
  const std::string remedy = policy == SeamPolicy::kNone
                                 ? "allow seams (--seams=auto)"
                                 : "allow more seams (--seams=auto and the same sources), or give one there yourself";
  warnings->push_back(
      {"STRETCH_HIGH",
       absl::StrFormat("%s stretched beyond %g (L2; 1 is none), most of all at the faces named: %s; "
                       "the borders leave no better map: %s",
                       Counted(std::ssize(found), "chart is", "charts are"), kMuchStretch, where, remedy),
       std::move(metadata), std::move(faces)});
}

void WarnOfStop(const std::vector<ChartReport>& charts, std::vector<UnwrapWarning>* warnings) {
  const std::size_t cut_short = ChartsWith(charts, [](const ChartReport& c) { return c.flatten->stopped; }).size();
  warnings->push_back(
      {"STOPPED",
       absl::StrCat("stopped on request: ",
                    cut_short == 0 ? "no chart's solve" : absl::StrCat("the solve of ", cut_short, " of "),
                    cut_short == 0 ? "" : Counted(static_cast<std::int64_t>(charts.size()), "chart", "charts"),
                    " was cut short; without the stop the map might have been better"),
       {{"charts_cut_short", absl::StrCat(cut_short)}}});
}

void WarnOfCharts(const std::vector<ChartReport>& charts, double max_stretch, bool stopped,
                  std::vector<UnwrapWarning>* warnings) {
  const auto warn = [&](const std::string& reason, const std::function<bool(const ChartReport&)>& predicate,
                        const std::function<std::string(const ChartReport&)>& message,
                        std::map<std::string, std::string> metadata = {}) {
    const std::vector<int> found = ChartsWith(charts, predicate);
    if (found.empty()) return;
    if (charts.size() > 1) metadata.merge(ChartMetadata(found));
    warnings->push_back({reason, message(charts[found.front()]) + Where(charts, found), std::move(metadata)});
  };
  warn(
      "NOT_CONVERGED", [](const ChartReport& c) { return !c.flatten->converged; },
      [](const ChartReport& c) { return c.flatten->stop_message; }, {});
  warn(
      "PRECONDITIONER_CHANGED", [](const ChartReport& c) { return c.flatten->preconditioner_changed; },
      [](const ChartReport& c) {
        return absl::StrCat("a Cholesky factorization took the place of multigrid, which failed: ",
                            c.flatten->multigrid_failure);
      });
  std::int64_t failures = 0, solves = 0;
  for (const ChartReport& chart : charts) {
    failures += chart.flatten->linear_failures;
    solves += chart.flatten->linear_solves;
  }
  warn(
      "LINEAR_SOLVES_FAILED", [](const ChartReport& c) { return !c.flatten->linear_failure.empty(); },
      [&](const ChartReport& c) {
        return absl::StrCat(failures, " of ", Counted(solves, "linear solve", "linear solves"),
                            " did not reach the tolerance; Newton's method went on with another step. The first: ",
                            c.flatten->linear_failure);
      },
      {{"failures", absl::StrCat(failures)}, {"solves", absl::StrCat(solves)}});
  warn(
      "BOUNDARY_NOT_SETTLED", [](const ChartReport& c) { return !c.flatten->boundary.settled; },
      [](const ChartReport& c) {
        return absl::StrCat("the active set of the boundary control had not settled after ",
                            Counted(c.flatten->boundary.set_changes, "change", "changes"),
                            ": the outline may be slightly concave, or straighter than necessary");
      });
  double barrier = 0;
  for (const ChartReport& chart : charts) barrier = std::max(barrier, chart.flatten->barrier);
  warn(
      "BARRIER_KEPT", [](const ChartReport& c) { return c.flatten->barrier > 0 && !c.flatten->stopped; },
      [](const ChartReport& c) {
        const bool convex = c.flatten->boundary.type == BoundaryType::kConvex;
        if (c.flatten->out_of_work) {
          return absl::StrFormat(
              "a barrier of %g keeps the triangles open; within the work allowed no minimum of the "
              "ABF energy alone was found",
              c.flatten->barrier);
        }
        return absl::StrFormat(
            "the ABF energy alone has no minimum with positive angles on this mesh%s; a "
            "barrier of %g keeps its triangles open; a seam%s would relieve it",
            convex ? " with a convex outline" : "", c.flatten->barrier, convex ? " or a free boundary" : "");
      },
      {{"barrier", absl::StrFormat("%g", barrier)}});
  warn(
      "BARYCENTRIC_MAP", [](const ChartReport& c) { return c.is_barycentric; },
      [](const ChartReport&) {
        return "with these borders ABF gives no map that is free of overlaps and not stretched beyond use; a "
               "barycentric map, relaxed until it is stretched little, keeps the borders, but not the angles; a seam "
               "would "
               "help";
      });
  if (max_stretch <= 0) return;
  double worst = 1;
  for (const ChartReport& chart : charts) worst = std::max(worst, chart.stretch_l2);
  warn(
      "STRETCH_ABOVE_LIMIT", [&](const ChartReport& c) { return c.stretch_l2 > kStretchTolerance * max_stretch; },
      [&](const ChartReport&) {
        return absl::StrFormat("stretch of up to %.3g where %.3g was asked for: %s", worst, max_stretch,
                               stopped ? "stopped before more seams were added" : "more seams would not help");
      },
      {{"stretch", absl::StrFormat("%g", worst)}});
}

void WarnOfFaults(const OrientationFaults& orientation, const Overlaps& overlaps,
                  std::vector<UnwrapWarning>* warnings) {
  WarnOf(orientation.flipped, "UV_FLIPPED",
         absl::StrCat(Counted(orientation.flipped, "UV triangle is", "UV triangles are"), " flipped"),
         orientation.faces, warnings);
  WarnOf(orientation.degenerate, "UV_DEGENERATE",
         absl::StrCat(Counted(orientation.degenerate, "UV triangle has", "UV triangles have"), " no area"),
         orientation.faces, warnings);
  WarnOf(overlaps.pairs, "UV_OVERLAPPING",
         absl::StrCat(overlaps.limited ? "at least " : "", Counted(overlaps.pairs, "pair", "pairs"),
                      " of UV triangles overlap: a chart overlaps itself; a seam would open it"),
         overlaps.faces, warnings);
}

}  // namespace planish
