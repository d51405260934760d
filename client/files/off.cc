// Reads and writes OFF files.
#include <algorithm>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/file_io.h"
#include "client/files/polygon_mesh.h"
#include "client/files/readers.h"
#include "client/files/seam_copies.h"
#include "client/files/text_cursor.h"
#include "client/files/writers.h"
#include "core/base/corner_split.h"
#include "core/base/number.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

struct OffKeyword {
  std::string_view token;   // "OFF", "STCOFF", ...; empty if missing, when the counts come first
  std::size_t letters = 0;  // length without a byte order mark
  bool has_uv = false;      // "ST": each vertex ends with two texture coordinates
};

// Accepts OFF and its variants with colours, normals and texture coordinates, all of which follow x y z on a line.
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

// The lines of a text, without their ends.
std::vector<std::string_view> LinesOf(std::string_view text) {
  std::vector<std::string_view> lines;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of("\r\n"), text.size());
    lines.push_back(text.substr(0, end));
    text.remove_prefix(end + (text.substr(end, 2) == "\r\n" ? 2 : end < text.size() ? 1 : 0));
  }
  return lines;
}

// Whether the line is a comment that planish wrote (seam_copies.h).
bool IsMarkLine(std::string_view line) {
  return line.starts_with("#") && IsSeamMark(line.substr(1));
}

