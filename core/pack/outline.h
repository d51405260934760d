// What packing needs to know of a chart: its outline.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/mesh/box_tree.h"
#include "core/mesh/mesh.h"

namespace planish {

struct PackChart;

// Round `centre`, in the units of the chart. The winding number of `edges` is above 0 on every face, whichever way that
// one turns, and 0 elsewhere.
struct Outline {
  std::vector<Vec2> points;                        // of the edges, minus `centre`
  std::vector<std::array<std::int32_t, 2>> edges;  // from, to; each loop from one edge to the next
  std::vector<Vec2> hull;                          // convex, counter-clockwise, minus `centre`; never empty
  Vec2 centre = Vec2::Zero();                      // of the box round the faces
  double area = 0;                                 // of the faces
  double radius = 0;                               // of a circle round 0 that holds all points
  double upright = 0;  // turn that makes the rectangle of least area upright, longer along u
  double slack = 0;    // how far the outline of the chart may lie from this one (Simplified())
};

// Counter-clockwise, without points on its sides: one or two points if all lie on a line.
std::vector<Vec2> ConvexHull(std::vector<Vec2> points);

// Charts without faces are their points.
Outline MakeOutline(const PackChart& chart);

// An outline with fewer edges, nowhere farther than `tolerance` from the one given: runs of edges become one where all
// of their points lie that near. `slack` is how far they do. Everything but points and edges stays.
Outline Simplified(const Outline& outline, double tolerance);

// Round the hull after a turn by `angle`.
Box BoxAt(const Outline& outline, double angle);

// The turn in [0, pi / 2) that fits the hull into the smallest upright square.
double AngleOfSmallestSquare(const Outline& outline);

}  // namespace planish
