#include <bit>
#include <utility>

#include "client/files/ply_format.h"
#include "client/files/seam_copies.h"
#include "client/files/writers.h"
#include "core/base/corner_split.h"
#include "core/base/number.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

const char* NameOf(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
      return "char";
    case PlyType::kUint8:
      return "uchar";
    case PlyType::kInt16:
      return "short";
    case PlyType::kUint16:
      return "ushort";
    case PlyType::kInt32:
      return "int";
    case PlyType::kUint32:
      return "uint";
    case PlyType::kFloat32:
      return "float";
    case PlyType::kFloat64:
      return "double";
  }
  return "";
}

const char* NameOf(PlyEncoding encoding) {
  switch (encoding) {
    case PlyEncoding::kAscii:
      return "ascii";
    case PlyEncoding::kLittleEndian:
      return "binary_little_endian";
    case PlyEncoding::kBigEndian:
      return "binary_big_endian";
  }
  return "";
}

// Writes values; in ascii with a blank after each.
class PlySink {
 public:
  explicit PlySink(PlyEncoding encoding) : encoding_(encoding) {}

  void Real(double value, PlyType type) {
    const float rounded = static_cast<float>(value);
    if (encoding_ == PlyEncoding::kAscii) {
      type == PlyType::kFloat32 ? AppendShortest(rounded, &bytes) : AppendShortest(value, &bytes);
      bytes += ' ';
    } else if (type == PlyType::kFloat32) {
      Bits(std::bit_cast<std::uint32_t>(rounded), 4);
    } else {
      Bits(std::bit_cast<std::uint64_t>(value), 8);
    }
  }

  void Integer(std::int64_t value, PlyType type) {
    if (encoding_ == PlyEncoding::kAscii) {
      AppendShortest(value, &bytes);
      bytes += ' ';
    } else {
      Bits(static_cast<std::uint64_t>(value), PlyTypeSize(type));
    }
  }

  void EndElement() {
    if (encoding_ != PlyEncoding::kAscii) return;
    if (!bytes.empty() && bytes.back() == ' ') bytes.pop_back();
    bytes += '\n';
  }

  std::string bytes;

 private:
  void Bits(std::uint64_t bits, int size) {
    for (int i = 0; i < size; ++i) {
      const int shift = 8 * (encoding_ == PlyEncoding::kBigEndian ? size - 1 - i : i);
      bytes += static_cast<char>(bits >> shift & 0xFF);
    }
  }

  PlyEncoding encoding_;
};

class PlyWriter {
 public:
  PlyWriter(const MeshFile& file, const WrittenPolygons& written, const PlyHeader& header, const PlyLayout& layout,
            PlyType uv_type, bool keeps_images)
      : file_(file),
        written_(written),
        header_(header),
        layout_(layout),
        uv_type_(uv_type),
        keeps_images_(keeps_images),
        values_(file.path, file.bytes, header),
        sink_(header.encoding) {
    // With UV in the faces, vertices stay unchanged.
    if (!layout_.face_uv) {
      split_ = SplitForFile(written.mesh, written.corner_uv);
    }
    const PlyType type = header.elements[layout.face].properties[layout.indices].type;
    const std::int64_t largest = split_.num_vertices() - 1;
    const int bits = 8 * PlyTypeSize(type) - (type == PlyType::kInt8 || type == PlyType::kInt16 ? 1 : 0);
    index_type_ = bits >= 31 || largest < std::int64_t{1} << bits ? type : PlyType::kInt32;
  }

  absl::StatusOr<std::string> Write() {
    WriteHeader();
    for (std::size_t i = 0; i < header_.elements.size(); ++i) {
      const PlyElement& element = header_.elements[i];
      if (element.properties.empty()) continue;
      if (i == layout_.vertex) {
        PLANISH_RETURN_IF_ERROR(WriteVertices(element));
      } else if (i == layout_.face) {
        PLANISH_RETURN_IF_ERROR(WriteFaces(element));
      } else {
        for (std::int64_t k = 0; k < element.count; ++k) {
          for (const PlyProperty& property : element.properties) {
            PLANISH_RETURN_IF_ERROR(values_.Copy({element.name.c_str(), k}, property, &sink_.bytes));
          }
          sink_.EndElement();
        }
      }
    }
    return std::move(sink_.bytes);
  }

