#include "tests/bench/bench_meshes.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <numbers>
#include <random>
#include <unordered_map>
#include <utility>

#include "client/files/mesh_file.h"
#include "client/files/uv_islands.h"
#include "tests/testing/families.h"

namespace planish::bench {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kJitter = 0.25;  // of a cell

using Surface = std::function<Vec3(double, double)>;

// Numbers in [-1, 1), the same on every machine.
class Noise {
 public:
  double operator()() { return random_() / 2147483648.0 - 1; }

 private:
  std::mt19937 random_{20040711};
};

// The first `triangles` faces, and the vertices that these use. Both makers list their faces such that the last ones
// can go one by one and leave a disc.
Mesh Shorten(Mesh mesh, std::int64_t triangles) {
  mesh.faces.resize(static_cast<std::size_t>(triangles));
  std::vector<std::int32_t> number(mesh.positions.size(), -1);
  std::vector<Vec3> used;
  for (Face& face : mesh.faces) {
    for (std::int32_t& v : face) {
      if (number[v] < 0) {
        number[v] = static_cast<std::int32_t>(used.size());
        used.push_back(mesh.positions[v]);
      }
      v = number[v];
    }
  }
  mesh.positions = std::move(used);
  return mesh;
}

// f over [0, 1]^2, about `aspect` as long along s as along t.
Mesh MakePatch(std::int64_t triangles, double aspect, const Surface& f) {
  const double cells = 0.5 * static_cast<double>(triangles);
  const auto rows = static_cast<std::int32_t>(std::lround(std::sqrt(cells / aspect)));
  const auto columns = static_cast<std::int32_t>((triangles + 2 * rows - 1) / (2 * rows));
  Noise noise;
  Mesh mesh;
  for (std::int32_t i = 0; i <= columns; ++i) {
    for (std::int32_t j = 0; j <= rows; ++j) {
      const bool inside = i > 0 && i < columns && j > 0 && j < rows;
      const double ds = inside ? kJitter * noise() : 0, dt = inside ? kJitter * noise() : 0;
      mesh.positions.push_back(f((i + ds) / columns, (j + dt) / rows));
    }
  }
  const auto distance = [&](std::int32_t a, std::int32_t b) {
    return (mesh.positions[a] - mesh.positions[b]).squaredNorm();
  };
  for (std::int32_t i = 0; i < columns; ++i) {
    for (std::int32_t j = 0; j < rows; ++j) {
      const std::int32_t a = i * (rows + 1) + j, b = a + rows + 1, c = b + 1, d = a + 1;
      if (distance(a, c) <= distance(b, d)) {
        mesh.faces.insert(mesh.faces.end(), {{a, c, d}, {a, b, c}});
      } else {
        mesh.faces.insert(mesh.faces.end(), {{a, b, d}, {b, c, d}});
      }
    }
  }
  return Shorten(std::move(mesh), triangles);
}

// Points per ring of a surface of rings round a tip, and the triangles that they make.
struct Rings {
  std::vector<std::int32_t> points;
  std::int64_t triangles = 0;
};

Rings PlanRings(double length, double cell, const std::function<double(double)>& radius) {
  Rings rings;
  const auto count = std::max<std::int32_t>(3, static_cast<std::int32_t>(std::lround(length / (0.87 * cell))));
  for (std::int32_t k = 1; k <= count; ++k) {
    const double around = 2 * kPi * radius(length * k / count);
    const auto m = std::max<std::int32_t>(5, static_cast<std::int32_t>(std::lround(around / cell)));
    rings.triangles += m + (k > 1 ? rings.points.back() : 0);
    rings.points.push_back(m);
  }
  return rings;
}

// f(s, theta) from a tip at s = 0 to the open end at s = length, in rings of about 2 pi radius(s).
Mesh MakeRings(std::int64_t triangles, double length, const std::function<double(double)>& radius, const Surface& f) {
  double area = 0;
  for (int i = 0; i < 1000; ++i) area += 2 * kPi * radius(length * (i + 0.5) / 1000) * length / 1000;
  double cell = std::sqrt(area / (0.43 * static_cast<double>(triangles)));
  Rings rings = PlanRings(length, cell, radius);
  while (rings.triangles < triangles) {
    cell *= std::min(0.9995, std::sqrt(static_cast<double>(rings.triangles) / static_cast<double>(triangles)));
    rings = PlanRings(length, cell, radius);
  }
  const auto count = static_cast<std::int32_t>(rings.points.size());
  Noise noise;
  Mesh mesh;
  mesh.positions.push_back(f(0, 0));
  std::int32_t inner = 0, inner_count = 1;  // first vertex of the ring before, and its points
  for (std::int32_t k = 1; k <= count; ++k) {
    const std::int32_t outer = static_cast<std::int32_t>(mesh.positions.size()), outer_count = rings.points[k - 1];
    for (std::int32_t j = 0; j < outer_count; ++j) {
      const bool inside = k > 1 && k < count;
      const double ds = inside ? kJitter * noise() : 0, dt = inside ? kJitter * noise() : 0;
      mesh.positions.push_back(f(length * (k + ds) / count, 2 * kPi * (j + dt) / outer_count));
    }
    // Zip the two rings together, always on by the shorter diagonal. The first triangle rests on the outer ring.
    std::vector<Face> band;
    const std::int32_t inner_steps = k == 1 ? 0 : inner_count;
    for (std::int32_t i = 0, j = 0; i < inner_steps || j < outer_count;) {
      const std::int32_t a = inner + i % inner_count, b = outer + j % outer_count;
      const std::int32_t a_next = inner + (i + 1) % inner_count, b_next = outer + (j + 1) % outer_count;
      bool along_outer = i == inner_steps || j == 0;
      if (!along_outer && j < outer_count) {
        // Neither ring may run far ahead of the other.
        const double lead = (j + 1.0) / outer_count - (i + 1.0) / inner_count;
        along_outer = std::abs(lead) * outer_count > 1.5
                          ? lead < 0
                          : (mesh.positions[a] - mesh.positions[b_next]).squaredNorm() <
                                (mesh.positions[a_next] - mesh.positions[b]).squaredNorm();
      }
      if (along_outer) {
        band.push_back({a, b, b_next});
        ++j;
      } else {
        band.push_back({a, b, a_next});
        ++i;
      }
    }
    if (k == count) std::reverse(band.begin(), band.end());
    mesh.faces.insert(mesh.faces.end(), band.begin(), band.end());
    inner = outer;
    inner_count = outer_count;
  }
  return Shorten(std::move(mesh), triangles);
}

double Bump(double distance2, double width) {
  return std::exp(-distance2 / (width * width));
}

Mesh MakeEar(std::int64_t triangles) {
  // A shell with a rolled rim, a ridge that follows it, and a hollow.
  const auto shell = [](double s, double theta) {
    const double x = 0.7 * s * std::cos(theta), y = s * (1 + 0.15 * std::sin(theta)) * std::sin(theta);
    const double rim = 0.35 * Bump((s - 0.85) * (s - 0.85), 0.15) * (1 - 0.6 * std::sin(theta - 0.4));
    const double ridge = 0.25 * Bump((s - 0.5) * (s - 0.5), 0.13) * (0.5 + 0.5 * std::cos(theta - 2));
    const double hollow = -0.4 * Bump((x - 0.1) * (x - 0.1) + (y + 0.2) * (y + 0.2), 0.3);
    return Vec3(x, y, rim + ridge + hollow);
  };
  return MakeRings(
      triangles, 1, [](double s) { return 0.9 * s; }, shell);
}

Mesh MakeHead(std::int64_t triangles) {
  constexpr double kNeck = 2.5;  // polar angle of the opening
  const auto skull = [](double s, double theta) {
    const Vec3 n(std::sin(s) * std::cos(theta), std::sin(s) * std::sin(theta), std::cos(s));
    const auto at = [&](double polar, double azimuth) {
      const Vec3 p(std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth), std::cos(polar));
      return (n - p).squaredNorm();
    };
    const double r = 1 + 0.35 * Bump(at(1.75, 0), 0.18) + 0.08 * Bump(at(1.35, 0.35), 0.2) +
                     0.08 * Bump(at(1.35, -0.35), 0.2) - 0.1 * Bump(at(1.55, 0.4), 0.15) -
                     0.1 * Bump(at(1.55, -0.4), 0.15) + 0.25 * Bump(at(1.65, kPi / 2), 0.16) +
                     0.25 * Bump(at(1.65, -kPi / 2), 0.16) + 0.02 * std::sin(9 * n.x()) * std::sin(8 * n.y());
    return Vec3(0.95 * r * n.x(), 0.8 * r * n.y(), 1.15 * r * n.z());
  };
  return MakeRings(
      triangles, kNeck, [](double s) { return std::sin(s); }, skull);
}

