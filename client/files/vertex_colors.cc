#include "client/files/vertex_colors.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <string_view>

#include "client/files/gltf_attribute.h"
#include "client/files/gltf_bake.h"
#include "client/files/gltf_mesh.h"
#include "client/files/obj_scanner.h"
#include "client/files/ply_format.h"
#include "client/files/text_cursor.h"
#include "client/texture/image.h"
#include "core/base/number.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

CornerColor LinearOf(const std::array<double, 4>& srgb) {
  CornerColor color;
  for (std::size_t c = 0; c < 4; ++c) {
    const double value = std::clamp(srgb[c], 0.0, 1.0);
    color[c] = static_cast<float>(c < 3 ? LinearOfSrgb(value) : value);
  }
  return color;
}

absl::StatusOr<std::vector<CornerColor>> ColorsOfPly(const MeshFile& file) {
  PLANISH_ASSIGN_OR_RETURN(const PlyHeader header, ReadPlyHeader(file.path, file.bytes));
  PLANISH_ASSIGN_OR_RETURN(const PlyLayout layout, FindPlyLayout(file.path, header));
  constexpr std::array<std::string_view, 4> kNames = {"red", "green", "blue", "alpha"};
  const auto channel_of = [&](const PlyProperty& property) {
    return std::find(kNames.begin(), kNames.end(), property.name) - kNames.begin();
  };
  std::array<bool, 4> found = {};
  for (const PlyProperty& property : header.elements[layout.vertex].properties) {
    if (!property.is_list && channel_of(property) < 4) found[static_cast<std::size_t>(channel_of(property))] = true;
  }
  if (!found[0] || !found[1] || !found[2]) return std::vector<CornerColor>();
  PlyValues values(file.path, file.bytes, header);
  std::vector<CornerColor> colors;
  for (std::size_t e = 0; e <= layout.vertex; ++e) {
    const PlyElement& element = header.elements[e];
    for (std::int64_t i = 0; i < element.count; ++i) {
      std::array<double, 4> srgb = {1, 1, 1, 1};
      for (const PlyProperty& property : element.properties) {
        const auto channel = channel_of(property);
        if (e != layout.vertex || channel == 4 || property.is_list) {
          PLANISH_RETURN_IF_ERROR(values.SkipProperty({element.name.c_str(), i}, property));
          continue;
        }
        double value = 0;
        PLANISH_RETURN_IF_ERROR(values.ReadDouble({element.name.c_str(), i}, property.type, &value));
        srgb[static_cast<std::size_t>(channel)] = IsInteger(property.type) ? value / 255 : value;
      }
      if (e == layout.vertex) colors.push_back(LinearOf(srgb));
    }
  }
  return colors;
}

std::vector<CornerColor> ColorsOfObj(const MeshFile& file) {
  std::vector<std::array<double, 4>> colors;
  double most = 0;
  ObjScanner scanner(file.bytes);
  ObjStatement statement;
  while (scanner.Next(&statement)) {
    ObjTokens tokens(file.bytes, statement);
    std::string_view token;
    if (!tokens.Next(&token) || token != "v") continue;
    std::vector<double> numbers;
    for (double value = 0; tokens.Next(&token) && ParseDouble(token, &value);) numbers.push_back(value);
    // This vertex has no colour (a fourth number alone is a weight), so the file has none.
    if (numbers.size() < 6) return {};
    colors.push_back({numbers[3], numbers[4], numbers[5], 1});
    most = std::max({most, numbers[3], numbers[4], numbers[5]});
  }
  std::vector<CornerColor> linear;
  for (std::array<double, 4>& color : colors) {
    for (std::size_t c = 0; c < 3 && most > 1; ++c) color[c] /= 255;
    linear.push_back(LinearOf(color));
  }
  return linear;
}

absl::StatusOr<std::vector<CornerColor>> ColorsOfGltf(const GltfMesh& gltf) {
  std::vector<CornerColor> colors(gltf.corner_vertex.size(), CornerColor{1, 1, 1, 1});
  bool has_colors = false;
  for (const GltfPrimitive& primitive : gltf.primitives) {
    PLANISH_ASSIGN_OR_RETURN(const std::vector<CornerColor> own, CornerColors(gltf, primitive));
    has_colors = has_colors || !own.empty();
    const Json& root = gltf.document.json;
    const std::int64_t material = GltfIntAt(PrimitiveJson(root, primitive), "material", -1);
    CornerColor factor = {1, 1, 1, 1};
    if (material >= 0) {
      const Json* const pbr = GltfObject(root["materials"][static_cast<std::size_t>(material)], "pbrMetallicRoughness");
      const Json given = pbr == nullptr ? Json() : pbr->value("baseColorFactor", Json());
      for (std::size_t c = 0; c < 4 && given.is_array() && c < given.size(); ++c) {
        if (given[c].is_number()) factor[c] = given[c].get<float>();
      }
    }
    const auto first = static_cast<std::size_t>(3 * primitive.first_polygon);
    for (std::size_t i = 0; i < 3 * static_cast<std::size_t>(primitive.num_polygons); ++i) {
      for (std::size_t c = 0; c < 4; ++c) colors[first + i][c] = factor[c] * (own.empty() ? 1 : own[i][c]);
    }
  }
  if (!has_colors) colors.clear();
  return colors;
}

}  // namespace

absl::StatusOr<std::vector<CornerColor>> VertexColors(const MeshFile& file) {
  if (file.gltf) return ColorsOfGltf(*file.gltf);
  std::vector<CornerColor> of_vertex;
  if (file.format == MeshFormat::kPly) {
    PLANISH_ASSIGN_OR_RETURN(of_vertex, ColorsOfPly(file));
  } else if (file.format == MeshFormat::kObj) {
    of_vertex = ColorsOfObj(file);
  }
  std::vector<CornerColor> of_corner;
  if (of_vertex.empty()) return of_corner;
  const std::vector<std::int32_t>& vertices =
      file.mesh.corner_file_vertex.empty() ? file.mesh.corner_vertex : file.mesh.corner_file_vertex;
  for (const std::int32_t v : vertices) of_corner.push_back(of_vertex[static_cast<std::size_t>(v)]);
  return of_corner;
}

}  // namespace planish