 private:
  // Whether the property is an old UV of vertices, which is replaced. If faces have UV, it is only removed, since two
  // sets of UV would contradict each other.
  bool IsOldVertexUv(std::size_t property) const {
    return layout_.vertex_uv && (property == (*layout_.vertex_uv)[0] || property == (*layout_.vertex_uv)[1]);
  }

  // Copies the header with the changes that the new UV need. Every line ends as the first one does.
  void WriteHeader() {
    const std::string_view text = std::string_view(file_.bytes).substr(0, header_.data_offset);
    const std::size_t first_end = text.find_first_of("\r\n");
    const std::string line_end(text.substr(first_end, text.substr(first_end, 2) == "\r\n" ? 2 : 1));
    std::size_t element = 0;
    std::size_t property = 0;
    bool inside = false, has_marks = false;
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t end = std::min(text.find_first_of("\r\n", at), text.size());
      std::string line(text.substr(at, end - at));
      at = end + (text.substr(end, 2) == "\r\n" ? 2 : 1);
      const std::size_t word = line.find_first_not_of(" \t\v\f");
      const std::string_view keyword = word == std::string::npos ? "" : std::string_view(line).substr(word);
      if (keyword.starts_with("comment")) {
        const std::string_view comment = keyword.substr(7);
        if (IsSeamMark(comment) || (!keeps_images_ && !PlyImage(comment).empty())) continue;
      }
      const bool begins_element = keyword.starts_with("element");
      if (begins_element || keyword.starts_with("end_header")) {
        if (inside && element == layout_.vertex && !layout_.face_uv) AddUvProperties(line_end);
        if (inside) ++element;
        inside = begins_element;
        property = 0;
        if (begins_element && !std::exchange(has_marks, true)) AddMarks(line_end);
        if (begins_element && element == layout_.vertex && !layout_.face_uv) {
          line = "element vertex " + std::to_string(split_.num_vertices());
        } else if (begins_element && element == layout_.face && !written_.torn.empty()) {
          line = "element face " + std::to_string(written_.mesh.num_polygons());
        }
      } else if (keyword.starts_with("property")) {
        const std::size_t here = property++;
        if (element == layout_.vertex && IsOldVertexUv(here)) continue;
        const PlyProperty& old = header_.elements[element].properties[here];
        if (element == layout_.face && here == layout_.indices && index_type_ != old.type) {
          line = std::string("property list ") + NameOf(old.count_type) + " " + NameOf(index_type_) + " " + old.name;
        } else if (element == layout_.face && layout_.face_uv == here) {
          line = std::string("property list ") + NameOf(FaceUvCountType()) + " " + NameOf(uv_type_) + " " + old.name;
        }
      }
      sink_.bytes += line + line_end;
    }
  }

  // Adds the seam marks, and the line "format" if it is missing, before the header's first element.
  void AddMarks(const std::string& line_end) {
    if (!header_.has_format) sink_.bytes += std::string("format ") + NameOf(header_.encoding) + " 1.0" + line_end;
    if (layout_.face_uv) return;
    for (const std::string& mark : SeamMarks(file_.mesh, split_)) sink_.bytes += "comment " + mark + line_end;
  }

  void AddUvProperties(const std::string& line_end) {
    for (const char* name : {"s", "t"}) {
      sink_.bytes += std::string("property ") + NameOf(uv_type_) + " " + name + line_end;
    }
  }

  // The type of a texcoord list's length. A polygon of n corners has 2 n numbers; a byte may hold n but not 2 n.
  PlyType FaceUvCountType() const {
    const PlyType old = header_.elements[layout_.face].properties[*layout_.face_uv].count_type;
    std::int64_t largest = 0;
    for (std::int64_t p = 0; p < file_.mesh.num_polygons(); ++p) {
      largest = std::max(largest, 2 * (file_.mesh.polygon_begin[p + 1] - file_.mesh.polygon_begin[p]));
    }
    return largest < 128 || PlyTypeSize(old) == 4 ? old : PlyType::kInt32;
  }

  absl::Status WriteVertices(const PlyElement& element) {
    // Per old vertex: its bytes without UV, from which copies are made. The copies in the old file are left out.
    const auto kept = static_cast<std::int64_t>(file_.mesh.positions.size());
    std::vector<std::string> old(split_.source.empty() ? 0 : static_cast<std::size_t>(kept));
    std::string bytes;
    std::string dropped;
    for (std::int64_t i = 0; i < element.count; ++i) {
      bytes.clear();
      for (std::size_t p = 0; p < element.properties.size(); ++p) {
        std::string* const target = IsOldVertexUv(p) ? &dropped : &bytes;
        PLANISH_RETURN_IF_ERROR(values_.Copy({"vertex", i}, element.properties[p], target));
      }
      dropped.clear();
      if (i >= kept) continue;
      sink_.bytes += bytes;
      if (layout_.face_uv) {
        sink_.EndElement();
        continue;
      }
      WriteVertexUv(static_cast<std::size_t>(i));
      old[static_cast<std::size_t>(i)] = std::move(bytes);
    }
    for (std::size_t v = static_cast<std::size_t>(kept); v < split_.source.size(); ++v) {
      sink_.bytes += old[static_cast<std::size_t>(split_.source[v])];
      WriteVertexUv(v);
    }
    return absl::OkStatus();
  }

  void WriteVertexUv(std::size_t vertex) {
    sink_.Real(split_.uv[2 * vertex], uv_type_);
    sink_.Real(split_.uv[2 * vertex + 1], uv_type_);
    sink_.EndElement();
  }

  absl::Status WriteFaces(const PlyElement& element) {
    std::vector<std::string> values(element.properties.size());  // of a face, as in the file
    auto torn = written_.torn.begin();
    std::int64_t written = 0;
    for (std::int64_t i = 0; i < element.count; ++i) {
      for (std::size_t p = 0; p < values.size(); ++p) {
        values[p].clear();
        PLANISH_RETURN_IF_ERROR(values_.Copy({"face", i}, element.properties[p], &values[p]));
      }
      const bool is_torn = torn != written_.torn.end() && torn->polygon == i;
      const std::size_t parts = is_torn ? torn->faces.size() : 1;
      for (std::size_t k = 0; k < parts; ++k) WriteFace(element, values, written++, is_torn);
      torn += is_torn;
    }
    return absl::OkStatus();
  }

  std::int32_t FileVertex(std::size_t corner) const {
    const PolygonMesh& mesh = written_.mesh;
    return mesh.corner_file_vertex.empty() ? mesh.corner_vertex[corner] : mesh.corner_file_vertex[corner];
  }

  void WriteFace(const PlyElement& element, const std::vector<std::string>& values, std::int64_t polygon,
                 bool is_torn) {
    const auto begin = static_cast<std::size_t>(written_.mesh.polygon_begin[static_cast<std::size_t>(polygon)]);
    const auto end = static_cast<std::size_t>(written_.mesh.polygon_begin[static_cast<std::size_t>(polygon) + 1]);
    for (std::size_t p = 0; p < element.properties.size(); ++p) {
      const PlyProperty& property = element.properties[p];
      if (p == layout_.indices && (is_torn || !layout_.face_uv)) {
        sink_.Integer(static_cast<std::int64_t>(end - begin), property.count_type);
        for (std::size_t c = begin; c < end; ++c) {
          sink_.Integer(layout_.face_uv ? FileVertex(c) : split_.corner[c], index_type_);
        }
      } else if (layout_.face_uv == p) {
        sink_.Integer(static_cast<std::int64_t>(2 * (end - begin)), FaceUvCountType());
        for (std::size_t c = 2 * begin; c < 2 * end; ++c) sink_.Real(written_.corner_uv[c], uv_type_);
      } else {
        sink_.bytes += values[p];
      }
    }
    sink_.EndElement();
  }

  const MeshFile& file_;
  const WrittenPolygons& written_;
  const PlyHeader& header_;
  const PlyLayout& layout_;
  const PlyType uv_type_;
  const bool keeps_images_;
  PlyType index_type_ = PlyType::kInt32;
  CornerSplit split_;
  PlyValues values_;
  PlySink sink_;
};

}  // namespace