Mesh MakeTwists(std::int64_t triangles) {
  const auto ribbon = [](double s, double t) {
    const double along = 6 * s, turn = 3 * kPi * s, across = 2 * t - 1;
    const Vec3 axis(along, 0.8 * std::sin(along), 0.5 * std::cos(0.7 * along));
    const double bulge = 0.25 * (1 - across * across);
    return Vec3(axis + across * Vec3(0, std::cos(turn), std::sin(turn)) +
                bulge * Vec3(0, -std::sin(turn), std::cos(turn)));
  };
  return MakePatch(triangles, 4.5, ribbon);
}

Mesh MakeWaves(std::int64_t triangles) {
  const auto height = [](double s, double t) {
    const double x = 2 * s - 1, y = 2 * t - 1;
    const double z = 0.3 * std::cos(2.7 * x + 0.4) * std::cos(3.1 * y) + 0.18 * std::sin(4 * x * y) +
                     0.1 * std::cos(5.5 * (x * x - 0.7 * y * y)) +
                     0.3 * Bump((x + 0.35) * (x + 0.35) + (y - 0.25) * (y - 0.25), 0.4);
    return Vec3(x, y, z);
  };
  return MakePatch(triangles, 1, height);
}

Mesh MakeFoot(std::int64_t triangles) {
  // Along the sole, through a bend of a quarter circle at the heel, up the leg.
  constexpr double kSole = 2.2, kBend = 1.0, kLeg = 2.2;
  constexpr double kLength = kSole + kBend * kPi / 2 + kLeg;
  // Half a circle's worth of arc closes the toe; ankle and calf.
  const auto radius = [](double s) {
    const double toe = s < 1 ? std::sin(std::min(s, 1.0) * kPi / 2) : 1.0;
    return toe * (0.55 + 0.12 * std::sin(1.1 * s) - 0.1 * Bump((s - 4.2) * (s - 4.2), 0.6));
  };
  const auto skin = [&](double s, double theta) {
    // The toe's centre moves like that of a ball: slowly at the tip.
    const double along = s < 1 ? 1 - 0.5 * std::cos(s * kPi / 2) - 0.5 * (1 - s) : s;
    Vec3 centre, up;
    if (along < kSole) {
      centre = Vec3(along, 0, 0);
      up = Vec3(0, 0, 1);
    } else if (along < kSole + kBend * kPi / 2) {
      const double turn = (along - kSole) / kBend;
      centre = Vec3(kSole + kBend * std::sin(turn), 0, kBend * (1 - std::cos(turn)));
      up = Vec3(-std::sin(turn), 0, std::cos(turn));
    } else {
      centre = Vec3(kSole + kBend, 0, kBend + along - kSole - kBend * kPi / 2);
      up = Vec3(-1, 0, 0);
    }
    const double toes = 1 + 0.12 * Bump((s - 0.6) * (s - 0.6), 0.4) * std::cos(5 * theta);
    const double r = radius(s) * toes;
    const double flat = 0.7 + 0.3 * std::min(1.0, s / kLength * 1.4);  // the sole is wider than it is high
    return Vec3(centre + r * std::cos(theta) * Vec3(0, 1, 0) + flat * r * std::sin(theta) * up);
  };
  return MakeRings(triangles, kLength, radius, skin);
}

