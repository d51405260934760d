#include "tests/core/pack_charts.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <map>
#include <numbers>
#include <numeric>
#include <random>
#include <sstream>

#include "absl/status/status.h"
#include "core/mesh/mesh.h"

namespace planish::testing {
namespace {

using Random = std::mt19937_64;

// In [low, high); the same on every machine.
double Uniform(Random& random, double low, double high) {
  return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
}

// A fan round the origin.
PackChart Blob(Random& random, double size, int corners, double depth, double noise) {
  PackChart chart;
  double amplitude[6], phase[6];
  for (int k = 2; k < 6; ++k) {
    amplitude[k] = Uniform(random, -depth, depth) / k;
    phase[k] = Uniform(random, 0, 2 * std::numbers::pi);
  }
  chart.positions.push_back(Vec2::Zero());
  for (int i = 0; i < corners; ++i) {
    const double angle = 2 * std::numbers::pi * i / corners;
    double radius = 1 + Uniform(random, -noise, noise);
    for (int k = 2; k < 6; ++k) radius += amplitude[k] * std::cos(k * angle + phase[k]);
    chart.positions.push_back(size * std::max(0.2, radius) * Vec2(std::cos(angle), std::sin(angle)));
    chart.faces.push_back({0, i + 1, (i + 1) % corners + 1});
  }
  return chart;
}

// A band of `steps` quads from inner(t) to outer(t), t in [0, 1].
PackChart Band(int steps, const std::function<Vec2(double)>& inner, const std::function<Vec2(double)>& outer) {
  PackChart chart;
  for (int i = 0; i <= steps; ++i) {
    chart.positions.push_back(inner(1.0 * i / steps));
    chart.positions.push_back(outer(1.0 * i / steps));
  }
  for (int i = 0; i < steps; ++i) {
    chart.faces.push_back({2 * i, 2 * i + 1, 2 * i + 2});
    chart.faces.push_back({2 * i + 2, 2 * i + 1, 2 * i + 3});
  }
  return chart;
}

// An arc of a ring, or all of it.
PackChart Arc(double size, double thickness, double turn) {
  const auto at = [](double radius, double angle) { return Vec2(radius * std::cos(angle), radius * std::sin(angle)); };
  return Band(
      24, [=](double t) { return at(size * (1 - thickness), turn * t); }, [=](double t) { return at(size, turn * t); });
}

PackChart Cells(double size, const std::vector<Vec2>& cells) {
  PackChart chart;
  std::map<std::pair<double, double>, std::int32_t> ids;
  const auto id = [&](const Vec2& p) {
    const auto [it, added] = ids.try_emplace({p.x(), p.y()}, static_cast<std::int32_t>(chart.positions.size()));
    if (added) chart.positions.push_back(size * p);
    return it->second;
  };
  for (const Vec2& c : cells) {
    const std::int32_t a = id(c), b = id(c + Vec2(1, 0)), d = id(c + Vec2(0, 1)), e = id(c + Vec2(1, 1));
    chart.faces.push_back({a, b, e});
    chart.faces.push_back({a, e, d});
  }
  return chart;
}

PackChart Corner(Random& random, double size) {
  const std::vector<std::vector<Vec2>> shapes = {
      {{0, 0}, {1, 0}, {2, 0}, {0, 1}}, {{0, 0}, {1, 0}, {2, 0}, {1, 1}}, {{0, 0}, {1, 0}, {2, 0}, {0, 1}, {2, 1}},
      {{0, 0}, {1, 0}, {0, 1}},         {{0, 0}, {1, 0}, {1, 1}, {2, 1}},
  };
  return Cells(0.8 * size, shapes[random() % shapes.size()]);
}

PackChart Make(const std::string& kind, int i, int n, Random& random) {
  // A few large charts, most of them small.
  const double size = std::exp(Uniform(random, 0, 1.6)) * (i * 10 < n ? 1.8 : 1.0);
  if (kind == "equal") return Blob(random, 1, 40, 0.3, 0);
  if (kind == "blobs") return Blob(random, size, 60, 0.45, 0);
  if (kind == "rags") return Blob(random, size, 120, 0.4, 0.08);
  if (kind == "needles") {
    return Band(
        4, [](double t) { return Vec2(10 * t, 0); }, [](double t) { return Vec2(10 * t, -0.05); });
  }
  if (kind == "strips") {
    const double length = size * Uniform(random, 2, 6);
    if (random() % 3 == 0) return Arc(size * 1.5, Uniform(random, 0.2, 0.5), Uniform(random, 1, 4));
    return Band(
        8, [=](double t) { return Vec2(length * t, 0.1 * size * std::sin(5 * t)); },
        [=](double t) { return Vec2(length * t, -size + 0.1 * size * std::sin(5 * t)); });
  }
  if (kind == "corners") return Corner(random, size);
  if (kind == "rings") {
    if (i % 2 == 0) return Arc(2 * size, Uniform(random, 0.15, 0.4), 2 * std::numbers::pi);
    return Blob(random, 0.5 * size, 40, 0.3, 0);
  }
  const char* kinds[] = {"blobs", "rags", "strips", "corners", "rings", "blobs"};
  return Make(kinds[random() % 6], i, n, random);
}

absl::StatusOr<std::vector<PackChart>> ReadIslands(const std::string& path) {
  std::ifstream file(path);
  if (!file) return absl::NotFoundError(path + ": cannot be opened");
  std::vector<Vec3> positions;
  std::vector<Vec2> texture;
  std::vector<std::int32_t> id_of_texture;
  std::map<std::pair<double, double>, std::int32_t> ids;
  struct Corner3 {
    std::int32_t v, t;
  };
  std::vector<std::array<Corner3, 3>> faces;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (word == "v") {
      Vec3 p;
      words >> p.x() >> p.y() >> p.z();
      positions.push_back(p);
    } else if (word == "vt") {
      Vec2 p;
      words >> p.x() >> p.y();
      const auto [it, added] = ids.try_emplace({p.x(), p.y()}, static_cast<std::int32_t>(texture.size()));
      if (added) texture.push_back(p);
      id_of_texture.push_back(it->second);
    } else if (word == "f") {
      std::vector<Corner3> corners;
      while (words >> word) {
        int v = 0, t = 0;
        if (std::sscanf(word.c_str(), "%d/%d", &v, &t) != 2) return absl::InvalidArgumentError(path + ": no UV");
        corners.push_back({v - 1, id_of_texture[t - 1]});
      }
      for (std::size_t k = 2; k < corners.size(); ++k) faces.push_back({corners[0], corners[k - 1], corners[k]});
    }
  }
  std::vector<std::int32_t> parent(texture.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](std::int32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const auto& face : faces) {
    for (int k = 1; k < 3; ++k) parent[root(face[k].t)] = root(face[0].t);
  }
  std::map<std::int32_t, std::int32_t> chart_of_root;
  std::vector<PackChart> charts;
  std::vector<double> surface, plane;
  std::vector<std::int32_t> local(texture.size(), -1);
  for (const auto& face : faces) {
    const auto [it, added] = chart_of_root.try_emplace(root(face[0].t), static_cast<std::int32_t>(charts.size()));
    if (added) {
      charts.emplace_back();
      surface.push_back(0);
      plane.push_back(0);
    }
    PackChart& chart = charts[it->second];
    Face f;
    for (int k = 0; k < 3; ++k) {
      if (local[face[k].t] < 0) {
        local[face[k].t] = static_cast<std::int32_t>(chart.positions.size());
        chart.positions.push_back(texture[face[k].t]);
      }
      f[k] = local[face[k].t];
    }
    chart.faces.push_back(f);
    const Vec2 a = texture[face[1].t] - texture[face[0].t], b = texture[face[2].t] - texture[face[0].t];
    plane[it->second] += std::abs(a.x() * b.y() - a.y() * b.x());
    const Vec3 c = positions[face[1].v] - positions[face[0].v], d = positions[face[2].v] - positions[face[0].v];
    surface[it->second] +=
        Vec3(c.y() * d.z() - c.z() * d.y(), c.z() * d.x() - c.x() * d.z(), c.x() * d.y() - c.y() * d.x()).norm();
  }
  for (std::size_t i = 0; i < charts.size(); ++i) {
    charts[i].density = surface[i] > 0 && plane[i] > 0 ? std::sqrt(surface[i] / plane[i]) : 1;
  }
  return charts;
}

}  // namespace

absl::StatusOr<std::vector<PackChart>> MakeCharts(const std::string& name) {
  char kind[16] = "";
  int n = 0, seed = 0;
  const bool made_up =
      name.find('.') == std::string::npos && std::sscanf(name.c_str(), "%15[a-z]-%d-%d", kind, &n, &seed) >= 2;
  if (!made_up) return ReadIslands(name);
  Random random(static_cast<std::uint64_t>(seed) + 1);
  std::vector<PackChart> charts;
  for (int i = 0; i < n; ++i) {
    charts.push_back(Make(kind, i, n, random));
    const double angle = Uniform(random, 0, 2 * std::numbers::pi);
    for (Vec2& p : charts.back().positions) {
      p = Vec2(std::cos(angle) * p.x() - std::sin(angle) * p.y(), std::sin(angle) * p.x() + std::cos(angle) * p.y());
    }
  }
  return charts;
}

}  // namespace planish::testing
