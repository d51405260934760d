#include <limits>
#include <map>

#include "client/files/file_io.h"
#include "client/files/obj_scanner.h"
#include "client/files/polygon_mesh.h"
#include "client/files/readers.h"
#include "core/base/number.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

constexpr std::int64_t kMaxIndex = std::numeric_limits<std::int32_t>::max();

// Collects, for each polygon, the name that applies to it: of a material, of an object, or of an object and group.
class Sections {
 public:
  void Enter(const std::string& name) {
    current_ = ids_.emplace(name, static_cast<std::int32_t>(names_.size())).first->second;
    if (current_ == static_cast<std::int32_t>(names_.size())) names_.push_back(name);
  }
  void AddPolygon() { of_polygon_.push_back(current_); }
  // Leaves *of_polygon and *names empty if there was no section.
  void MoveTo(std::vector<std::int32_t>* of_polygon, std::vector<std::string>* names) {
    if (names_.empty()) return;
    *of_polygon = std::move(of_polygon_);
    *names = std::move(names_);
  }

 private:
  std::map<std::string, std::int32_t> ids_;
  std::vector<std::string> names_;
  std::int32_t current_ = -1;
  std::vector<std::int32_t> of_polygon_;
};

class ObjReader {
 public:
  ObjReader(const std::string& path, std::string_view text) : path_(path), text_(text) {}

  absl::StatusOr<PolygonMesh> Read() {
    PLANISH_RETURN_IF_ERROR(CheckIsText());
    ObjScanner scanner(text_);
    while (scanner.Next(&statement_)) {
      ObjTokens tokens(text_, statement_);
      std::string_view keyword;
      if (!tokens.Next(&keyword)) continue;
      if (keyword == "v") {
        PLANISH_RETURN_IF_ERROR(ReadVertex(tokens));
      } else if (keyword == "vt") {
        PLANISH_RETURN_IF_ERROR(ReadTexcoord(tokens));
      } else if (IsObjFace(keyword)) {
        PLANISH_RETURN_IF_ERROR(ReadFace(tokens));
      } else if (keyword == "usemtl") {
        materials_.Enter(RestOf(tokens));
      } else if (keyword == "o") {
        object_ = RestOf(tokens);
        objects_.Enter(object_);
        groups_.Enter(object_);
      } else if (keyword == "g") {
        const std::string group = RestOf(tokens);
        groups_.Enter(object_.empty() || group.empty() ? object_ + group : object_ + " " + group);
      }
    }
    PLANISH_RETURN_IF_ERROR(CheckForwardReferences());
    FinishTexcoords();
    materials_.MoveTo(&mesh_.polygon_material, &mesh_.material_names);
    objects_.MoveTo(&mesh_.polygon_object, &mesh_.object_names);
    groups_.MoveTo(&mesh_.polygon_group, &mesh_.group_names);
    if (mesh_.num_polygons() == 0) {
      return FileMalformed(path_, 0, text_.empty() ? "the file is empty" : "no faces: an OBJ mesh needs \"f\" lines");
    }
    return std::move(mesh_);
  }

 private:
  absl::Status Fault(const std::string& message) const { return FileMalformed(path_, statement_.line, message); }

  absl::Status CheckIsText() const {
    const std::string_view mark = text_.substr(0, 2);
    if (mark == "\xFF\xFE" || mark == "\xFE\xFF") {
      return FileMalformed(path_, 1, "this is UTF-16 text; save it as UTF-8 or ASCII");
    }
    const std::size_t nul = text_.find('\0');
    if (nul == std::string_view::npos) return absl::OkStatus();
    std::int64_t line = 1;
    for (const char c : text_.substr(0, nul)) line += c == '\n';
    return FileMalformed(path_, line,
                         "a NUL byte at offset " + std::to_string(nul) +
                             ": this is a binary file or UTF-16 text, not an OBJ (which is UTF-8 or ASCII)");
  }

  absl::Status ReadVertex(ObjTokens& tokens) {
    Vec3 position;
    for (int axis = 0; axis < 3; ++axis) {
      std::string_view token;
      if (!tokens.Next(&token)) {
        return Fault("a vertex needs three coordinates, this one has " + std::to_string(axis));
      }
      if (!ParseDouble(token, &position[axis])) return Fault("coordinate " + Quoted(token) + " is not a number");
    }
    if (static_cast<std::int64_t>(mesh_.positions.size()) >= kMaxIndex) return Fault("more than 2147483647 vertices");
    mesh_.positions.push_back(position);
    mesh_.vertex_line.push_back(statement_.line);
    return absl::OkStatus();
  }

  // "vt u [v [w]]"
  absl::Status ReadTexcoord(ObjTokens& tokens) {
    double uv[2] = {0, 0};
    for (int axis = 0; axis < 2; ++axis) {
      std::string_view token;
      if (!tokens.Next(&token)) {
        if (axis == 0) return Fault("a texture coordinate needs a number");
        break;
      }
      if (!ParseDouble(token, &uv[axis])) return Fault("texture coordinate " + Quoted(token) + " is not a number");
    }
    if (static_cast<std::int64_t>(texcoord_of_line_.size()) >= kMaxIndex) {
      return Fault("more than 2147483647 texture coordinates");
    }
    texcoord_of_line_.push_back(texcoords_.Add(uv[0], uv[1]));
    return absl::OkStatus();
  }