const std::vector<std::pair<std::string, Mesh (*)(std::int64_t)>>& Makers() {
  static const auto* makers = new std::vector<std::pair<std::string, Mesh (*)(std::int64_t)>>{
      {"ear", MakeEar}, {"head", MakeHead}, {"twists", MakeTwists}, {"waves", MakeWaves}, {"foot", MakeFoot}};
  return *makers;
}

}  // namespace

const std::vector<std::string>& MeshNames() {
  static const auto* names = [] {
    auto* list = new std::vector<std::string>;
    for (const auto& [name, make] : Makers()) list->push_back(name);
    return list;
  }();
  return *names;
}

Mesh MakeMesh(const std::string& name, std::int64_t triangles) {
  for (const auto& [known, make] : Makers()) {
    if (known == name) return make(std::max<std::int64_t>(100, triangles));
  }
  return {};
}

namespace {

// What follows the last `mark` of `spec` if that is a whole number, or -1; `before` is what comes before it.
std::int64_t NumberAfter(const std::string& spec, char mark, std::string* before) {
  const std::size_t at = spec.rfind(mark);
  if (at == std::string::npos) return -1;
  std::int64_t number = -1;
  const char* end = spec.data() + spec.size();
  const auto [rest, error] = std::from_chars(spec.data() + at + 1, end, number);
  if (error != std::errc() || rest != end || number < 0) return -1;
  *before = spec.substr(0, at);
  return number;
}

// FAMILY:TRIANGLES:SEED; without a family if `spec` is anything else.
struct Member {
  std::string family;
  int triangles = 0;
  std::uint64_t seed = 0;
};

Member MemberOf(const std::string& spec) {
  std::string rest, family;
  const std::int64_t seed = NumberAfter(spec, ':', &rest);
  const std::int64_t triangles = seed < 0 ? -1 : NumberAfter(rest, ':', &family);
  const std::vector<std::string> families = testing::Families();
  if (triangles <= 0 || triangles > 10'000'000 || std::find(families.begin(), families.end(), family) == families.end())
    return {};
  return {family, static_cast<int>(triangles), static_cast<std::uint64_t>(seed)};
}

}  // namespace

