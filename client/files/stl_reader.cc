#include <bit>

#include "absl/strings/match.h"
#include "client/files/file_io.h"
#include "client/files/polygon_mesh.h"
#include "client/files/readers.h"
#include "client/files/text_cursor.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

constexpr std::size_t kHeaderBytes = 80;
constexpr std::size_t kFirstTriangle = kHeaderBytes + 4;
constexpr std::size_t kTriangleBytes = 50;

std::uint32_t LittleEndian32(const char* bytes) {
  std::uint32_t value = 0;
  for (int i = 3; i >= 0; --i) value = value << 8 | static_cast<unsigned char>(bytes[i]);
  return value;
}

// Collects triangles; corners at exactly the same position become one vertex.
class Welder {
 public:
  void Reserve(std::int64_t triangles) {
    mesh_.corner_vertex.reserve(3 * triangles);
    mesh_.polygon_begin.reserve(triangles + 1);
    vertices_.Reserve(triangles / 2 + 3);
  }

  // `line` 0: the file is binary.
  void AddCorner(const Vec3& position, std::int64_t line) {
    const std::int32_t vertex = vertices_.Add(position);
    if (vertex == static_cast<std::int32_t>(mesh_.positions.size())) {
      mesh_.positions.push_back(position);
      if (line > 0) mesh_.vertex_line.push_back(line);
    }
    mesh_.corner_vertex.push_back(vertex);
  }

  void FinishTriangle(std::int64_t line) {
    mesh_.polygon_begin.push_back(static_cast<std::int64_t>(mesh_.corner_vertex.size()));
    if (line > 0) mesh_.polygon_line.push_back(line);
  }

  PolygonMesh& mesh() { return mesh_; }

 private:
  PolygonMesh mesh_;
  ValueIndex vertices_;
};

absl::StatusOr<PolygonMesh> ReadBinary(const std::string& path, std::string_view bytes) {
  if (bytes.size() < kFirstTriangle) {
    return FileMalformed(path, 0,
                         "neither an ascii STL (no \"solid\" at its start) nor a binary one (shorter than the header "
                         "of 84 bytes)");
  }
  const std::uint32_t triangles = LittleEndian32(bytes.data() + kHeaderBytes);
  const std::uint64_t needed = kFirstTriangle + std::uint64_t{triangles} * kTriangleBytes;
  if (bytes.size() < needed) {
    return FileMalformed(path, 0,
                         "the header announces " + std::to_string(triangles) + " triangles, which take " +
                             std::to_string(needed) + " bytes, but the file has " + std::to_string(bytes.size()) +
                             "; it is cut off or not an STL");
  }
  if (triangles == 0) return FileMalformed(path, 0, "no faces");
  Welder welder;
  welder.Reserve(triangles);
  for (std::uint32_t t = 0; t < triangles; ++t) {
    // Skips the normal, 12 bytes.
    const char* value = bytes.data() + kFirstTriangle + std::size_t{t} * kTriangleBytes + 12;
    for (int corner = 0; corner < 3; ++corner) {
      Vec3 position;
      for (int axis = 0; axis < 3; ++axis, value += 4) position[axis] = std::bit_cast<float>(LittleEndian32(value));
      welder.AddCorner(position, 0);
    }
    welder.FinishTriangle(0);
  }
  return std::move(welder.mesh());
}

absl::Status Expect(TextCursor& cursor, const char* keyword) {
  const std::string_view token = cursor.Token();
  if (absl::EqualsIgnoreCase(std::string(token), keyword)) return absl::OkStatus();
  if (token.empty()) {
    return cursor.Fault(std::string("the file ends where \"") + keyword + "\" should come; it seems to be cut off");
  }
  return cursor.Fault(std::string("expected \"") + keyword + "\", found " + Quoted(token));
}

absl::Status ReadFacet(TextCursor& cursor, Welder* welder) {
  const ElementName facet = {"triangle", welder->mesh().num_polygons()};
  const std::int64_t line = cursor.line();
  // The normal is not needed, and often wrong.
  PLANISH_RETURN_IF_ERROR(Expect(cursor, "normal"));
  for (int axis = 0; axis < 3; ++axis) cursor.Token();
  PLANISH_RETURN_IF_ERROR(Expect(cursor, "outer"));
  PLANISH_RETURN_IF_ERROR(Expect(cursor, "loop"));
  for (int corner = 0; corner < 3; ++corner) {
    PLANISH_RETURN_IF_ERROR(Expect(cursor, "vertex"));
    const std::int64_t vertex_line = cursor.line();
    Vec3 position;
    for (int axis = 0; axis < 3; ++axis) PLANISH_RETURN_IF_ERROR(cursor.ReadDouble(facet, &position[axis]));
    welder->AddCorner(position, vertex_line);
  }
  PLANISH_RETURN_IF_ERROR(Expect(cursor, "endloop"));
  PLANISH_RETURN_IF_ERROR(Expect(cursor, "endfacet"));
  welder->FinishTriangle(line);
  return absl::OkStatus();
}

absl::StatusOr<PolygonMesh> ReadAscii(const std::string& path, std::string_view text) {
  TextCursor cursor(path, text, 1, false);
  Welder welder;
  bool inside = false;
  while (true) {
    const std::string token(cursor.Token());
    if (token.empty()) break;
    if (!inside && absl::EqualsIgnoreCase(token, "solid")) {
      cursor.SkipLine();
      inside = true;
    } else if (inside && absl::EqualsIgnoreCase(token, "facet")) {
      PLANISH_RETURN_IF_ERROR(ReadFacet(cursor, &welder));
    } else if (inside && absl::EqualsIgnoreCase(token, "endsolid")) {
      cursor.SkipLine();
      inside = false;
    } else {
      return cursor.Fault(std::string("expected ") + (inside ? "\"facet\" or \"endsolid\"" : "\"solid\"") + ", found " +
                          Quoted(token));
    }
  }
  if (inside) return cursor.Fault("the file ends without \"endsolid\"; it seems to be cut off");
  if (welder.mesh().num_polygons() == 0) return FileMalformed(path, 0, "no faces");
  return std::move(welder.mesh());
}

// Whether an STL is text. "solid" at its start does not suffice, since many binary files start with it as well.
bool IsAscii(std::string_view bytes) {
  if (bytes.size() >= kFirstTriangle) {
    const std::uint64_t triangles = LittleEndian32(bytes.data() + kHeaderBytes);
    if (bytes.size() == kFirstTriangle + triangles * kTriangleBytes) return false;
  }
  const std::size_t start = bytes.find_first_not_of(" \t\r\n");
  return start != std::string_view::npos && absl::EqualsIgnoreCase(std::string(bytes.substr(start, 5)), "solid") &&
         bytes.substr(0, 1024).find('\0') == std::string_view::npos;
}

}  // namespace

absl::StatusOr<PolygonMesh> ReadStl(const std::string& path, std::string_view bytes) {
  if (bytes.empty()) return FileMalformed(path, 0, "the file is empty");
  return IsAscii(bytes) ? ReadAscii(path, bytes) : ReadBinary(path, bytes);
}

}  // namespace planish
