#include "client/cli/inspection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "client/cli/seams.h"
#include "client/cli/text.h"
#include "client/src/errors.h"
#include "core/mesh/diagnosis.h"

namespace planish::cli {
namespace {

// The triangles and all vertices of the file, with positions rounded to float, as they are sent to a server.
Mesh AsSent(const MeshInput& input) {
  const Triangulation& triangles = input.triangulation();
  Mesh mesh;
  mesh.faces = input.mesh().faces;
  for (Face& face : mesh.faces) {
    for (std::int32_t& v : face) v = triangles.source_vertex[static_cast<std::size_t>(v)];
  }
  mesh.positions.reserve(input.file().mesh.positions.size());
  for (const Vec3& p : input.file().mesh.positions) mesh.positions.push_back(p.cast<float>().cast<double>());
  return mesh;
}

// The file's polygons of these triangles, each once.
std::vector<std::int64_t> Polygons(const MeshInput& input, const std::vector<std::int64_t>& triangles) {
  std::vector<std::int64_t> polygons;
  for (const std::int64_t t : triangles) {
    const std::int64_t polygon = input.triangulation().source_polygon[static_cast<std::size_t>(t)];
    if (std::find(polygons.begin(), polygons.end(), polygon) == polygons.end()) polygons.push_back(polygon);
  }
  return polygons;
}

// Collects findings, in the order in which they are printed.
class Findings {
 public:
  explicit Findings(const MeshInput& input) : input_(input) {}

  void Faces(const std::string& name, const ElementList& list, const std::string& one, const std::string& many) {
    Finding finding = {name, Counted(list.count, "triangle " + one, "triangles " + many), list.count, {}, {}, {}, ""};
    finding.faces = Polygons(input_, list.first);
    finding.places = Places({{"faces", ids::IdList(finding.faces)}}, &input_);
    all_.push_back(std::move(finding));
  }

  void Vertices(const std::string& name, const ElementList& list, const std::string& one, const std::string& many) {
    Finding finding = {name, Counted(list.count, "vertex " + one, "vertices " + many), list.count, {}, {}, {}, ""};
    finding.vertices = list.first;
    finding.places = Places({{"vertices", ids::IdList(finding.vertices)}}, &input_);
    all_.push_back(std::move(finding));
  }

  void Edges(const std::string& name, const EdgeList& list, const std::string& one, const std::string& many) {
    Finding finding = {name, Counted(list.count, "edge " + one, "edges " + many), list.count, {}, {}, {}, ""};
    finding.faces = Polygons(input_, list.faces);
    finding.edges = list.first;
    finding.places = Places({{"faces", ids::IdList(finding.faces)}}, &input_);
    all_.push_back(std::move(finding));
  }

  std::vector<Finding> Take() { return std::move(all_); }

