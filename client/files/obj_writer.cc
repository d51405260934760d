#include <bit>
#include <cassert>

#include "client/files/mesh_file.h"
#include "client/files/obj_scanner.h"
#include "client/files/writers.h"
#include "core/base/number.h"

namespace planish {
namespace {

// The vt lines of a mesh and the vt of each corner.
class UvTable {
 public:
  UvTable(const PolygonMesh& mesh, const std::vector<double>& corner_uv, bool uv_is_float)
      : is_float_(uv_is_float), first_of_vertex_(mesh.positions.size(), kNone) {
    index_of_corner_.reserve(mesh.corner_vertex.size());
    for (std::size_t corner = 0; corner < mesh.corner_vertex.size(); ++corner) {
      const Vec2 uv(Rounded(corner_uv[2 * corner]), Rounded(corner_uv[2 * corner + 1]));
      index_of_corner_.push_back(FindOrAdd(mesh.corner_vertex[corner], uv));
    }
  }

  // The vt of a corner, 1-based as in OBJ.
  std::int64_t IndexOfCorner(std::int64_t corner) const { return index_of_corner_[corner] + 1; }

  std::string Lines(std::string_view line_end) const {
    std::string text;
    text.reserve(uv_.size() * 28);
    for (const Vec2& uv : uv_) {
      text += "vt ";
      Append(uv.x(), &text);
      text += ' ';
      Append(uv.y(), &text);
      text += line_end;
    }
    return text;
  }

 private:
  static constexpr std::int64_t kNone = -1;

  // Adding zero turns -0 into 0.
  double Rounded(double value) const { return (is_float_ ? double{static_cast<float>(value)} : value) + 0.0; }

  static bool SameBits(const Vec2& a, const Vec2& b) {
    return std::bit_cast<std::uint64_t>(a.x()) == std::bit_cast<std::uint64_t>(b.x()) &&
           std::bit_cast<std::uint64_t>(a.y()) == std::bit_cast<std::uint64_t>(b.y());
  }

  std::int64_t FindOrAdd(std::int32_t vertex, const Vec2& uv) {
    std::int64_t* link = &first_of_vertex_[vertex];
    while (*link != kNone) {
      if (SameBits(uv_[*link], uv)) return *link;
      link = &next_[*link];
    }
    const std::int64_t added = static_cast<std::int64_t>(uv_.size());
    *link = added;
    uv_.push_back(uv);
    next_.push_back(kNone);
    return added;
  }

  void Append(double value, std::string* text) const { AppendShortest(Rounded(value), text); }

  bool is_float_;
  // The vt of a vertex form a linked list, since there are few of them: first_of_vertex_ has the first vt of each
  // vertex, next_ the vt that follows each vt.
  std::vector<std::int64_t> first_of_vertex_;
  std::vector<std::int64_t> next_;
  std::vector<Vec2> uv_;
  std::vector<std::int64_t> index_of_corner_;
};

std::string_view Keyword(std::string_view text, const ObjStatement& statement) {
  ObjTokens tokens(text, statement);
  std::string_view keyword;
  return tokens.Next(&keyword) ? keyword : std::string_view();
}

// The characters that end the first line, as ObjScanner finds it.
std::string_view LineEnd(std::string_view text) {
  const std::size_t line_feed = text.find('\n');
  if (line_feed == std::string_view::npos) return text.find('\r') == std::string_view::npos ? "\n" : "\r";
  return line_feed > 0 && text[line_feed - 1] == '\r' ? "\r\n" : "\n";
}

// The offset at which the vt lines are inserted, so that a one-pass reader has every vt before a face refers to it. Of
// the text before the first face: where the first old vt is, else after the last v or vn, else right before the face.
std::size_t UvOffset(std::string_view text) {
  ObjScanner scanner(text);
  ObjStatement statement;
  std::size_t behind_vertices = std::string_view::npos;
  while (scanner.Next(&statement)) {
    const std::string_view keyword = Keyword(text, statement);
    if (keyword == "vt") return statement.begin;
    if (keyword == "v" || keyword == "vn") behind_vertices = statement.next;
    if (IsObjFace(keyword)) return behind_vertices == std::string_view::npos ? statement.begin : behind_vertices;
  }
  return text.size();
}

// Whether an element with this keyword, though not a face, has corners that may refer to vt.
bool MayReferToUv(std::string_view keyword) {
  return keyword == "l" || keyword == "p" || keyword == "surf";
}

class ObjWriter {
 public:
  ObjWriter(std::string_view text, const UvTable& uv, const std::vector<TornPolygon>& torn, const PolygonMesh& mesh,
            const ObjMaterialEdit& materials)
      : text_(text), uv_(uv), torn_(torn), mesh_(mesh), materials_(materials) {}

