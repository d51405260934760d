#include <bit>
#include <optional>

#include "core/base/status_macros.h"
#include "core/io/file_error.h"
#include "core/io/ply_header.h"
#include "core/io/readers.h"
#include "core/io/text_cursor.h"

namespace planish {
namespace {

// Values one after another, in ascii or binary alike.
class ValueSource {
 public:
  ValueSource(const std::string& path, std::string_view bytes, const PlyHeader& header)
      : path_(path),
        bytes_(bytes.substr(header.data_offset)),
        encoding_(header.encoding),
        cursor_(path, bytes_, header.data_line, false) {}

  bool is_text() const { return encoding_ == PlyEncoding::kAscii; }
  std::int64_t line() const { return is_text() ? cursor_.line() : 0; }

  absl::Status Fault(const std::string& message) const { return FileMalformed(path_, line(), message); }

  absl::Status ReadDouble(const ElementName& element, PlyType type, double* value) {
    if (is_text()) return cursor_.ReadDouble(element, value);
    std::uint64_t bits = 0;
    PLANISH_RETURN_IF_ERROR(ReadBits(element, PlyTypeSize(type), &bits));
    if (type == PlyType::kFloat32) {
      *value = std::bit_cast<float>(static_cast<std::uint32_t>(bits));
    } else if (type == PlyType::kFloat64) {
      *value = std::bit_cast<double>(bits);
    } else {
      *value = static_cast<double>(Integer(type, bits));
    }
    return absl::OkStatus();
  }

  absl::Status ReadInt(const ElementName& element, PlyType type, std::int64_t* value) {
    if (is_text()) return cursor_.ReadInt(element, value);
    std::uint64_t bits = 0;
    PLANISH_RETURN_IF_ERROR(ReadBits(element, PlyTypeSize(type), &bits));
    *value = Integer(type, bits);
    return absl::OkStatus();
  }

  // Skips `count` values, whatever they are.
  absl::Status Skip(const ElementName& element, PlyType type, std::int64_t count) {
    if (is_text()) {
      for (std::int64_t i = 0; i < count; ++i) {
        if (cursor_.Token().empty()) return CutOff(element);
      }
      return absl::OkStatus();
    }
    // Counts are at most 2^32 here, so the product does not overflow.
    const std::uint64_t size = static_cast<std::uint64_t>(count) * PlyTypeSize(type);
    if (bytes_.size() - position_ < size) return CutOff(element);
    position_ += size;
    return absl::OkStatus();
  }

 private:
  absl::Status CutOff(const ElementName& element) const {
    return Fault("the file ends before " + std::string(element.kind) + " " + std::to_string(element.index) +
                 " is complete; it seems to be cut off");
  }

  absl::Status ReadBits(const ElementName& element, int size, std::uint64_t* bits) {
    if (bytes_.size() - position_ < static_cast<std::size_t>(size)) return CutOff(element);
    *bits = 0;
    for (int i = 0; i < size; ++i) {
      const int byte = encoding_ == PlyEncoding::kBigEndian ? i : size - 1 - i;
      *bits = *bits << 8 | static_cast<unsigned char>(bytes_[position_ + byte]);
    }
    position_ += size;
    return absl::OkStatus();
  }

  static std::int64_t Integer(PlyType type, std::uint64_t bits) {
    switch (type) {
      case PlyType::kInt8:
        return static_cast<std::int8_t>(bits);
      case PlyType::kInt16:
        return static_cast<std::int16_t>(bits);
      case PlyType::kInt32:
        return static_cast<std::int32_t>(bits);
      default:
        return static_cast<std::int64_t>(bits);
    }
  }

  const std::string& path_;
  std::string_view bytes_;
  PlyEncoding encoding_;
  TextCursor cursor_;
  std::size_t position_ = 0;  // binary only; the cursor has its own
};

class PlyReader {
 public:
  PlyReader(const std::string& path, std::string_view bytes, const PlyHeader& header)
      : path_(path), header_(header), source_(path, bytes, header) {}

  absl::StatusOr<PolygonMesh> Read() {
    const PlyElement* const vertices = Element("vertex");
    const PlyElement* const faces = Element("face");
    if (vertices == nullptr) return FileMalformed(path_, 0, "no element \"vertex\" in the header");
    if (faces == nullptr || faces->count == 0) {
      return FileMalformed(path_, 0,
                           Element("tristrips") != nullptr
                               ? "triangle strips are not supported; save the mesh with an element \"face\""
                               : "no faces; a point cloud cannot be unwrapped");
    }
    if (vertices->count > INT32_MAX) return FileMalformed(path_, 0, "more than 2147483647 vertices");
    num_vertices_ = vertices->count;
    for (const PlyElement& element : header_.elements) {
      // Without properties there is no data, and the count is just a number.
      if (element.properties.empty()) continue;
      if (&element == vertices) {
        PLANISH_RETURN_IF_ERROR(ReadVertices(element));
      } else if (&element == faces) {
        PLANISH_RETURN_IF_ERROR(ReadFaces(element));
      } else {
        PLANISH_RETURN_IF_ERROR(SkipElement(element));
      }
    }
    if (mesh_.num_polygons() == 0) return FileMalformed(path_, 0, "no faces");
    return std::move(mesh_);
  }

