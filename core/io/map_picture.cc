#include "core/io/map_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "Eigen/Geometry"
#include "core/mesh/half_edges.h"

namespace planish {
namespace {

constexpr int kOversampling = 2;    // samples per pixel and direction
constexpr double kSeamWidth = 1.2;  // pixels on either side
const Vec3 kSeamColour(0.16, 0.13, 0.2);

// Half-edges beyond which the map does not go on: at the boundary of the mesh, or where the UV of the neighbour differ.
std::vector<char> SeamHalfEdges(const Mesh& mesh, const std::vector<double>& uv) {
  const auto at = [&](std::int32_t corner) { return Vec2(uv[2 * corner], uv[2 * corner + 1]); };
  std::vector<char> seam(3 * mesh.faces.size(), 1);
  const EdgeGroups edges = GroupHalfEdges(mesh.faces, mesh.num_vertices());
  for (std::int32_t e = 0; e < edges.num_edges(); ++e) {
    if (edges.begin[e + 1] - edges.begin[e] != 2) continue;
    const std::int32_t c = edges.half_edge[edges.begin[e]], d = edges.half_edge[edges.begin[e] + 1];
    const std::int32_t f = 3 * (c / 3), g = 3 * (d / 3);
    const bool joined = at(f + Next(c % 3)) == at(g + Prev(d % 3)) && at(f + Prev(c % 3)) == at(g + Next(d % 3));
    seam[c] = seam[d] = !joined;
  }
  return seam;
}

// Four colours at the corners of the unit square tell places apart; squares are light and dark.
Vec3 CheckColour(const Vec2& uv, int checks) {
  const Vec3 blue(0.13, 0.47, 0.84), red(0.87, 0.24, 0.33), green(0.18, 0.66, 0.44), yellow(0.97, 0.71, 0.22);
  const Vec3 low = (1 - uv.x()) * blue + uv.x() * red, high = (1 - uv.x()) * green + uv.x() * yellow;
  const Vec3 hue = (1 - uv.y()) * low + uv.y() * high;
  const int parity = static_cast<int>(std::floor(uv.x() * checks)) + static_cast<int>(std::floor(uv.y() * checks));
  return parity % 2 == 0 ? Vec3(0.3 * hue + 0.7 * Vec3::Ones()) : Vec3(0.9 * hue);
}

// Samples with depth. Nearer is larger.
class Canvas {
 public:
  Canvas(int width, int height)
      : width_(width),
        height_(height),
        colour_(static_cast<std::size_t>(width) * height, Vec3::Ones()),
        depth_(colour_.size(), -std::numeric_limits<double>::infinity()) {}

  // Fills the triangle of `points` (x, y in samples, z depth), any orientation. shade(barycentric) gives the colour.
  template <typename Shade>
  void Fill(const std::array<Vec3, 3>& points, const Shade& shade) {
    const auto cross = [](const Vec3& a, const Vec3& b, double x, double y) {
      return (b.x() - a.x()) * (y - a.y()) - (b.y() - a.y()) * (x - a.x());
    };
    const double area = cross(points[0], points[1], points[2].x(), points[2].y());
    if (area == 0 || !std::isfinite(area)) return;
    const auto [left, right] = std::minmax({points[0].x(), points[1].x(), points[2].x()});
    const auto [top, bottom] = std::minmax({points[0].y(), points[1].y(), points[2].y()});
    const int x0 = std::max(0, static_cast<int>(std::ceil(left - 0.5)));
    const int x1 = std::min(width_ - 1, static_cast<int>(std::floor(right - 0.5)));
    const int y0 = std::max(0, static_cast<int>(std::ceil(top - 0.5)));
    const int y1 = std::min(height_ - 1, static_cast<int>(std::floor(bottom - 0.5)));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        Vec3 weight;
        for (int k = 0; k < 3; ++k) weight[k] = cross(points[Next(k)], points[Prev(k)], x + 0.5, y + 0.5) / area;
        if (weight.minCoeff() < 0) continue;
        const double depth = weight[0] * points[0].z() + weight[1] * points[1].z() + weight[2] * points[2].z();
        const std::size_t i = static_cast<std::size_t>(y) * width_ + x;
        if (depth <= depth_[i]) continue;
        depth_[i] = depth;
        colour_[i] = shade(weight);
      }
    }
  }