  std::string Write() {
    const std::size_t uv_offset = UvOffset(text_);
    const std::string uv_lines = uv_.Lines(LineEnd(text_));
    out_.reserve(text_.size() + uv_lines.size() + text_.size() / 4);

    ObjScanner scanner(text_);
    ObjStatement statement;
    while (scanner.Next(&statement)) {
      if (statement.begin == uv_offset) {
        CopyUntil(statement.begin);
        out_ += uv_lines;
      }
      const std::string_view keyword = Keyword(text_, statement);
      if (keyword == "vt") {
        CopyUntil(statement.begin);
        copied_ = statement.next;
      } else if (IsObjFace(keyword)) {
        WriteFace(statement);
      } else if (MayReferToUv(keyword)) {
        RewriteCorners(statement, false);
      } else if (keyword == "mtllib" && !materials_.library.empty()) {
        CopyUntil(statement.begin);
        if (!has_library_) out_.append("mtllib ").append(materials_.library).append(LineEnd(text_));
        has_library_ = true;
        copied_ = statement.next;
      } else if (keyword == "usemtl" && !materials_.of_polygon.empty()) {
        CopyUntil(statement.begin);
        copied_ = statement.next;
      }
    }
    CopyUntil(text_.size());
    return std::move(out_);
  }

 private:
  void CopyUntil(std::size_t offset) {
    out_ += text_.substr(copied_, offset - copied_);
    copied_ = offset;
  }

  void WriteFace(const ObjStatement& statement) {
    const std::int64_t polygon = next_polygon_++;
    if (!materials_.of_polygon.empty()) {
      const std::string& name = materials_.of_polygon[static_cast<std::size_t>(polygon)];
      if (name != material_) {
        CopyUntil(statement.begin);
        out_.append("usemtl ").append(name).append(LineEnd(text_));
        material_ = name;
      }
    }
    if (next_torn_ < torn_.size() && torn_[next_torn_].polygon == polygon) {
      WriteParts(statement, torn_[next_torn_++]);
    } else {
      RewriteCorners(statement, true);
    }
  }

  // Writes a statement for each part of a torn polygon.
  void WriteParts(const ObjStatement& statement, const TornPolygon& torn) {
    CopyUntil(statement.begin);
    std::vector<ObjCorner> corners;
    ObjTokens tokens(text_, statement);
    std::string_view token;
    tokens.Next(&token);
    while (tokens.Next(&token)) corners.push_back(SplitObjCorner(token));
    const std::string_view line_end = LineEnd(text_);
    for (const std::vector<std::int64_t>& face : torn.faces) {
      out_ += 'f';
      for (const std::int64_t c : face) {
        const ObjCorner& corner = corners[static_cast<std::size_t>(c - mesh_.polygon_begin[torn.polygon])];
        out_.append(" ").append(corner.vertex).append("/");
        AppendShortest(uv_.IndexOfCorner(next_corner_++), &out_);
        out_ += corner.after;
      }
      out_ += line_end;
    }
    copied_ = statement.next;
  }

  // Gives the corners of a face their new vt. Removes the vt from the corners of any other element.
  void RewriteCorners(const ObjStatement& statement, bool is_face) {
    ObjTokens tokens(text_, statement);
    std::string_view token;
    tokens.Next(&token);
    while (tokens.Next(&token)) {
      const ObjCorner corner = SplitObjCorner(token);
      if (!is_face && corner.texture.empty()) continue;
      CopyUntil(static_cast<std::size_t>(corner.vertex.data() - text_.data()) + corner.vertex.size());
      if (is_face) {
        out_ += '/';
        AppendShortest(uv_.IndexOfCorner(next_corner_++), &out_);
      } else if (corner.after.size() > 1) {
        out_ += '/';
      }
      const bool keep_after = is_face || corner.after.size() > 1;
      const std::size_t token_end = static_cast<std::size_t>(token.data() - text_.data()) + token.size();
      copied_ = keep_after ? token_end - corner.after.size() : token_end;
    }
  }

