// Lets charts that lie apart grow until they are jammed: each is pushed and turned by those that come too near.
// Distances are sampled, so they may be short of what is demanded by a little (tighten.cc measures them exactly).
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/pack/distance_field.h"
#include "core/pack/outline.h"

namespace planish {

// What charts keep to. Lengths in this header are in units of a tile.
struct PackRules {
  double distance = 0;  // kept between two charts
  double low = 0;       // charts stay within [low, 1 - low]^2
  int tiles = 1;        // of each atlas
  int atlases = 1;
};

struct RelaxOptions : PackRules {
  double spacing = 0.003;   // of samples along the outlines
  double tolerance = 1e-4;  // that may be missing from `distance`
};

class Relaxer {
 public:
  // Chart i is scaled by relative_scales[i] times scale(). The first two arguments and `execution` must outlive this.
  Relaxer(const std::vector<Outline>& outlines, const std::vector<DistanceField>& fields,
          std::vector<double> relative_scales, double scale, const RelaxOptions& options, const Execution& execution);

  std::vector<Pose>& poses() { return poses_; }
  double scale() const { return scale_; }
  void set_scale(double scale);
  // What it has cost so far, in about nanoseconds, counted in steps of the algorithm.
  std::int64_t work() const { return spent_.work; }
  // Per chart: kept in addition to the distance; 0 at first.
  std::vector<double>& margins() { return margins_; }

  // Grows the charts, by a factor of `growth` at a time, as long as they can make room for each other: until `patience`
  // steps in a row have not brought them apart, or after about `most_work`. Ends with the largest scale at which no
  // distance lacked more than the tolerance.
  void Grow(int patience, std::int64_t most_work, double growth = 1.002);
  // Moves charts at the present scale until no distance lacks more than the tolerance; returns whether that came about
  // within `steps` steps and about `most_work`.
  bool Separate(int steps, std::int64_t most_work);

 private:
  // Samples that follow each other, in a disc.
  struct Block {
    std::int32_t begin, end;
    Vec2 centre;
    double radius;
  };
  struct Shape {
    std::vector<Vec2> samples;
    std::vector<Block> blocks;
    double turning_radius;
  };
  struct Contact {
    std::int32_t body, sample;
    std::int32_t other;   // below 0: the rim, -1 left, -2 right, -3 bottom, -4 top
    float far_until = 0;  // nothing is missing before the two bodies have moved so far (Moved)
  };

  void FindContacts();
  // How far the points of the bodies of a contact have moved since contacts were found, at most, together.
  double Moved(const Contact& contact) const {
    return contacts_.moved[contact.body] + (contact.other < 0 ? 0 : contacts_.moved[contact.other]);
  }
  // One step; returns how much is missing where most is.
  double Step();

  const std::vector<DistanceField>& fields_;
  std::vector<double> relative_;
  double scale_;
  RelaxOptions options_;
  const Execution& execution_;
  std::vector<Shape> shapes_;
  std::vector<Pose> poses_;
  std::vector<double> margins_;
  std::vector<Vec3> velocity_;  // along x and y, and the turn times the turning radius
  struct {
    double skin;  // how much farther than the distance to be kept they are looked for
    std::vector<Contact> found;
    std::vector<double> moved;  // of each body: how far its points have moved since then, at most
    int age = 0;                // steps since then
  } contacts_;
  struct {
    std::int64_t steps = 0, work = 0;
  } spent_;
  double last_energy_ = 0;
};

}  // namespace planish