  // The rest of the statement with single blanks, since names may have blanks.
  static std::string RestOf(ObjTokens& tokens) {
    std::string text;
    std::string_view token;
    while (tokens.Next(&token)) {
      if (!text.empty()) text += ' ';
      text += token;
    }
    return text;
  }

  // Adds the vt of a corner, still as the number of its statement, which may come after the face. FinishTexcoords()
  // replaces these numbers.
  void AddTexcoord(std::string_view texture) {
    std::int64_t index = 0;
    ParseInt(texture, &index);
    if (index < 0) index += static_cast<std::int64_t>(texcoord_of_line_.size()) + 1;
    mesh_.corner_texcoord.push_back(index > 0 && index <= kMaxIndex ? static_cast<std::int32_t>(index - 1) : kNoId);
  }

  void FinishTexcoords() {
    const std::int64_t count = static_cast<std::int64_t>(texcoord_of_line_.size());
    bool any = false;
    for (std::int32_t& id : mesh_.corner_texcoord) {
      id = id >= 0 && id < count ? texcoord_of_line_[id] : kNoId;
      any |= id != kNoId;
    }
    if (!any) mesh_.corner_texcoord.clear();
    if (any) mesh_.texcoords = texcoords_.TakeValues();
  }

  absl::Status ReadFace(ObjTokens& tokens) {
    std::string_view token;
    while (tokens.Next(&token)) {
      const ObjCorner corner = SplitObjCorner(token);
      std::int64_t index = 0;
      if (!ParseInt(corner.vertex, &index) || !IsIndexOrNone(corner.texture) ||
          !IsIndexOrNone(corner.after.substr(corner.after.empty() ? 0 : 1))) {
        return Fault("face corner " + Quoted(token) + " is not v, v/vt, v//vn or v/vt/vn with whole numbers");
      }
      const std::int64_t count = static_cast<std::int64_t>(mesh_.positions.size());
      if (index == 0) return Fault("face corner " + Quoted(token) + ": vertices are numbered from 1, there is no 0");
      if (index < -count || index > kMaxIndex) return OutOfRange(index, count);
      const std::int64_t vertex = index > 0 ? index - 1 : count + index;
      largest_vertex_ = std::max(largest_vertex_, vertex);
      mesh_.corner_vertex.push_back(static_cast<std::int32_t>(vertex));
      AddTexcoord(corner.texture);
    }
    const std::int64_t end = static_cast<std::int64_t>(mesh_.corner_vertex.size());
    const std::int64_t corners = end - mesh_.polygon_begin.back();
    if (corners < 3) return Fault("a face needs at least three corners, this one has " + std::to_string(corners));
    mesh_.polygon_begin.push_back(end);
    mesh_.polygon_line.push_back(statement_.line);
    materials_.AddPolygon();
    objects_.AddPolygon();
    groups_.AddPolygon();
    return absl::OkStatus();
  }

  static bool IsIndexOrNone(std::string_view token) {
    std::int64_t ignored = 0;
    return token.empty() || ParseInt(token, &ignored);
  }

  absl::Status OutOfRange(std::int64_t index, std::int64_t count) const {
    return Fault(
        "the face refers to vertex " + std::to_string(index) + ", but " +
        (index < 0 ? "only " + std::to_string(count) + " come before it" : "the file has " + std::to_string(count)));
  }

  // Faces may come before their vertices, so this is checked at the end of the file.
  absl::Status CheckForwardReferences() {
    const std::int64_t count = static_cast<std::int64_t>(mesh_.positions.size());
    if (largest_vertex_ < count) return absl::OkStatus();
    for (std::int64_t polygon = 0; polygon < mesh_.num_polygons(); ++polygon) {
      for (std::int64_t c = mesh_.polygon_begin[polygon]; c < mesh_.polygon_begin[polygon + 1]; ++c) {
        if (mesh_.corner_vertex[c] < count) continue;
        statement_.line = mesh_.polygon_line[polygon];
        return OutOfRange(std::int64_t{mesh_.corner_vertex[c]} + 1, count);
      }
    }
    return absl::OkStatus();
  }

  const std::string& path_;
  std::string_view text_;
  ObjStatement statement_;
  std::int64_t largest_vertex_ = -1;
  TexcoordTable texcoords_;
  std::vector<std::int32_t> texcoord_of_line_;  // per vt statement
  std::string object_;
  Sections materials_;
  Sections objects_;
  Sections groups_;
  PolygonMesh mesh_;
};

}  // namespace

absl::StatusOr<PolygonMesh> ReadObj(const std::string& path, std::string_view text) {
  return ObjReader(path, text).Read();
}

}  // namespace planish