  std::string_view text_;
  const UvTable& uv_;
  const std::vector<TornPolygon>& torn_;
  const PolygonMesh& mesh_;
  const ObjMaterialEdit& materials_;
  bool has_library_ = false;
  std::string material_;  // the last usemtl written for a polygon
  std::string out_;
  std::size_t copied_ = 0;  // text_ before this offset is copied or dropped
  std::int64_t next_corner_ = 0;
  std::int64_t next_polygon_ = 0;
  std::size_t next_torn_ = 0;
};

// Appends the shortest digits that read back to the same float, or to the same double if a coordinate is no float.
void AppendPosition(const Vec3& position, std::string* text) {
  for (const double value : {position.x(), position.y(), position.z()}) {
    *text += ' ';
    const float rounded = static_cast<float>(value);
    const bool is_float = double{rounded} == value || value != value;
    is_float ? AppendShortest(rounded, text) : AppendShortest(value, text);
  }
}

// Writes "o" and "usemtl" before a polygon where they change. OBJ cannot end a material: polygons without one that
// follow others get a material called "none".
class SectionLines {
 public:
  explicit SectionLines(const PolygonMesh& mesh) : mesh_(mesh) {}

  void Append(std::int64_t polygon, std::string* text) {
    AppendOne("o", mesh_.polygon_group, mesh_.group_names, polygon, &group_, text);
    AppendOne("usemtl", mesh_.polygon_material, mesh_.material_names, polygon, &material_, text);
  }

 private:
  static void AppendOne(const char* keyword, const std::vector<std::int32_t>& ids,
                        const std::vector<std::string>& names, std::int64_t polygon, std::int32_t* current,
                        std::string* text) {
    if (ids.empty() || ids[polygon] == *current) return;
    *current = ids[polygon];
    *text += keyword;
    // Replaces some characters: a line end in a name would begin another statement.
    std::string name = *current < 0 ? "none" : names[*current];
    for (char& c : name) c = static_cast<unsigned char>(c) < ' ' || c == '#' || c == '\\' ? '_' : c;
    *text += " " + name + "\n";
  }

  const PolygonMesh& mesh_;
  std::int32_t group_ = -1;
  std::int32_t material_ = -1;
};

std::string ObjOf(const PolygonMesh& mesh, const UvTable& uv) {
  std::string text;
  text.reserve(mesh.positions.size() * 40 + mesh.corner_vertex.size() * 18);
  for (const Vec3& position : mesh.positions) {
    text += 'v';
    AppendPosition(position, &text);
    text += '\n';
  }
  text += uv.Lines("\n");
  SectionLines sections(mesh);
  for (std::int64_t polygon = 0; polygon < mesh.num_polygons(); ++polygon) {
    sections.Append(polygon, &text);
    text += 'f';
    for (std::int64_t corner = mesh.polygon_begin[polygon]; corner < mesh.polygon_begin[polygon + 1]; ++corner) {
      text += ' ';
      AppendShortest(std::int64_t{mesh.corner_vertex[corner]} + 1, &text);
      text += '/';
      AppendShortest(uv.IndexOfCorner(corner), &text);
    }
    text += '\n';
  }
  return text;
}

}  // namespace

std::string WriteObj(const MeshFile& file, const WrittenPolygons& written, bool uv_is_float,
                     const ObjMaterialEdit& materials) {
  const UvTable uv(written.mesh, written.corner_uv, uv_is_float);
  return ObjWriter(file.bytes, uv, written.torn, file.mesh, materials).Write();
}

std::string PlainObj(const PolygonMesh& mesh, const std::vector<double>& corner_uv, bool uv_is_float) {
  return ObjOf(mesh, UvTable(mesh, corner_uv, uv_is_float));
}

std::string WriteObjWithUv(const MeshFile& file, const std::vector<double>& corner_uv, bool uv_is_float) {
  assert(corner_uv.size() == 2 * file.mesh.corner_vertex.size());
  if (file.format != MeshFormat::kObj) return PlainObj(file.mesh, corner_uv, uv_is_float);
  return WriteObj(file, {file.mesh, corner_uv, {}}, uv_is_float);
}

}  // namespace planish