 private:
  const PlyElement* Element(std::string_view name) const {
    for (const PlyElement& element : header_.elements) {
      if (element.name == name) return &element;
    }
    return nullptr;
  }

  static std::optional<std::size_t> Property(const PlyElement& element, std::string_view name, bool is_list) {
    for (std::size_t i = 0; i < element.properties.size(); ++i) {
      if (element.properties[i].name == name && element.properties[i].is_list == is_list) return i;
    }
    return std::nullopt;
  }

  absl::Status ReadVertices(const PlyElement& element) {
    // Which coordinate a property is, or -1.
    std::vector<int> axis_of(element.properties.size(), -1);
    for (int axis = 0; axis < 3; ++axis) {
      const std::string_view name = std::string_view("xyz").substr(axis, 1);
      const auto property = Property(element, name, false);
      if (!property) {
        return FileMalformed(path_, 0, "the vertices have no property " + Quoted(name));
      }
      axis_of[*property] = axis;
    }
    mesh_.positions.reserve(element.count);
    for (std::int64_t i = 0; i < element.count; ++i) {
      const ElementName vertex = {"vertex", i};
      Vec3 position;
      for (std::size_t p = 0; p < axis_of.size(); ++p) {
        if (axis_of[p] < 0) {
          PLANISH_RETURN_IF_ERROR(SkipProperty(vertex, element.properties[p]));
          continue;
        }
        PLANISH_RETURN_IF_ERROR(source_.ReadDouble(vertex, element.properties[p].type, &position[axis_of[p]]));
        if (axis_of[p] == 0 && source_.is_text()) mesh_.vertex_line.push_back(source_.line());
      }
      mesh_.positions.push_back(position);
    }
    return absl::OkStatus();
  }

  absl::Status ReadFaces(const PlyElement& element) {
    auto indices = Property(element, "vertex_indices", true);
    if (!indices) indices = Property(element, "vertex_index", true);
    if (!indices) return FileMalformed(path_, 0, "the faces have no list property \"vertex_indices\"");
    if (!IsInteger(element.properties[*indices].type)) {
      return FileMalformed(path_, 0, "vertex_indices must have an integer type");
    }
    mesh_.polygon_begin.reserve(element.count + 1);
    mesh_.corner_vertex.reserve(3 * element.count);
    for (std::int64_t i = 0; i < element.count; ++i) {
      const ElementName face = {"face", i};
      for (std::size_t p = 0; p < element.properties.size(); ++p) {
        if (p == *indices) {
          PLANISH_RETURN_IF_ERROR(ReadPolygon(face, element.properties[p]));
        } else {
          PLANISH_RETURN_IF_ERROR(SkipProperty(face, element.properties[p]));
        }
      }
    }
    return absl::OkStatus();
  }

  absl::Status ReadPolygon(const ElementName& face, const PlyProperty& property) {
    std::int64_t corners = 0;
    PLANISH_RETURN_IF_ERROR(source_.ReadInt(face, property.count_type, &corners));
    if (corners < 3) {
      return source_.Fault("face " + std::to_string(face.index) + " has " + std::to_string(corners) +
                           " corners, a face needs at least three");
    }
    if (source_.is_text()) mesh_.polygon_line.push_back(source_.line());
    for (std::int64_t corner = 0; corner < corners; ++corner) {
      std::int64_t vertex = 0;
      PLANISH_RETURN_IF_ERROR(source_.ReadInt(face, property.type, &vertex));
      if (vertex < 0 || vertex >= num_vertices_) {
        return source_.Fault("face " + std::to_string(face.index) + " refers to vertex " + std::to_string(vertex) +
                             ", but the file has " + std::to_string(num_vertices_) + ", numbered from 0");
      }
      mesh_.corner_vertex.push_back(static_cast<std::int32_t>(vertex));
    }
    mesh_.polygon_begin.push_back(static_cast<std::int64_t>(mesh_.corner_vertex.size()));
    return absl::OkStatus();
  }

  absl::Status SkipProperty(const ElementName& element, const PlyProperty& property) {
    std::int64_t count = 1;
    if (property.is_list) {
      PLANISH_RETURN_IF_ERROR(source_.ReadInt(element, property.count_type, &count));
      if (count < 0 || count > UINT32_MAX) {
        return source_.Fault(std::string(element.kind) + " " + std::to_string(element.index) + ": a list of length " +
                             std::to_string(count));
      }
    }
    return source_.Skip(element, property.type, count);
  }

  absl::Status SkipElement(const PlyElement& element) {
    for (std::int64_t i = 0; i < element.count; ++i) {
      for (const PlyProperty& property : element.properties) {
        PLANISH_RETURN_IF_ERROR(SkipProperty({element.name.c_str(), i}, property));
      }
    }
    return absl::OkStatus();
  }

  const std::string& path_;
  const PlyHeader& header_;
  ValueSource source_;
  std::int64_t num_vertices_ = 0;
  PolygonMesh mesh_;
};

}  // namespace

absl::StatusOr<PolygonMesh> ReadPly(const std::string& path, std::string_view bytes) {
  if (bytes.empty()) return FileMalformed(path, 0, "the file is empty");
  PLANISH_ASSIGN_OR_RETURN(const PlyHeader header, ReadPlyHeader(path, bytes));
  return PlyReader(path, bytes, header).Read();
}

}  // namespace planish