 private:
  const MeshInput& input_;
  std::vector<Finding> all_;
};

std::vector<Finding> FindingsOf(const MeshInput& input, const Diagnosis& d) {
  Findings findings(input);
  findings.Faces("faces_out_of_range", d.faces_out_of_range, "refers to a vertex that does not exist",
                 "refer to vertices that do not exist");
  findings.Vertices("vertices_not_finite", d.vertices_not_finite, "lies at NaN or infinity", "lie at NaN or infinity");
  findings.Faces("faces_repeating_a_vertex", d.faces_repeating_a_vertex, "names a vertex twice", "name a vertex twice");
  findings.Faces("faces_without_area", d.faces_without_area, "has no area", "have no area");
  findings.Faces("duplicate_faces", d.duplicate_faces, "has the same vertices as an earlier one",
                 "have the same vertices as earlier ones");
  findings.Edges("non_manifold_edges", d.non_manifold_edges, "has more than two triangles",
                 "have more than two triangles");
  findings.Edges("inconsistent_edges", d.inconsistent_edges, "lies between triangles wound against each other",
                 "lie between triangles wound against each other");
  findings.Vertices("non_manifold_vertices", d.non_manifold_vertices, "joins parts that share no edge",
                    "join parts that share no edge");
  findings.Vertices("isolated_vertices", d.isolated_vertices, "has no face", "have no face");
  findings.Vertices("coincident_vertices", d.coincident_vertices, "lies exactly where an earlier one does",
                    "lie exactly where earlier ones do");
  findings.Faces("needles", d.needles, "has an angle below one degree", "have an angle below one degree");
  return findings.Take();
}

std::vector<std::string> PlanFor(const Diagnosis& d) {
  std::vector<std::string> plan;
  const auto say = [&](std::int64_t count, const std::string& before, const std::string& one, const std::string& many,
                       const std::string& after) {
    if (count > 0) plan.push_back(before + Counted(count, one, many) + after);
  };
  say(d.isolated_vertices.count, "ignores ", "vertex", "vertices", " without a face");
  say(d.faces_repeating_a_vertex.count + d.faces_without_area.count, "gives UV to ", "triangle", "triangles",
      " without area, about which it promises nothing");
  say(d.duplicate_faces.count, "gives a place in the map of its own to ", "copy of a triangle", "copies of triangles",
      "");
  say(d.non_manifold_edges.count, "cuts along ", "edge", "edges", " of more than two triangles");
  say(d.inconsistent_edges.count, "cuts along ", "edge", "edges", " between triangles wound against each other");
  say(d.non_manifold_vertices.count, "parts the surface at ", "vertex", "vertices", " where parts only touch");
  std::int64_t closed = 0, holes = 0, handles = 0;
  for (const Component& component : d.components) {
    if (component.boundary_loops == 0) ++closed;
    if (component.boundary_loops > 1) ++holes;
    if (component.handles > 0) ++handles;
  }
  say(closed, "adds seams that open ", "closed component", "closed components", "");
  say(holes, "adds seams between the boundary loops of ", "component", "components", "");
  say(handles, "adds seams that cut the handles of ", "component", "components", "");
  if (d.is_disc()) plan.emplace_back("takes it as it is: one disc, one chart");
  plan.emplace_back("adds seams where a chart would stretch by more than --max-stretch or overlap itself");
  return plan;
}

// The error with which unwrap refuses to send a mesh with a position that does not fit a float; nothing if all fit.
std::optional<Error> RefusalToSend(const MeshInput& input) {
  const std::vector<Vec3>& positions = input.file().mesh.positions;
  for (const std::int32_t v : input.triangulation().source_vertex) {
    const Vec3& p = positions[static_cast<std::size_t>(v)];
    if (!p.allFinite() || p.cast<float>().allFinite()) continue;
    return Error(ErrorCode::kInvalidArgument, "MESH_POSITION_INVALID",
                 "the position of a vertex does not fit a float, as which positions travel",
                 {{"vertices", std::to_string(v)}});
  }
  return std::nullopt;
}

// Converts triangles to the file's faces. Vertices have the file's ids already.
ids::Renumbering FacesToFile(const MeshInput& input) {
  ids::Renumbering renumbering;
  renumbering.face = [&input](std::int64_t face) -> std::int64_t {
    const auto& source = input.triangulation().source_polygon;
    return face < static_cast<std::int64_t>(source.size()) ? source[static_cast<std::size_t>(face)] : -1;
  };
  return renumbering;
}

std::string ShapeOf(const Component& component) {
  const std::string loops =
      component.boundary_loops == 0 ? "closed" : Counted(component.boundary_loops, "loop", "loops");
  if (!component.orientable) {
    return "not orientable (" + Counted(component.crosscaps, "crosscap", "crosscaps") + ", " + loops + ")";
  }
  if (component.IsDisc()) return "disc";
  return loops + ", genus " + WithCommas(component.handles);
}

// Sorts components by their number of triangles, the largest first.
std::vector<Component> BySize(std::vector<Component> components) {
  std::stable_sort(components.begin(), components.end(),
                   [](const Component& a, const Component& b) { return a.faces > b.faces; });
  return components;
}

std::string Names(const std::vector<std::string>& names) {
  constexpr std::size_t kMaxNames = 6;
  std::string text = WithCommas(static_cast<std::int64_t>(names.size()));
  for (std::size_t i = 0; i < std::min(names.size(), kMaxNames); ++i) text += (i == 0 ? ": " : ", ") + names[i];
  return names.size() > kMaxNames ? text + ", ..." : text;
}

// `lines`, with `heading` in a margin to the left of the first line.
std::string Paragraph(const std::string& heading, const std::vector<std::string>& lines) {
  constexpr std::size_t kMargin = 11;
  std::string text;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    std::string margin = i == 0 ? heading : "";
    margin.resize(kMargin, ' ');
    text += margin + lines[i] + "\n";
  }
  return text;
}

std::vector<std::string> SurfaceLines(const Diagnosis& d) {
  const auto components = static_cast<std::int64_t>(d.components.size());
  if (components == 0) return {"none: no triangle has area"};
  std::vector<std::string> lines = {
      Counted(components, "component", "components") +
      (components == 1 && d.components[0].IsDisc() ? ", a disc, " : ", ") +
      (d.boundary_loops() == 0 ? "closed"
                               : Counted(d.boundary_loops(), "boundary loop", "boundary loops") + " with " +
                                     Counted(d.boundary_edges, "edge", "edges")) +
      ", genus " + WithCommas(d.handles()) + (d.is_orientable() ? "" : ", not orientable") + ", Euler characteristic " +
      WithCommas(d.euler_characteristic())};
  constexpr std::size_t kMaxComponents = 4;
  if (components < 2) return lines;
  std::vector<Component> largest = BySize(d.components);
  largest.resize(std::min(largest.size(), kMaxComponents));
  std::string text;
  for (const Component& component : largest) {
    text += (text.empty() ? "the largest: " : "; ") + Counted(component.faces, "triangle", "triangles") + ", " +
            ShapeOf(component);
  }
  if (d.components.size() > kMaxComponents) text += "; ...";
  lines.push_back(text);
  return lines;
}

const char* FormatName(MeshFormat format) {
  switch (format) {
    case MeshFormat::kObj:
      return "obj";
    case MeshFormat::kPly:
      return "ply";
    case MeshFormat::kOff:
      return "off";
    case MeshFormat::kStl:
      return "stl";
    case MeshFormat::kGltf:
      return "gltf";
    case MeshFormat::kGlb:
      return "glb";
    case MeshFormat::kDraco:
      return "drc";
  }
  return "unknown";
}

std::vector<std::int64_t> LinesOf(const Finding& finding, const PolygonMesh& mesh) {
  const std::vector<std::int64_t>& ids = finding.faces.empty() ? finding.vertices : finding.faces;
  const std::vector<std::int64_t>& table = finding.faces.empty() ? mesh.vertex_line : mesh.polygon_line;
  std::vector<std::int64_t> lines;
  for (const std::int64_t id : ids) {
    if (id < static_cast<std::int64_t>(table.size())) lines.push_back(table[static_cast<std::size_t>(id)]);
  }
  return lines;
}

Json FindingJson(const Finding& finding, const PolygonMesh& mesh) {
  return {{"count", finding.count},
          {"faces", finding.faces},
          {"vertices", finding.vertices},
          {"edges", finding.edges},
          {"lines", LinesOf(finding, mesh)}};
}

Json ComponentsJson(const MeshInput& input, const Diagnosis& d) {
  constexpr std::size_t kMaxComponents = 100;
  Json components = Json::array();
  for (const Component& c : BySize(d.components)) {
    if (components.size() == kMaxComponents) break;
    components.push_back({{"first_face", Polygons(input, {c.first_face})[0]},
                          {"triangles", c.faces},
                          {"boundary_loops", c.boundary_loops},
                          {"boundary_edges", c.boundary_edges},
                          {"euler_characteristic", c.euler_characteristic},
                          {"orientable", c.orientable},
                          {"genus", c.handles},
                          {"crosscaps", c.crosscaps},
                          {"disc", c.IsDisc()}});
  }
  return components;
}

Json PointJson(const Vec3& p) {
  return {p.x(), p.y(), p.z()};
}

}  // namespace

