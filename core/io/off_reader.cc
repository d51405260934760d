#include "core/base/status_macros.h"
#include "core/io/file_error.h"
#include "core/io/number.h"
#include "core/io/off_header.h"
#include "core/io/readers.h"
#include "core/io/text_cursor.h"
#include "core/io/value_index.h"

namespace planish {
namespace {

absl::Status ReadCount(TextCursor& cursor, const char* kind, std::int64_t* count) {
  const std::string_view token = cursor.Token();
  if (!ParseInt(token, count)) {
    return cursor.Fault(std::string("number of ") + kind + ": " + Quoted(token) + " is not a whole number");
  }
  if (*count < 0 || *count > INT32_MAX) {
    return cursor.Fault(std::string("number of ") + kind + ": " + std::to_string(*count) + " is out of range");
  }
  // Every element takes two bytes at the very least, so that a lie is found before memory is taken.
  if (*count > cursor.remaining() / 2) {
    return cursor.Fault("the header announces " + std::to_string(*count) + " " + kind + ", but only " +
                        std::to_string(cursor.remaining()) + " bytes follow; the file seems to be cut off");
  }
  return absl::OkStatus();
}

absl::Status ReadPolygon(TextCursor& cursor, const ElementName& face, PolygonMesh* mesh) {
  std::int64_t corners = 0;
  PLANISH_RETURN_IF_ERROR(cursor.ReadInt(face, &corners));
  const std::string name = "face " + std::to_string(face.index);
  if (corners < 3) {
    return cursor.Fault(name + " has " + std::to_string(corners) + " corners, a face needs at least three");
  }
  mesh->polygon_line.push_back(cursor.line());
  const std::int64_t vertices = static_cast<std::int64_t>(mesh->positions.size());
  for (std::int64_t corner = 0; corner < corners; ++corner) {
    std::int64_t vertex = 0;
    PLANISH_RETURN_IF_ERROR(cursor.ReadInt(face, &vertex));
    if (vertex < 0 || vertex >= vertices) {
      return cursor.Fault(name + " refers to vertex " + std::to_string(vertex) + ", but the file has " +
                          std::to_string(vertices) + ", numbered from 0");
    }
    mesh->corner_vertex.push_back(static_cast<std::int32_t>(vertex));
  }
  mesh->polygon_begin.push_back(static_cast<std::int64_t>(mesh->corner_vertex.size()));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<OffKeyword> ReadOffKeyword(TextCursor& cursor) {
  OffKeyword result;
  std::string_view keyword = cursor.Peek();
  if (keyword.substr(0, 3) == "\xEF\xBB\xBF") keyword.remove_prefix(3);
  std::int64_t ignored = 0;
  if (ParseInt(keyword, &ignored)) return result;
  if (keyword.size() < 3 || keyword.substr(keyword.size() - 3) != "OFF") {
    return cursor.Fault("an OFF file starts with \"OFF\", this one with " + Quoted(keyword));
  }
  const std::string_view variant = keyword.substr(0, keyword.size() - 3);
  if (variant.find_first_of("4n") != std::string_view::npos) {
    return cursor.Fault(Quoted(keyword) + " holds vertices that are not in 3D");
  }
  if (variant.find_first_not_of("STCN") != std::string_view::npos) {
    return cursor.Fault("an OFF file starts with \"OFF\", this one with " + Quoted(keyword));
  }
  result.token = cursor.Token();
  result.letters = keyword.size();
  result.has_uv = variant.find("ST") != std::string_view::npos;
  if (cursor.Peek() == "BINARY") return cursor.Fault("binary OFF is not supported; save it as text, or as PLY");
  return result;
}

absl::StatusOr<PolygonMesh> ReadOff(const std::string& path, std::string_view text) {
  if (text.empty()) return FileMalformed(path, 0, "the file is empty");
  TextCursor cursor(path, text, 1, true);
  PLANISH_ASSIGN_OR_RETURN(const OffKeyword keyword, ReadOffKeyword(cursor));
  std::int64_t vertices = 0;
  std::int64_t faces = 0;
  PLANISH_RETURN_IF_ERROR(ReadCount(cursor, "vertices", &vertices));
  PLANISH_RETURN_IF_ERROR(ReadCount(cursor, "faces", &faces));
  cursor.SkipLine();
  if (faces == 0) return FileMalformed(path, 0, "no faces");

  PolygonMesh mesh;
  TexcoordTable texcoords;
  std::vector<std::int32_t> vertex_texcoord;
  for (std::int64_t i = 0; i < vertices; ++i) {
    Vec3 position;
    for (int axis = 0; axis < 3; ++axis) PLANISH_RETURN_IF_ERROR(cursor.ReadDouble({"vertex", i}, &position[axis]));
    mesh.positions.push_back(position);
    mesh.vertex_line.push_back(cursor.line());
    if (keyword.has_uv) {
      const std::vector<std::string_view> rest = cursor.RestOfLine();
      double u = 0;
      double v = 0;
      const std::size_t n = rest.size();
      if (n < 2 || !ParseDouble(rest[n - 2], &u) || !ParseDouble(rest[n - 1], &v)) {
        return cursor.Fault("vertex " + std::to_string(i) + " has no texture coordinates, which " +
                            Quoted(keyword.token) + " promises");
      }
      vertex_texcoord.push_back(texcoords.Add(u, v));
    }
    cursor.SkipLine();
  }
  for (std::int64_t i = 0; i < faces; ++i) {
    PLANISH_RETURN_IF_ERROR(ReadPolygon(cursor, {"face", i}, &mesh));
    cursor.SkipLine();
  }
  if (!keyword.has_uv) return mesh;
  for (const std::int32_t vertex : mesh.corner_vertex) mesh.corner_texcoord.push_back(vertex_texcoord[vertex]);
  mesh.texcoords = texcoords.TakeValues();
  return mesh;
}

}  // namespace planish
