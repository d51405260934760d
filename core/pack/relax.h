// Grows charts until they are jammed: each chart is pushed and rotated away from charts that are too near. Distances
// are sampled, so they may be slightly too short (tighten.cc measures them exactly).
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/pack/distance_field.h"
#include "core/pack/outline.h"

namespace planish {

// Constraints on the charts. Lengths in this header are in units of a tile.
struct PackRules {
  double distance = 0;  // between two charts
  double low = 0;       // charts stay within [low, 1 - low]^2
  int tiles = 1;        // of each atlas
  int atlases = 1;
};

struct RelaxOptions : PackRules {
  double spacing = 0.003;   // of samples along the outlines
  double tolerance = 1e-4;  // by which a distance may fall short
};

class Relaxer {
 public:
  // Chart i is scaled by relative_scales[i] * scale(). The first two arguments and `execution` must outlive this.
  Relaxer(const std::vector<Outline>& outlines, const std::vector<DistanceField>& fields,
          std::vector<double> relative_scales, double scale, const RelaxOptions& options, const Execution& execution);

  std::vector<Pose>& poses() { return poses_; }
  double scale() const { return scale_; }
  void set_scale(double scale);
  // The cost so far in about nanoseconds, counted in steps of the algorithm.
  std::int64_t work() const { return spent_.work; }
  // Per chart: a length by which its distances from others must be larger; initially 0.
  std::vector<double>& margins() { return margins_; }

  // Grows the charts by a factor of `growth` at a time, until `patience` steps in a row have not separated them, or
  // after about `most_work`. Ends at the largest scale at which every distance was kept within the tolerance.
  void Grow(int patience, std::int64_t most_work, double growth = 1.002);
  // Moves charts at the current scale until every distance is kept within the tolerance. Returns whether that succeeded
  // within `steps` steps and about `most_work`.
  bool Separate(int steps, std::int64_t most_work);

 private:
  // Consecutive samples and a disc round them.
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
    std::int32_t other;   // negative: the rim, -1 left, -2 right, -3 bottom, -4 top
    float far_until = 0;  // no distance is missing until Moved() exceeds this
  };

  void FindContacts();
  // An upper bound of how far the points of both bodies have moved, added up, since contacts were found.
  double Moved(const Contact& contact) const {
    return contacts_.moved[contact.body] + (contact.other < 0 ? 0 : contacts_.moved[contact.other]);
  }
  // Moves all charts by one step; returns the largest missing distance.
  double Step();

  const std::vector<DistanceField>& fields_;
  std::vector<double> relative_;
  double scale_;
  RelaxOptions options_;
  const Execution& execution_;
  std::vector<Shape> shapes_;
  std::vector<Pose> poses_;
  std::vector<double> margins_;
  std::vector<Vec3> velocity_;  // along x and y, and rotation times the turning radius
  struct {
    double skin;  // contacts are searched within the distance plus this
    std::vector<Contact> found;
    std::vector<double> moved;  // per body: upper bound of how far its points have moved since
    int age = 0;                // steps since contacts were found
  } contacts_;
  struct {
    std::int64_t steps = 0, work = 0;
  } spent_;
  double last_energy_ = 0;
};

}  // namespace planish
