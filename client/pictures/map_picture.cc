#include "client/pictures/map_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "Eigen/Geometry"
#include "client/files/uv_islands.h"
#include "client/pictures/canvas.h"

namespace planish {
namespace {

constexpr int kOversampling = 2;    // samples per pixel and direction
constexpr double kSeamWidth = 1.2;  // pixels on either side
const Vec3 kSeamColour(0.16, 0.13, 0.2);

// The colour of the checkerboard at `uv`, in light and dark squares. It is mixed of four colours at the corners of the
// unit square, so that places can be told apart.
Vec3 CheckColour(const Vec2& uv, int checks) {
  const Vec3 blue(0.13, 0.47, 0.84), red(0.87, 0.24, 0.33), green(0.18, 0.66, 0.44), yellow(0.97, 0.71, 0.22);
  const Vec3 low = (1 - uv.x()) * blue + uv.x() * red, high = (1 - uv.x()) * green + uv.x() * yellow;
  const Vec3 hue = (1 - uv.y()) * low + uv.y() * high;
  const int parity = static_cast<int>(std::floor(uv.x() * checks)) + static_cast<int>(std::floor(uv.y() * checks));
  return parity % 2 == 0 ? Vec3(0.3 * hue + 0.7 * Vec3::Ones()) : Vec3(0.9 * hue);
}

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
  Canvas canvas(2 * options.height, options.height, kOversampling);
  const std::vector<char> seam = FindUvIslands(mesh, uv).is_outline;

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
      canvas.Fill(points, [&](const Vec3& weight) {
        for (int k = 0; k < 3; ++k) {
          if (seam[3 * f + k] && weight[k] * height[k] < kSeamWidth * kOversampling) return ToRgb(kSeamColour);
        }
        const Vec2 at = weight[0] * texture[0] + weight[1] * texture[1] + weight[2] * texture[2];
        const Vec3 colour = CheckColour(at, options.checks);
        return ToRgb(on_surface ? Vec3(light * colour) : colour);
      });
    }
  }
  return canvas.Downsample();
}

}  // namespace planish
