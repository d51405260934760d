// What packing needs to know of a chart: its outline.
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

// Turns points counter-clockwise about 0 by `angle`, radians, and scales them.
struct Rotation {
  double cosine, sine;  // times the scale

  explicit Rotation(double angle = 0, double scale = 1)
      : cosine(scale * portable::Cos(angle)), sine(scale * portable::Sin(angle)) {}
  Vec2 operator()(const Vec2& p) const { return {cosine * p.x() - sine * p.y(), sine * p.x() + cosine * p.y()}; }
  // Turns clockwise; scales alike.
  Vec2 Back(const Vec2& p) const { return {cosine * p.x() + sine * p.y(), cosine * p.y() - sine * p.x()}; }
};

// Where a chart lies.
struct Pose {
  Vec2 centre = Vec2::Zero();  // of the outline, in its tile
  double angle = 0;            // radians, counter-clockwise
  int tile = 0;
};

// The boundary of the area that a chart covers, as directed edges. Their winding number is above 0 on every face,
// whichever way the face turns, and 0 elsewhere. Lengths are in the chart's own units, places relative to `centre`.
struct Outline {
  std::vector<Vec2> points;                        // of the edges, minus `centre`
  std::vector<std::array<std::int32_t, 2>> edges;  // from, to; each loop from one edge to the next
  std::vector<Vec2> hull;                          // convex, counter-clockwise, minus `centre`; never empty
  Vec2 centre = Vec2::Zero();                      // of the box round the faces
  double area = 0;                                 // of the faces
  double radius = 0;                               // of a circle round 0 that holds all points
  double upright = 0;  // turn, radians, that makes the rectangle of least area upright, longer along u
  double slack = 0;    // how far the outline of the chart may lie from this one (Simplified())
};

// The corners of the convex hull, counter-clockwise; one or two if all points lie on a line. O(n log n), exact.
std::vector<Vec2> ConvexHull(std::vector<Vec2> points);

// The area within a polygon that runs counter-clockwise; negative if it runs clockwise. 0 for fewer than three points.
double AreaWithin(const std::vector<Vec2>& polygon);

// The rectangle of least area round a convex hull of two points or more. It has a side on an edge of the hull.
struct HullRectangle {
  Vec2 along = Vec2(1, 0);  // unit, along that side
  double width = 0;         // in that direction
  double height = 0;        // across
};
HullRectangle LeastRectangle(const std::vector<Vec2>& hull);

// Of a chart without faces: an edge from each point to itself.
Outline MakeOutline(const PackChart& chart);

// An outline with fewer edges, nowhere farther than `tolerance` from the one given: a run of edges becomes one edge if
// all points of the run lie that near to it. `slack` becomes the largest such distance. Everything but points and edges
// stays.
Outline Simplified(const Outline& outline, double tolerance);

// std::floor and std::ceil, which are calls into the C library. Of what an int holds.
inline int Floor(double x) {
  const int whole = static_cast<int>(x);
  return whole - (x < whole ? 1 : 0);
}
inline int Ceil(double x) {
  const int whole = static_cast<int>(x);
  return whole + (x > whole ? 1 : 0);
}

// Which cells of the rows of a grid lie inside of an outline, by winding numbers.
class ScanLines {
 public:
  // An edge of the outline. Cell (x, y) stands for the point (x + offset, y + offset).
  void AddEdge(Vec2 from, Vec2 to, double offset);
  // Calls fill(y, begin, end) for cells [begin, end) of row y that lie inside; they may be none. Once, after all edges.
  void ForEachInside(const std::function<void(int y, int begin, int end)>& fill);

 private:
  // Of an edge and the line through the points of a row: the winding number changes from cell x on.
  struct Crossing {
    int y, x, change;
  };
  std::vector<Crossing> crossings_;
};

// The box round the hull once that has been turned by `angle`, radians.
Box BoxAt(const Outline& outline, double angle);

// The turn in [0, pi / 2) that fits the hull into the smallest upright square.
double AngleOfSmallestSquare(const Outline& outline);

// Turns the points so that the rectangle of least area round `outline`, those of them on the outline, is upright, its
// longer side along u, then moves and scales all uniformly into [0, 1]^2, touching u = 0, v = 0 and u = 1. No
// reflection. O(n), and O(h log h) in the points of the outline. Returns the factor by which lengths grew; 1 for points
// that are all the same. After a cancellation the points may be anywhere.
double PlaceInUnitSquare(std::vector<Vec2> outline, std::vector<Vec2>* points, const Execution& execution = {});

}  // namespace planish