absl::StatusOr<Mesh> LoadMesh(const std::string& spec) {
  std::string name;
  if (const Member member = MemberOf(spec); !member.family.empty()) {
    return testing::MakeFamily(member.family, member.seed, member.triangles);
  }
  if (const std::int64_t triangles = NumberAfter(spec, ':', &name); triangles >= 0) {
    const auto& names = MeshNames();
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      return absl::InvalidArgumentError("no such surface: " + name);
    }
    return MakeMesh(name, triangles);
  }
  std::string path = spec;
  const std::int64_t levels = NumberAfter(spec, '@', &path);
  const absl::StatusOr<MeshFile> file = ReadMeshFile(path);
  if (!file.ok()) return file.status();
  Mesh mesh = Triangulate(file->mesh).mesh;
  for (std::int64_t i = 0; i < levels; ++i) mesh = SubdivideLoop(mesh);
  return mesh;
}

std::optional<SeamedMesh> ReadWithSeams(const std::string& path) {
  const absl::StatusOr<MeshFile> file = ReadMeshFile(path);
  if (!file.ok()) return std::nullopt;
  const Triangulation triangles = Triangulate(file->mesh);
  SeamedMesh seamed = {triangles.mesh, !file->mesh.corner_texcoord.empty(), {}};
  if (!seamed.has_uv) return seamed;
  std::vector<double> uv;
  for (const std::int64_t corner : triangles.corner_of_triangle) {
    const std::int32_t id = file->mesh.corner_texcoord[corner];
    const Vec2 p = id < 0 ? Vec2(0, 0) : file->mesh.texcoords[id];
    uv.insert(uv.end(), {p.x(), p.y()});
  }
  const std::vector<char> is_outline = FindUvIslands(seamed.mesh, uv, triangles.source_polygon).is_outline;
  for (std::size_t c = 0; c < is_outline.size(); ++c) {
    if (is_outline[c]) seamed.seam_corners.push_back(static_cast<std::int32_t>(c));
  }
  return seamed;
}