absl::StatusOr<std::string> WritePly(const MeshFile& file, const WrittenPolygons& written, bool uv_is_float,
                                     bool keeps_images) {
  PLANISH_ASSIGN_OR_RETURN(const PlyHeader header, ReadPlyHeader(file.path, file.bytes));
  PLANISH_ASSIGN_OR_RETURN(const PlyLayout layout, FindPlyLayout(file.path, header));
  const PlyType uv_type = uv_is_float ? PlyType::kFloat32 : PlyType::kFloat64;
  return PlyWriter(file, written, header, layout, uv_type, keeps_images).Write();
}

std::string PlainPly(const PolygonMesh& mesh, const std::vector<double>& corner_uv, bool uv_is_float) {
  const CornerSplit split = SplitForFile(mesh, corner_uv);
  bool positions_are_float = true;
  for (const Vec3& position : mesh.positions) {
    for (const double value : {position.x(), position.y(), position.z()}) {
      positions_are_float &= value != value || double{static_cast<float>(value)} == value;
    }
  }
  std::int64_t most_corners = 0;
  for (std::int64_t p = 0; p < mesh.num_polygons(); ++p) {
    most_corners = std::max(most_corners, mesh.polygon_begin[p + 1] - mesh.polygon_begin[p]);
  }
  const PlyType position_type = positions_are_float ? PlyType::kFloat32 : PlyType::kFloat64;
  const PlyType uv_type = uv_is_float ? PlyType::kFloat32 : PlyType::kFloat64;
  const PlyType count_type = most_corners < 256 ? PlyType::kUint8 : PlyType::kInt32;

  PlySink sink(PlyEncoding::kLittleEndian);
  sink.bytes = "ply\nformat binary_little_endian 1.0\n";
  for (const std::string& mark : SeamMarks(mesh, split)) sink.bytes += "comment " + mark + "\n";
  sink.bytes += "element vertex " + std::to_string(split.num_vertices()) + "\n";
  for (const char* name : {"x", "y", "z"}) {
    sink.bytes += std::string("property ") + NameOf(position_type) + " " + name + "\n";
  }
  for (const char* name : {"s", "t"}) sink.bytes += std::string("property ") + NameOf(uv_type) + " " + name + "\n";
  sink.bytes += "element face " + std::to_string(mesh.num_polygons()) + "\nproperty list " + NameOf(count_type) +
                " int vertex_indices\nend_header\n";
  for (std::size_t v = 0; v < split.source.size(); ++v) {
    const Vec3& position = mesh.positions[split.source[v]];
    for (int axis = 0; axis < 3; ++axis) sink.Real(position[axis], position_type);
    sink.Real(split.uv[2 * v], uv_type);
    sink.Real(split.uv[2 * v + 1], uv_type);
  }
  for (std::int64_t p = 0; p < mesh.num_polygons(); ++p) {
    sink.Integer(mesh.polygon_begin[p + 1] - mesh.polygon_begin[p], count_type);
    for (std::int64_t c = mesh.polygon_begin[p]; c < mesh.polygon_begin[p + 1]; ++c) {
      sink.Integer(split.corner[static_cast<std::size_t>(c)], PlyType::kInt32);
    }
  }
  return std::move(sink.bytes);
}

}  // namespace planish