Inspection Inspect(const MeshInput& input) {
  const Mesh mesh = AsSent(input);
  absl::StatusOr<Diagnosis> diagnosis = Diagnose(mesh);
  if (!diagnosis.ok()) throw ErrorFrom(diagnosis.status());

  Inspection inspection;
  inspection.diagnosis = *std::move(diagnosis);
  const PolygonMesh& polygons = input.file().mesh;
  inspection.polygons = polygons.num_polygons();
  inspection.materials = polygons.material_names;
  inspection.groups = polygons.group_names;
  const PolygonEdges edges(input.file(), input.triangulation());
  inspection.uv_islands = edges.CountUvIslands();
  inspection.uv_seams = static_cast<std::int64_t>(edges.UvBorders().size());
  inspection.findings = FindingsOf(input, inspection.diagnosis);

  const ids::Renumbering to_file = FacesToFile(input);
  inspection.refusal = RefusalToSend(input);
  if (const absl::Status status = inspection.diagnosis.Refusal(); !inspection.refusal && !status.ok()) {
    inspection.refusal = Renumbered(ErrorFrom(status), to_file);
  }
  if (!inspection.refusal) inspection.plan = PlanFor(inspection.diagnosis);
  if (const absl::Status status = CheckDisc(mesh); !status.ok()) {
    inspection.not_a_disc = Renumbered(ErrorFrom(status), to_file);
  }
  return inspection;
}