absl::Status ReadCount(TextCursor& cursor, const char* kind, std::int64_t* count) {
  const std::string_view token = cursor.Token();
  if (!ParseInt(token, count)) {
    return cursor.Fault(std::string("number of ") + kind + ": " + Quoted(token) + " is not a whole number");
  }
  if (*count < 0 || *count > INT32_MAX) {
    return cursor.Fault(std::string("number of ") + kind + ": " + std::to_string(*count) + " is out of range");
  }
  // Every element takes at least two bytes, so a wrong count is found before memory is allocated.
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

absl::StatusOr<PolygonMesh> ReadOff(const std::string& path, std::string_view text) {
  if (text.empty()) return FileMalformed(path, 0, "the file is empty");
  TextCursor cursor(path, text, 1, true);
  PLANISH_ASSIGN_OR_RETURN(const OffKeyword keyword, ReadOffKeyword(cursor));
  std::vector<std::string_view> marks;
  for (const std::string_view line :
       LinesOf(text.substr(0, static_cast<std::size_t>(cursor.Peek().data() - text.data())))) {
    if (IsMarkLine(line)) marks.push_back(line.substr(1));
  }
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
  JoinSeamVertices(marks, &mesh);
  return mesh;
}

namespace {

void AppendReal(double value, bool is_float, std::string* text) {
  *text += ' ';
  is_float ? AppendShortest(static_cast<float>(value), text) : AppendShortest(value, text);
}

// Appends a blank and a number of a UV, with the digits that WriteObjWithUv() describes.
void AppendUv(double value, bool is_float, std::string* text) {
  AppendReal(is_float ? double{static_cast<float>(value)} : value, /*is_float=*/false, text);
}

// Edits the text from left to right; copies everything that is not replaced.
class TextEditor {
 public:
  explicit TextEditor(std::string_view text) : text_(text) {}

  void CopyUntil(std::size_t offset) {
    out_ += text_.substr(done_, offset - done_);
    done_ = offset;
  }
  void Skip(std::size_t offset) { done_ = offset; }
  // Skips a line end, if there is one here.
  void SkipLineEnd() {
    const std::string_view rest = text_.substr(done_);
    done_ += rest.starts_with("\r\n") ? 2 : rest.starts_with("\n") || rest.starts_with("\r") ? 1 : 0;
  }
  void Insert(std::string_view text) { out_ += text; }
  void Replace(std::string_view token, std::string_view text) {
    const std::size_t begin = OffsetOf(token);
    CopyUntil(begin);
    out_ += text;
    done_ = begin + token.size();
  }
  std::size_t OffsetOf(std::string_view token) const { return static_cast<std::size_t>(token.data() - text_.data()); }
  std::size_t done() const { return done_; }
  std::string& out() { return out_; }

 private:
  std::string_view text_;
  std::string out_;
  std::size_t done_ = 0;  // text before this offset is copied or dropped
};

class OffWriter {
 public:
  OffWriter(const MeshFile& file, const WrittenPolygons& written, const CornerSplit& split, bool uv_is_float)
      : file_(file),
        written_(written),
        split_(split),
        uv_is_float_(uv_is_float),
        cursor_(file.path, file.bytes, 1, true),
        edit_(file.bytes) {}

  absl::StatusOr<std::string> Write() {
    PLANISH_ASSIGN_OR_RETURN(const OffKeyword keyword, ReadOffKeyword(cursor_));
    had_uv_ = keyword.has_uv;
    if (keyword.token.empty()) {
      edit_.CopyUntil(edit_.OffsetOf(cursor_.Peek()));
      edit_.Insert("STOFF\n");
    } else if (!had_uv_) {
      // The token may begin with a byte order mark, which stays before "ST".
      const std::size_t letters = keyword.token.size() - keyword.letters;
      edit_.Replace(keyword.token.substr(letters, 0), "ST");
    }
    const std::string_view count = cursor_.Token();
    std::int64_t old_vertices = 0;
    ParseInt(count, &old_vertices);
    WriteMarks(count);
    edit_.Replace(count, std::to_string(split_.num_vertices()));
    const std::string_view faces = cursor_.Token();
    if (!written_.torn.empty()) edit_.Replace(faces, std::to_string(written_.mesh.num_polygons()));
    cursor_.SkipLine();
    WriteVertices(static_cast<std::size_t>(old_vertices));
    std::size_t corner = 0;
    auto torn = written_.torn.begin();
    for (std::int64_t p = 0; p < file_.mesh.num_polygons(); ++p) {
      if (torn != written_.torn.end() && torn->polygon == p) {
        WriteParts(*torn++, &corner);
        continue;
      }
      cursor_.Token();
      for (std::int64_t c = file_.mesh.polygon_begin[p]; c < file_.mesh.polygon_begin[p + 1]; ++c) {
        edit_.Replace(cursor_.Token(), std::to_string(split_.corner[corner++]));
      }
      cursor_.SkipLine();
    }
    edit_.CopyUntil(file_.bytes.size());
    return std::move(edit_.out());
  }

 private:
  // Writes each part with the rest of the polygon's line, such as a colour.
  void WriteParts(const TornPolygon& torn, std::size_t* corner) {
    const std::string_view count = cursor_.Token();
    std::string_view last;
    for (std::int64_t c = file_.mesh.polygon_begin[torn.polygon]; c < file_.mesh.polygon_begin[torn.polygon + 1]; ++c) {
      last = cursor_.Token();
    }
    std::string rest;
    for (const std::string_view token : cursor_.RestOfLine()) {
      rest.append(" ").append(token);
      last = token;
    }
    edit_.CopyUntil(edit_.OffsetOf(count));
    for (std::size_t k = 0; k < torn.faces.size(); ++k) {
      if (k > 0) edit_.Insert("\n");
      edit_.Insert(std::to_string(torn.faces[k].size()));
      for (std::size_t c = 0; c < torn.faces[k].size(); ++c) {
        edit_.Insert(" ");
        edit_.Insert(std::to_string(split_.corner[(*corner)++]));
      }
      edit_.Insert(rest);
    }
    edit_.Skip(edit_.OffsetOf(last) + last.size());
    cursor_.SkipLine();
  }

  // Removes the old seam marks, and writes new ones before the number of vertices, `count`.
  void WriteMarks(std::string_view count) {
    const std::size_t end = edit_.OffsetOf(count);
    const std::string_view before = std::string_view(file_.bytes).substr(edit_.done(), end - edit_.done());
    for (const std::string_view line : LinesOf(before)) {
      if (!IsMarkLine(line)) continue;
      edit_.CopyUntil(edit_.OffsetOf(line));
      edit_.Skip(edit_.OffsetOf(line) + line.size());
      edit_.SkipLineEnd();
    }
    edit_.CopyUntil(end);
    const std::vector<std::string> marks = SeamMarks(file_.mesh, split_);
    if (marks.empty()) return;
    if (!edit_.out().empty() && edit_.out().back() != '\n' && edit_.out().back() != '\r') edit_.Insert("\n");
    for (const std::string& mark : marks) edit_.Insert("# " + mark + "\n");
  }

  // Writes the vertices with UV. The file has `old_count` vertices; the last ones may be copies, which are left out.
  void WriteVertices(std::size_t old_count) {
    const std::size_t count = file_.mesh.positions.size();
    std::vector<std::string> old(count);
    std::size_t line_end = 0;
    for (std::size_t v = 0; v < count; ++v) {
      std::vector<std::string_view> tokens;
      for (int axis = 0; axis < 3; ++axis) tokens.push_back(cursor_.Token());
      for (const std::string_view token : cursor_.RestOfLine()) tokens.push_back(token);
      if (had_uv_ && tokens.size() >= 5) {
        edit_.CopyUntil(edit_.OffsetOf(tokens[tokens.size() - 3]) + tokens[tokens.size() - 3].size());
        edit_.Skip(edit_.OffsetOf(tokens.back()) + tokens.back().size());
        tokens.resize(tokens.size() - 2);
      } else {
        edit_.CopyUntil(edit_.OffsetOf(tokens.back()) + tokens.back().size());
      }
      edit_.Insert(Uv(v));
      for (const std::string_view token : tokens) old[v].append(old[v].empty() ? "" : " ").append(token);
      cursor_.SkipLine();
      line_end = file_.bytes.size() - static_cast<std::size_t>(cursor_.remaining());
    }
    if (count == split_.source.size() && count == old_count) return;
    edit_.CopyUntil(line_end);
    for (std::size_t v = count; v < old_count; ++v) {
      for (int axis = 0; axis < 3; ++axis) cursor_.Token();
      cursor_.SkipLine();
      edit_.Skip(file_.bytes.size() - static_cast<std::size_t>(cursor_.remaining()));
    }
    for (std::size_t v = count; v < split_.source.size(); ++v) {
      edit_.Insert("\n" + old[static_cast<std::size_t>(split_.source[v])] + Uv(v));
    }
  }

  std::string Uv(std::size_t vertex) const {
    std::string text;
    AppendUv(split_.uv[2 * vertex], uv_is_float_, &text);
    AppendUv(split_.uv[2 * vertex + 1], uv_is_float_, &text);
    return text;
  }

  const MeshFile& file_;
  const WrittenPolygons& written_;
  const CornerSplit& split_;
  const bool uv_is_float_;
  bool had_uv_ = false;
  TextCursor cursor_;
  TextEditor edit_;
};

}  // namespace

absl::StatusOr<std::string> WriteOff(const MeshFile& file, const WrittenPolygons& written, bool uv_is_float) {
  const CornerSplit split = SplitForFile(written.mesh, written.corner_uv);
  return OffWriter(file, written, split, uv_is_float).Write();
}

std::string PlainOff(const PolygonMesh& mesh, const std::vector<double>& corner_uv, bool uv_is_float) {
  const CornerSplit split = SplitForFile(mesh, corner_uv);
  std::string text = "STOFF\n";
  for (const std::string& mark : SeamMarks(mesh, split)) text += "# " + mark + "\n";
  text += std::to_string(split.num_vertices()) + " " + std::to_string(mesh.num_polygons()) + " 0\n";
  for (std::size_t v = 0; v < split.source.size(); ++v) {
    std::string line;
    for (const double value : mesh.positions[split.source[v]]) {
      AppendReal(value, value != value || double{static_cast<float>(value)} == value, &line);
    }
    for (const std::size_t k : {2 * v, 2 * v + 1}) AppendUv(split.uv[k], uv_is_float, &line);
    text += line.substr(1) + "\n";
  }
  for (std::int64_t p = 0; p < mesh.num_polygons(); ++p) {
    text += std::to_string(mesh.polygon_begin[p + 1] - mesh.polygon_begin[p]);
    for (std::int64_t c = mesh.polygon_begin[p]; c < mesh.polygon_begin[p + 1]; ++c) {
      text.append(" ").append(std::to_string(split.corner[static_cast<std::size_t>(c)]));
    }
    text += "\n";
  }
  return text;
}

}  // namespace planish
