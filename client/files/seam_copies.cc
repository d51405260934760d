#include "client/files/seam_copies.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "core/base/number.h"

namespace planish {
namespace {

// "planish_seam_copies N": the last N vertices are copies. With "joined", vertices at the same position are one.
constexpr std::string_view kCopies = "planish_seam_copies";
constexpr std::string_view kJoined = "joined";
// "planish_copy_of A B ...": the vertices that are copied, in the order of the copies. Lists only copies at a position
// that several of the other vertices have; the source of any other copy follows from its position.
constexpr std::string_view kCopyOf = "planish_copy_of";
constexpr std::size_t kMostIdsOnALine = 16;  // some readers limit lines to 256 characters

std::vector<std::string_view> WordsOf(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::size_t begin = 0; (begin = line.find_first_not_of(" \t\r", begin)) != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(" \t\r", begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    begin = end;
  }
  return words;
}

// Per vertex: the first vertex at its position, and how many of the first `count` vertices are at that position.
class Places {
 public:
  Places(const std::vector<Vec3>& positions, std::size_t count) {
    for (std::size_t v = 0; v < positions.size(); ++v) {
      const auto place = static_cast<std::size_t>(index_.Add(positions[v]));
      if (place == first_.size()) {
        first_.push_back(static_cast<std::int32_t>(v));
        vertices_.push_back(0);
      }
      place_.push_back(place);
      if (v < count) ++vertices_[place];
    }
  }
  std::int32_t FirstAt(std::size_t vertex) const { return first_[place_[vertex]]; }
  std::int32_t VerticesAt(std::size_t vertex) const { return vertices_[place_[vertex]]; }
  bool HasSeveral() const { return first_.size() < place_.size(); }
  bool AreTogether(std::size_t a, std::size_t b) const { return place_[a] == place_[b]; }

 private:
  ValueIndex index_;
  std::vector<std::size_t> place_;              // per vertex
  std::vector<std::int32_t> first_, vertices_;  // per place
};

struct Marks {
  std::int64_t copies = 0;
  bool joined = false;
  std::vector<std::int64_t> copy_of;
};

std::optional<Marks> ParseMarks(const std::vector<std::string_view>& lines) {
  std::optional<Marks> marks;
  for (const std::string_view line : lines) {
    const std::vector<std::string_view> words = WordsOf(line);
    if (words[0] == kCopies && !marks && words.size() >= 2) {
      marks.emplace();
      marks->joined = words.size() == 3 && words[2] == kJoined;
      if (!ParseInt(words[1], &marks->copies) || (words.size() > 2 && !marks->joined)) return std::nullopt;
    } else if (words[0] == kCopyOf && marks) {
      for (std::size_t i = 1; i < words.size(); ++i) {
        if (!ParseInt(words[i], &marks->copy_of.emplace_back())) return std::nullopt;
      }
    } else {
      return std::nullopt;
    }
  }
  return marks;
}

// Per copy at the end of `positions`, the vertex that it copies; nullopt if the marks do not match the vertices.
std::optional<std::vector<std::int32_t>> SourcesOf(const Marks& marks, const std::vector<Vec3>& positions) {
  const auto count = static_cast<std::int64_t>(positions.size());
  if (marks.copies < 0 || marks.copies >= count) return std::nullopt;
  const auto base = static_cast<std::size_t>(count - marks.copies);
  const Places places(positions, base);
  std::vector<std::int32_t> sources;
  auto next = marks.copy_of.begin();
  for (std::size_t v = base; v < positions.size(); ++v) {
    std::int64_t source = places.FirstAt(v);
    if (places.VerticesAt(v) == 0) return std::nullopt;
    if (places.VerticesAt(v) > 1) {
      if (next == marks.copy_of.end()) return std::nullopt;
      source = *next++;
      if (source < 0 || source >= static_cast<std::int64_t>(base)) return std::nullopt;
      if (!places.AreTogether(static_cast<std::size_t>(source), v)) return std::nullopt;
    }
    sources.push_back(static_cast<std::int32_t>(source));
  }
  if (next != marks.copy_of.end()) return std::nullopt;
  return sources;
}

}  // namespace

void JoinSeamVertices(const std::vector<std::string_view>& marks, PolygonMesh* mesh) {
  const std::optional<Marks> told = ParseMarks(marks);
  std::optional<std::vector<std::int32_t>> sources;
  if (told) sources = SourcesOf(*told, mesh->positions);
  if (sources) {
    const std::size_t base = mesh->positions.size() - sources->size();
    for (std::int32_t& vertex : mesh->corner_vertex) {
      const auto v = static_cast<std::size_t>(vertex);
      if (v >= base) vertex = (*sources)[v - base];
    }
    mesh->positions.resize(base);
    if (!mesh->vertex_line.empty()) mesh->vertex_line.resize(base);
    if (!told->joined) return;
  }
  const Places places(mesh->positions, mesh->positions.size());
  std::vector<std::int32_t> joined;
  for (const std::int32_t vertex : mesh->corner_vertex)
    joined.push_back(places.FirstAt(static_cast<std::size_t>(vertex)));
  if (joined == mesh->corner_vertex) return;
  mesh->corner_file_vertex = std::exchange(mesh->corner_vertex, std::move(joined));
}

bool IsSeamMark(std::string_view comment) {
  const std::vector<std::string_view> words = WordsOf(comment);
  return !words.empty() && (words[0] == kCopies || words[0] == kCopyOf);
}

CornerSplit SplitForFile(const PolygonMesh& mesh, const std::vector<double>& corner_uv) {
  return SplitCorners(static_cast<std::int64_t>(mesh.positions.size()),
                      mesh.corner_file_vertex.empty() ? mesh.corner_vertex : mesh.corner_file_vertex, corner_uv);
}

std::vector<std::string> SeamMarks(const PolygonMesh& mesh, const CornerSplit& split) {
  const std::size_t base = mesh.positions.size();
  std::string first(kCopies);
  first += " " + std::to_string(split.source.size() - base);
  if (!mesh.corner_file_vertex.empty()) first.append(" ").append(kJoined);
  std::vector<std::string> marks = {first};
  const Places places(mesh.positions, base);
  const bool is_plain = split.source.size() == base && mesh.corner_file_vertex.empty() && !places.HasSeveral();
  if (is_plain) return {};
  std::size_t ids = 0;
  for (std::size_t v = base; v < split.source.size(); ++v) {
    const std::int32_t source = split.source[v];
    if (places.VerticesAt(static_cast<std::size_t>(source)) < 2) continue;
    if (ids++ % kMostIdsOnALine == 0) marks.emplace_back(kCopyOf);
    marks.back() += " " + std::to_string(source);
  }
  return marks;
}

}  // namespace planish
