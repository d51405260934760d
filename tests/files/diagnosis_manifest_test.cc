// Every OBJ of the shared collection, diagnosed, against the counts in its MANIFEST.tsv.
#include <cstdio>
#include <filesystem>
#include <map>

#include "client/files/mesh_file.h"
#include "core/mesh/diagnosis.h"
#include "gtest/gtest.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

namespace fs = std::filesystem;

std::vector<TableRow> ObjRows(const fs::path& manifest) {
  std::vector<TableRow> rows = ReadTable(manifest);
  std::erase_if(rows, [](const TableRow& row) { return fs::path(row.at("file")).extension() != ".obj"; });
  return rows;
}

// The manifest's mesh: polygons as fans, on all vertices of the file, those without a face too.
Mesh Fans(const PolygonMesh& polygons) {
  Mesh mesh;
  mesh.positions = polygons.positions;
  for (std::int64_t p = 0; p < polygons.num_polygons(); ++p) {
    const std::int64_t first = polygons.polygon_begin[p];
    for (std::int64_t c = first + 1; c + 1 < polygons.polygon_begin[p + 1]; ++c) {
      mesh.faces.push_back({polygons.corner_vertex[first], polygons.corner_vertex[c], polygons.corner_vertex[c + 1]});
    }
  }
  return mesh;
}

// As the manifest writes it: half the crosscaps where there are any.
std::string Genus(const Diagnosis& diagnosis) {
  double genus = 0;
  for (const Component& c : diagnosis.components) {
    genus += static_cast<double>(c.handles) + 0.5 * static_cast<double>(c.crosscaps);
  }
  char text[32];
  std::snprintf(text, sizeof text, "%g%s", genus, diagnosis.is_orientable() ? "" : "*");
  return text;
}

std::string FourDigits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

// The manifest counts faces without area as part of the surface; a diagnosis sets them aside. These are the manifest's
// own columns for files that have such faces, computed by meshstat, the tool that wrote it, without these faces.
struct Surface {
  long edges, components, loops, boundary_edges, non_manifold_edges, non_manifold_vertices, inconsistent_edges;
  std::string genus;
};
const std::map<std::string, Surface>& WithoutDegenerateFaces() {
  static const auto* surfaces = new std::map<std::string, Surface>{
      {"capsule_degenerate_10200.obj", {15249, 1, 1, 498, 0, 0, 0, "0"}},
      {"deg_faces.obj", {7, 1, 1, 5, 0, 0, 0, "0"}},
      {"degenerate_edge.obj", {3, 1, 1, 3, 0, 0, 0, "0"}},
      {"degenerate_mesh.obj", {0, 0, 0, 0, 0, 0, 0, "0"}},
      {"spider_1368.obj", {2032, 19, 12, 128, 0, 0, 10, "0"}},
      {"zero_area_face.obj", {0, 0, 0, 0, 0, 0, 0, "0"}},
      {"zero_length_edge.obj", {3, 1, 1, 3, 0, 0, 0, "0"}},
  };
  return *surfaces;
}

TEST(DiagnosisManifest, EveryObj) {
  const fs::path meshes = PLANISH_SHARED_MESHES;
  if (!fs::exists(meshes / "MANIFEST.tsv")) GTEST_SKIP() << "no shared meshes at " << meshes;
  int compared = 0;
  for (const TableRow& row : ObjRows(meshes / "MANIFEST.tsv")) {
    const std::string& name = row.at("file");
    SCOPED_TRACE(name);
    const auto file = ReadMeshFile((meshes / name).string());
    if (name == "malformed.obj" || name == "box_utf16be.obj") {
      EXPECT_FALSE(file.ok()) << "the reader refuses it";
      continue;
    }
    ASSERT_TRUE(file.ok()) << file.status();
    const auto d = Diagnose(Fans(file->mesh));
    ASSERT_TRUE(d.ok()) << d.status();
    ++compared;
    const auto number = [&](const char* column) { return std::stol(row.at(column)); };
    EXPECT_EQ(d->vertices, number("V"));
    EXPECT_EQ(d->faces, number("F"));
    EXPECT_EQ(d->faces_repeating_a_vertex.count + d->faces_without_area.count, number("degen"));
    EXPECT_EQ(d->coincident_vertices.count, number("dup_verts"));
    EXPECT_EQ(d->duplicate_faces.count, number("dup_faces"));
    EXPECT_EQ(d->isolated_vertices.count, number("unref"));
    EXPECT_EQ(d->vertices_not_finite.count, number("nan")) << "none of them is without a face";
    EXPECT_EQ(d->faces_out_of_range.count, number("bad_idx"));

    Surface expected = {number("E"),        number("comps"),    number("loops"),        number("bnd_edges"),
                        number("nm_edges"), number("nm_verts"), number("incons_edges"), row.at("genus")};
    if (number("degen") > 0) {
      ASSERT_TRUE(WithoutDegenerateFaces().contains(name));
      expected = WithoutDegenerateFaces().at(name);
    }
    EXPECT_EQ(d->edges, expected.edges);
    EXPECT_EQ(static_cast<long>(d->components.size()), expected.components);
    EXPECT_EQ(d->boundary_loops(), expected.loops);
    EXPECT_EQ(d->boundary_edges, expected.boundary_edges);
    EXPECT_EQ(d->non_manifold_edges.count, expected.non_manifold_edges);
    EXPECT_EQ(d->non_manifold_vertices.count, expected.non_manifold_vertices);
    EXPECT_EQ(d->inconsistent_edges.count, expected.inconsistent_edges);
    EXPECT_EQ(Genus(*d), expected.genus);
    if (number("degen") == 0) {
      // Without NaN the manifest's word for a disc without faults is "clean".
      EXPECT_EQ(d->is_disc(), row.at("clean") == "yes");
      if (number("nan") == 0) {
        EXPECT_EQ(FourDigits(d->angle_min_degrees), row.at("min_ang"));
        EXPECT_EQ(FourDigits(d->angle_max_degrees), row.at("max_ang"));
        EXPECT_EQ(d->needles.count, number("tri_lt1deg"));
      }
    } else {
      EXPECT_FALSE(d->is_disc());
    }
    const bool refused = number("nan") > 0 || d->surface_faces == 0;
    EXPECT_EQ(d->Refusal().ok(), !refused) << d->Refusal();
  }
  EXPECT_GE(compared, 58);
}

}  // namespace
}  // namespace planish
