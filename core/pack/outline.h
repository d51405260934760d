// The outline of a chart, which is all that packing needs to know.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/base/execution.h"
#include "core/base/portable_math.h"
#include "core/mesh/box_tree.h"
#include "core/mesh/mesh.h"

namespace planish {

struct PackChart;

// Rotates points about the origin by `angle` (radians, counter-clockwise) and scales them.
struct Rotation {
  double cosine, sine;  // multiplied by the scale

  explicit Rotation(double angle = 0, double scale = 1)
      : cosine(scale * portable::Cos(angle)), sine(scale * portable::Sin(angle)) {}
  Vec2 operator()(const Vec2& p) const { return {cosine * p.x() - sine * p.y(), sine * p.x() + cosine * p.y()}; }
  // Rotates clockwise; scales by the same factor.
  Vec2 Back(const Vec2& p) const { return {cosine * p.x() + sine * p.y(), cosine * p.y() - sine * p.x()}; }
};

// The position of a chart.
struct Pose {
  Vec2 centre = Vec2::Zero();  // of the outline, in its tile
  double angle = 0;            // radians, counter-clockwise
  int tile = 0;
};

// The boundary of the area that a chart covers, as directed edges. Its winding number is positive on every face,
// whichever way the face turns, and 0 elsewhere. Lengths are in the chart's units, positions relative to `centre`.
struct Outline {
  std::vector<Vec2> points;                        // of the edges, minus `centre`
  std::vector<std::array<std::int32_t, 2>> edges;  // from, to; the edges of a loop are consecutive
  std::vector<Vec2> hull;                          // convex, counter-clockwise, minus `centre`; never empty
  Vec2 centre = Vec2::Zero();                      // of the bounding box of the faces
  double area = 0;                                 // sum over the faces
  double radius = 0;                               // of a circle round the origin that holds all points
  double upright = 0;  // angle, radians, that makes the rectangle of least area upright, longer along u
  double slack = 0;    // bound of the distance between this outline and the chart's (Simplified())
};

// The corners of the convex hull, counter-clockwise; one or two if all points are on a line. O(n log n), exact.
std::vector<Vec2> ConvexHull(std::vector<Vec2> points);

// The signed area of a polygon, positive if it runs counter-clockwise. 0 for fewer than three points.
double AreaWithin(const std::vector<Vec2>& polygon);

// The rectangle of least area round a convex hull of two or more points. One of its sides lies on an edge of the hull.
struct HullRectangle {
  Vec2 along = Vec2(1, 0);  // unit vector along that side
  double width = 0;         // along `along`
  double height = 0;        // across
};
HullRectangle LeastRectangle(const std::vector<Vec2>& hull);

// A chart without faces gets an edge from each point to itself.
Outline MakeOutline(const PackChart& chart);

// An outline with fewer edges, nowhere farther than `tolerance` from the given one. A run of edges becomes one edge if
// all points of the run are within `tolerance` of it. `slack` becomes the largest distance; the other members stay.
Outline Simplified(const Outline& outline, double tolerance);

// std::floor and std::ceil within the range of int, without calls into the C library.
inline int Floor(double x) {
  const int whole = static_cast<int>(x);
  return whole - (x < whole ? 1 : 0);
}
inline int Ceil(double x) {
  const int whole = static_cast<int>(x);
  return whole + (x > whole ? 1 : 0);
}

// Finds the cells of a grid that lie inside of an outline, row by row, by winding numbers.
class ScanLines {
 public:
  // An edge of the outline. Cell (x, y) stands for the point (x + offset, y + offset).
  void AddEdge(Vec2 from, Vec2 to, double offset);
  // Calls fill(y, begin, end) for the cells [begin, end) of row y that lie inside; ranges may be empty. Call once,
  // after all edges.
  void ForEachInside(const std::function<void(int y, int begin, int end)>& fill);

 private:
  // Where an edge crosses the line of a row: the winding number changes from cell x on.
  struct Crossing {
    int y, x, change;
  };
  std::vector<Crossing> crossings_;
};

// The bounding box of the hull after a rotation by `angle`, radians.
Box BoxAt(const Outline& outline, double angle);

// The angle in [0, pi / 2) at which the hull's upright bounding square is smallest.
double AngleOfSmallestSquare(const Outline& outline);

// Rotates the points so that the rectangle of least area round `outline` (the points on the outline) is upright and
// longer along u, then moves and scales all points uniformly into [0, 1]^2, touching u = 0, v = 0 and u = 1. No
// reflection. O(n), and O(h log h) in the points of the outline. Returns the scale; 1 if all points coincide. After a
// cancellation the points are undefined.
double PlaceInUnitSquare(std::vector<Vec2> outline, std::vector<Vec2>* points, const Execution& execution = {});

}  // namespace planish