  Image Downsample() const {
    Image image(width_ / kOversampling, height_ / kOversampling);
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        Vec3 sum = Vec3::Zero();
        for (int i = 0; i < kOversampling * kOversampling; ++i) {
          const int row = y * kOversampling + i / kOversampling, column = x * kOversampling + i % kOversampling;
          sum += colour_[static_cast<std::size_t>(row) * width_ + column];
        }
        const Vec3 mean = (255 / (1.0 * kOversampling * kOversampling) * sum).cwiseMax(0).cwiseMin(255);
        image.At(x, y) = {static_cast<std::uint8_t>(mean.x()), static_cast<std::uint8_t>(mean.y()),
                          static_cast<std::uint8_t>(mean.z())};
      }
    }
    return image;
  }

 private:
  int width_, height_;
  std::vector<Vec3> colour_;
  std::vector<double> depth_;
};

// Moves and scales points uniformly so that their x and y fill a square of `side` samples at (left, top), y upwards.
class Fit {
 public:
  Fit(const Vec2& low, const Vec2& high, double left, double top, double side)
      : scale_(side / std::max((high - low).maxCoeff(), std::numeric_limits<double>::min())),
        offset_(left + side / 2 - scale_ * (low + high).x() / 2, top + side / 2 + scale_ * (low + high).y() / 2) {}

  Vec3 operator()(const Vec3& p) const { return {offset_.x() + scale_ * p.x(), offset_.y() - scale_ * p.y(), p.z()}; }

 private:
  double scale_;
  Vec2 offset_;
};

Eigen::Matrix3d ViewRotation(double azimuth, double elevation) {
  return (Eigen::AngleAxisd(elevation, Vec3::UnitX()) * Eigen::AngleAxisd(-azimuth, Vec3::UnitY())).toRotationMatrix();
}

}  // namespace

Image DrawMap(const Mesh& mesh, const std::vector<double>& uv, const MapPictureOptions& options) {
  const int side = options.height * kOversampling;
  const double margin = 0.04 * side;
  Canvas canvas(2 * side, side);
  const std::vector<char> seam = SeamHalfEdges(mesh, uv);

  const Eigen::Matrix3d view = ViewRotation(options.azimuth, options.elevation);
  Vec2 low = Vec2::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const Face& face : mesh.faces) {
    for (const std::int32_t v : face) {
      const Vec2 p = (view * mesh.positions[v]).head<2>();
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
  }
  const Fit fit_surface(low, high, margin, margin, side - 2 * margin);
  const Fit fit_plane(Vec2::Zero(), Vec2::Ones(), side + margin, margin, side - 2 * margin);

  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    std::array<Vec2, 3> texture;
    std::array<Vec3, 3> surface, plane;
    for (std::size_t k = 0; k < 3; ++k) {
      texture[k] = Vec2(uv[2 * (3 * f + k)], uv[2 * (3 * f + k) + 1]);
      surface[k] = fit_surface(view * mesh.positions[mesh.faces[f][k]]);
      plane[k] = fit_plane(Vec3(texture[k].x(), texture[k].y(), 0));
    }
    const Vec3 normal = (surface[1] - surface[0]).cross(surface[2] - surface[0]).normalized();
    const double light = 0.55 + 0.45 * std::abs(normal.dot(Vec3(0.3, -0.4, 0.87)));
    for (const bool on_surface : {true, false}) {
      const std::array<Vec3, 3>& points = on_surface ? surface : plane;
      // A sample at barycentric weight w_k lies w_k heights above edge k.
      std::array<double, 3> height = {};
      const double twice_area = std::abs((points[1] - points[0]).head<2>().x() * (points[2] - points[0]).y() -
                                         (points[1] - points[0]).y() * (points[2] - points[0]).x());
      for (int k = 0; k < 3; ++k) height[k] = twice_area / (points[Prev(k)] - points[Next(k)]).head<2>().norm();
      canvas.Fill(points, [&](const Vec3& weight) -> Vec3 {
        for (int k = 0; k < 3; ++k) {
          if (seam[3 * f + k] && weight[k] * height[k] < kSeamWidth * kOversampling) return kSeamColour;
        }
        const Vec2 at = weight[0] * texture[0] + weight[1] * texture[1] + weight[2] * texture[2];
        const Vec3 colour = CheckColour(at, options.checks);
        return on_surface ? Vec3(light * colour) : colour;
      });
    }
  }
  return canvas.Downsample();
}

}  // namespace planish
