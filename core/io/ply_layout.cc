#include "core/io/ply_layout.h"

#include "core/io/file_error.h"

namespace planish {
namespace {

std::optional<std::size_t> ElementNamed(const PlyHeader& header, std::string_view name) {
  for (std::size_t i = 0; i < header.elements.size(); ++i) {
    if (header.elements[i].name == name) return i;
  }
  return std::nullopt;
}

std::optional<std::size_t> Property(const PlyElement& element, std::string_view name, bool is_list) {
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    if (element.properties[i].name == name && element.properties[i].is_list == is_list) return i;
  }
  return std::nullopt;
}

}  // namespace

absl::StatusOr<PlyLayout> FindPlyLayout(const std::string& path, const PlyHeader& header) {
  const auto vertex = ElementNamed(header, "vertex");
  const auto face = ElementNamed(header, "face");
  if (!vertex) return FileMalformed(path, 0, "no element \"vertex\" in the header");
  if (!face || header.elements[*face].count == 0) {
    return FileMalformed(path, 0,
                         ElementNamed(header, "tristrips")
                             ? "triangle strips are not supported; save the mesh with an element \"face\""
                             : "no faces; a point cloud cannot be unwrapped");
  }
  PlyLayout layout;
  layout.vertex = *vertex;
  layout.face = *face;
  const PlyElement& vertices = header.elements[*vertex];
  const PlyElement& faces = header.elements[*face];
  if (vertices.count > INT32_MAX) return FileMalformed(path, 0, "more than 2147483647 vertices");
  for (int axis = 0; axis < 3; ++axis) {
    const std::string_view name = std::string_view("xyz").substr(axis, 1);
    const auto property = Property(vertices, name, false);
    if (!property && vertices.count > 0) {
      return FileMalformed(path, 0, "the vertices have no property " + Quoted(name));
    }
    layout.xyz[axis] = property.value_or(0);
  }
  static constexpr std::array<const char*, 2> kUvNames[] = {
      {"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}};
  for (const auto& names : kUvNames) {
    const auto u = Property(vertices, names[0], false);
    const auto v = Property(vertices, names[1], false);
    if (!layout.vertex_uv && u && v) layout.vertex_uv = {*u, *v};
  }
  auto indices = Property(faces, "vertex_indices", true);
  if (!indices) indices = Property(faces, "vertex_index", true);
  if (!indices) return FileMalformed(path, 0, "the faces have no list property \"vertex_indices\"");
  if (!IsInteger(faces.properties[*indices].type)) {
    return FileMalformed(path, 0, "vertex_indices must have an integer type");
  }
  layout.indices = *indices;
  layout.face_uv = Property(faces, "texcoord", true);
  return layout;
}

}  // namespace planish