std::string InspectionText(const MeshInput& input, const Inspection& inspection) {
  const Diagnosis& d = inspection.diagnosis;
  std::string text =
      input.path() + ": " + Counted(d.vertices, "vertex", "vertices") + ", " +
      Counted(d.faces, "triangle", "triangles") +
      (inspection.polygons == d.faces ? "" : " in " + Counted(inspection.polygons, "polygon", "polygons")) + "\n\n";
  text += Paragraph("Surface", SurfaceLines(d));
  if (d.area > 0) {
    const Vec3 size = d.box_max - d.box_min;
    text += Paragraph("Size", {Significant(size.x(), 3) + " x " + Significant(size.y(), 3) + " x " +
                               Significant(size.z(), 3) + ", area " + Significant(d.area, 3)});
    text += Paragraph(
        "Angles", {Significant(d.angle_min_degrees, 4) + " to " + Significant(d.angle_max_degrees, 4) + " degrees"});
  }
  if (inspection.uv_islands > 0) {
    text += Paragraph("UV", {Counted(inspection.uv_islands, "island", "islands") + ", " +
                             Counted(inspection.uv_seams, "seam edge", "seam edges")});
  }
  if (!inspection.materials.empty()) text += Paragraph("Materials", {Names(inspection.materials)});
  if (!inspection.groups.empty()) text += Paragraph("Groups", {Names(inspection.groups)});

  std::vector<std::string> findings;
  for (const Finding& finding : inspection.findings) {
    if (finding.count == 0) continue;
    findings.push_back(finding.text);
    findings.push_back("  " + finding.places);
  }
  if (findings.empty()) findings.emplace_back("none");
  text += "\n" + Paragraph("Findings", findings) + "\n";
  if (inspection.refusal) {
    text += Paragraph("Unwrap", {"refuses it: " + ErrorLine(*inspection.refusal, &input)});
  } else {
    text += Paragraph("Unwrap", inspection.plan);
  }
  return text;
}

Json InspectionJson(const MeshInput& input, const Inspection& inspection) {
  const Diagnosis& d = inspection.diagnosis;
  Json findings = Json::object();
  for (const Finding& finding : inspection.findings) {
    findings[finding.name] = FindingJson(finding, input.file().mesh);
  }
  Json unwrap = {{"accepted", !inspection.refusal.has_value()}};
  if (inspection.refusal) {
    unwrap["error"] = {{"reason", inspection.refusal->reason()},
                       {"message", inspection.refusal->what()},
                       {"metadata", inspection.refusal->metadata()}};
  }
  unwrap["plan"] = inspection.plan;
  const std::optional<Error>& not_a_disc = inspection.not_a_disc;
  unwrap["seams_none"] = {{"accepted", !not_a_disc.has_value()},
                          {"reason", not_a_disc ? not_a_disc->reason() : ""},
                          {"message", not_a_disc ? not_a_disc->what() : ""},
                          {"metadata", not_a_disc ? not_a_disc->metadata() : Error::Metadata()}};
  return {{"file", input.path()},
          {"format", FormatName(input.file().format)},
          {"vertices", d.vertices},
          {"polygons", inspection.polygons},
          {"triangles", d.faces},
          {"surface",
           {{"triangles", d.surface_faces},
            {"edges", d.edges},
            {"boundary_edges", d.boundary_edges},
            {"boundary_loops", d.boundary_loops()},
            {"components", d.components.size()},
            {"oriented_pieces", d.oriented_pieces},
            {"orientable", d.is_orientable()},
            {"euler_characteristic", d.euler_characteristic()},
            {"genus", d.handles()},
            {"disc", d.is_disc()}}},
          {"components", ComponentsJson(input, d)},
          {"geometry",
           {{"area", d.area},
            {"angle_min_deg", d.angle_min_degrees},
            {"angle_max_deg", d.angle_max_degrees},
            {"box_min", PointJson(d.box_min)},
            {"box_max", PointJson(d.box_max)}}},
          {"uv", {{"islands", inspection.uv_islands}, {"seam_edges", inspection.uv_seams}}},
          {"materials", inspection.materials},
          {"groups", inspection.groups},
          {"findings", findings},
          {"unwrap", unwrap}};
}

}  // namespace planish::cli