std::string LabelOf(const std::string& spec) {
  std::string name;
  if (const Member member = MemberOf(spec); !member.family.empty()) {
    return member.family + "_" + std::to_string(member.triangles) + "_" + std::to_string(member.seed);
  }
  if (NumberAfter(spec, ':', &name) >= 0) return name;
  const std::int64_t levels = NumberAfter(spec, '@', &name);
  const std::string stem = std::filesystem::path(levels < 0 ? spec : name).stem().string();
  return levels > 0 ? stem + "_L" + std::to_string(levels) : stem;
}

Mesh SubdivideLoop(const Mesh& mesh) {
  struct Edge {
    std::int32_t number = -1;                       // of its new vertex
    std::int32_t opposite_a = -1, opposite_b = -1;  // -1: on the boundary
  };
  const auto key = [](std::int32_t a, std::int32_t b) {
    return std::uint64_t{static_cast<std::uint32_t>(std::min(a, b))} << 32 | static_cast<std::uint32_t>(std::max(a, b));
  };
  std::unordered_map<std::uint64_t, Edge> edges;
  edges.reserve(2 * mesh.faces.size());
  const auto old_count = static_cast<std::int32_t>(mesh.positions.size());
  std::int32_t count = old_count;
  for (const Face& face : mesh.faces) {
    for (int k = 0; k < 3; ++k) {
      Edge& edge = edges[key(face[Next(k)], face[Prev(k)])];
      if (edge.number < 0) {
        edge.number = count++;
        edge.opposite_a = face[k];
      } else {
        edge.opposite_b = face[k];
      }
    }
  }
  Mesh fine;
  fine.positions.resize(count);
  std::vector<Vec3> ring(old_count, Vec3::Zero()), rim(old_count, Vec3::Zero());
  std::vector<int> valence(old_count, 0);
  std::vector<bool> on_boundary(old_count, false);
  for (const auto& [ends, edge] : edges) {
    const auto a = static_cast<std::int32_t>(ends >> 32), b = static_cast<std::int32_t>(ends & 0xffffffffu);
    const Vec3 &pa = mesh.positions[a], &pb = mesh.positions[b];
    ring[a] += pb;
    ring[b] += pa;
    ++valence[a];
    ++valence[b];
    if (edge.opposite_b < 0) {
      on_boundary[a] = on_boundary[b] = true;
      rim[a] += pb;
      rim[b] += pa;
      fine.positions[edge.number] = 0.5 * (pa + pb);
    } else {
      fine.positions[edge.number] =
          0.375 * (pa + pb) + 0.125 * (mesh.positions[edge.opposite_a] + mesh.positions[edge.opposite_b]);
    }
  }
  for (std::int32_t v = 0; v < old_count; ++v) {
    const Vec3& p = mesh.positions[v];
    if (on_boundary[v]) {
      fine.positions[v] = 0.75 * p + 0.125 * rim[v];
    } else if (valence[v] > 0) {
      const double c = 0.375 + 0.25 * std::cos(2 * kPi / valence[v]), beta = (0.625 - c * c) / valence[v];
      fine.positions[v] = (1 - valence[v] * beta) * p + beta * ring[v];
    } else {
      fine.positions[v] = p;
    }
  }
  for (const Face& face : mesh.faces) {
    std::int32_t middle[3];
    for (int k = 0; k < 3; ++k) middle[k] = edges.at(key(face[Next(k)], face[Prev(k)])).number;
    for (int k = 0; k < 3; ++k) fine.faces.push_back({face[k], middle[Prev(k)], middle[Next(k)]});
    fine.faces.push_back({middle[0], middle[1], middle[2]});
  }
  return fine;
}

}  // namespace planish::bench
