#include "core/base/status_macros.h"
#include "core/io/number.h"
#include "core/io/off_header.h"
#include "core/io/text_cursor.h"
#include "core/io/vertex_split.h"
#include "core/io/writers.h"

namespace planish {
namespace {

void AppendReal(double value, bool is_float, std::string* text) {
  *text += ' ';
  is_float ? AppendShortest(static_cast<float>(value), text) : AppendShortest(value, text);
}

// Rewrites the text from left to right: what is not replaced is copied.
class TextEditor {
 public:
  explicit TextEditor(std::string_view text) : text_(text) {}

  void CopyUntil(std::size_t offset) {
    out_ += text_.substr(done_, offset - done_);
    done_ = offset;
  }
  void Skip(std::size_t offset) { done_ = offset; }
  void Insert(std::string_view text) { out_ += text; }
  void Replace(std::string_view token, std::string_view text) {
    const std::size_t begin = OffsetOf(token);
    CopyUntil(begin);
    out_ += text;
    done_ = begin + token.size();
  }
  std::size_t OffsetOf(std::string_view token) const { return static_cast<std::size_t>(token.data() - text_.data()); }
  std::string& out() { return out_; }

 private:
  std::string_view text_;
  std::string out_;
  std::size_t done_ = 0;  // text before this offset is in out_, or dropped
};

class OffWriter {
 public:
  OffWriter(const MeshFile& file, const CornerSplit& split, bool uv_is_float)
      : file_(file),
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
      // Behind a byte order mark that the token may begin with.
      const std::size_t letters = keyword.token.size() - keyword.letters;
      edit_.Replace(keyword.token.substr(letters, 0), "ST");
    }
    edit_.Replace(cursor_.Token(), std::to_string(split_.num_vertices()));
    cursor_.Token();
    cursor_.SkipLine();
    WriteVertices();
    std::size_t corner = 0;
    for (std::int64_t p = 0; p < file_.mesh.num_polygons(); ++p) {
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
  void WriteVertices() {
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
      for (const std::string_view token : tokens) old[v] += (old[v].empty() ? "" : " ") + std::string(token);
      cursor_.SkipLine();
      line_end = file_.bytes.size() - static_cast<std::size_t>(cursor_.remaining());
    }
    if (count == split_.source.size()) return;
    edit_.CopyUntil(line_end);
    for (std::size_t v = count; v < split_.source.size(); ++v) {
      edit_.Insert("\n" + old[static_cast<std::size_t>(split_.source[v])] + Uv(v));
    }
  }

  std::string Uv(std::size_t vertex) const {
    std::string text;
    AppendReal(split_.uv[2 * vertex], uv_is_float_, &text);
    AppendReal(split_.uv[2 * vertex + 1], uv_is_float_, &text);
    return text;
  }

  const MeshFile& file_;
  const CornerSplit& split_;
  const bool uv_is_float_;
  bool had_uv_ = false;
  TextCursor cursor_;
  TextEditor edit_;
};

}  // namespace

absl::StatusOr<std::string> WriteOff(const MeshFile& file, const std::vector<double>& corner_uv, bool uv_is_float) {
  const CornerSplit split =
      SplitCorners(static_cast<std::int64_t>(file.mesh.positions.size()), file.mesh.corner_vertex, corner_uv);
  return OffWriter(file, split, uv_is_float).Write();
}

std::string PlainOff(const PolygonMesh& mesh, const std::vector<double>& corner_uv, bool uv_is_float) {
  const CornerSplit split =
      SplitCorners(static_cast<std::int64_t>(mesh.positions.size()), mesh.corner_vertex, corner_uv);
  std::string text =
      "STOFF\n" + std::to_string(split.num_vertices()) + " " + std::to_string(mesh.num_polygons()) + " 0\n";
  for (std::size_t v = 0; v < split.source.size(); ++v) {
    std::string line;
    for (const double value : mesh.positions[split.source[v]]) {
      AppendReal(value, value != value || double{static_cast<float>(value)} == value, &line);
    }
    for (const std::size_t k : {2 * v, 2 * v + 1}) AppendReal(split.uv[k], uv_is_float, &line);
    text += line.substr(1) + "\n";
  }
  for (std::int64_t p = 0; p < mesh.num_polygons(); ++p) {
    text += std::to_string(mesh.polygon_begin[p + 1] - mesh.polygon_begin[p]);
    for (std::int64_t c = mesh.polygon_begin[p]; c < mesh.polygon_begin[p + 1]; ++c) {
      text += " " + std::to_string(split.corner[static_cast<std::size_t>(c)]);
    }
    text += "\n";
  }
  return text;
}

}  // namespace planish
