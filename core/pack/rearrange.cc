#include "core/pack/rearrange.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include "core/base/portable_math.h"
#include "core/base/radix_sort.h"
#include "core/mesh/box_tree.h"
#include "core/pack/silhouette.h"

namespace planish {
namespace {

constexpr int kDepthUnit = 16;  // per pixel of depth
constexpr int kBorder = 2;      // pixels round the tile, for samples at the rim
constexpr int kAngles = 24;     // evenly spaced rotations tried at random places
constexpr int kFineTurns = 4;   // local search has this many rotations for each of these
constexpr int kTurns = kFineTurns * kAngles;
constexpr int kTries = 60;            // random places that a chart tries in a move
constexpr double kMostWeight = 1000;  // of a pair
constexpr std::int64_t kWeightUnit = 16;
// Costs in nanoseconds of rotating a sample, measuring a pixel's depth and drawing a row.
constexpr std::int64_t kTurnWork = 12, kDepthWork = 4, kRowWork = 12;

// The nearest integer, halves rounded up; |x| < 2^20. Avoids std::lround, a call into the C library.
int Rounded(double x) {
  constexpr int kShift = 1 << 20;
  return static_cast<int>(x + (kShift + 0.5)) - kShift;
}

// xorshift64*.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15u + 0x2545F4914F6CDD1Du) {}
  // A random integer in [0, n).
  int Below(int n) {
    state_ ^= state_ >> 12;
    state_ ^= state_ << 25;
    state_ ^= state_ >> 27;
    return static_cast<int>(((state_ * 0x2545F4914F6CDD1Du) >> 32) * static_cast<std::uint64_t>(n) >> 32);
  }

 private:
  std::uint64_t state_;
};

// A chart at one rotation, in pixels relative to its centre. Each member is computed once.
struct Turned {
  double angle = 0;
  Box box;                                          // of its points
  bool fits = false;                                // within the tile
  std::array<std::pair<int, int>, 2> range;         // of x and of y; the middle of the tile if it does not fit
  std::vector<std::int32_t> samples;                // offsets in the image
  std::vector<std::array<std::int16_t, 2>> places;  // the samples as (x, y); empty until needed
  int left = 0, bottom = 0, width = 0, height = 0;
  std::vector<std::int16_t> depth;  // width x height; empty until needed
  std::vector<Span> rows;           // where depth is above 0
  std::int64_t own = 0;             // sum of the depths under its own samples
};

struct CellPose {
  int turned = 0, tile = 0, x = 0, y = 0;
};

class Search {
 public:
  Search(const std::vector<Outline>& outlines, const std::vector<int>& atlas, const std::vector<DistanceField>& fields,
         const std::vector<double>& scales, const RearrangeOptions& options, const std::vector<Pose>& poses)
      : outlines_(outlines), atlas_(atlas), fields_(fields), scales_(scales), options_(options), random_(options.seed) {
    image_.pixel = (1 - 2 * options.low) / options.side;
    image_.stride = options.side + 2 * kBorder + 1;
    image_.tiles.assign(options.tiles * options.atlases,
                        std::vector<std::int32_t>(static_cast<std::size_t>(image_.stride) * image_.stride, 0));
    const std::size_t n = outlines.size();
    charts_.pairs.resize(n);
    charts_.overlaps.assign(n, 0);
    charts_.turned.resize(n);
    charts_.samples.resize(n);
    charts_.angle.resize(n);
    charts_.poses.resize(n);
    for (std::int32_t i = 0; i < std::ssize(outlines); ++i) {
      charts_.samples[i] = Samples(i);
      charts_.angle[i] = poses[i].angle;
      charts_.turned[i].resize(kTurns);
      const Vec2 at = (poses[i].centre - Vec2::Constant(options.low)) / image_.pixel;
      int first = 0;
      while (first < kTurns && !At(i, first).fits) ++first;
      if (first == kTurns) too_large_ = true;
      charts_.poses[i] = {first % kTurns, poses[i].tile, static_cast<int>(std::lround(at.x())),
                          static_cast<int>(std::lround(at.y()))};
      Clamp(i, &charts_.poses[i]);
      if (!too_large_) Draw(i, kWeightUnit);
    }
  }

  // Rearrange(); call once.
  bool Run(const Execution& execution, std::vector<Pose>* poses, std::int64_t* work) {
    const auto n = static_cast<std::int32_t>(outlines_.size());
    std::vector<std::int32_t> order = Indices(n);
    bool apart = false;
    std::int64_t least = std::numeric_limits<std::int64_t>::max();  // overlap after a round
    std::vector<CellPose> best;
    while (!too_large_ && moves_ < options_.moves && work_ < options_.work && !execution.IsCancelled() &&
           !execution.IsStopRequested()) {
      for (std::int32_t i = n - 1; i > 0; --i) std::swap(order[i], order[random_.Below(i + 1)]);
      bool any = false;
      for (const std::int32_t i : order) any |= Move(i);
      apart = !any;
      if (apart) break;
      const std::int64_t overlap = Weigh();
      if (overlap < least) {
        least = overlap;
        best = charts_.poses;
      }
    }
    if (!apart && !best.empty()) charts_.poses = best;
    for (std::size_t i = 0; i < charts_.poses.size(); ++i) {
      const CellPose& pose = charts_.poses[i];
      (*poses)[i] = {Vec2::Constant(options_.low) + image_.pixel * Vec2(pose.x, pose.y),
                     charts_.turned[i][pose.turned]->angle, pose.tile};
    }
    *work += work_;
    return apart;
  }

 private:
  // Samples along the outline and, less densely, inside. In random order, so that the first few are spread over the
  // chart.
  std::vector<Vec2> Samples(std::int32_t i) {
    const Outline& outline = outlines_[i];
    const double unit = scales_[i] / image_.pixel;
    std::vector<Vec2> samples;
    double length = 0;
    for (const auto& [from, to] : outline.edges) length += (outline.points[to] - outline.points[from]).norm();
    const double spacing = std::max(1.5 / unit, length / 300);
    double left = 0;  // to the next sample
    for (const auto& [from, to] : outline.edges) {
      const Vec2& a = outline.points[from];
      const Vec2 along = outline.points[to] - a;
      const double edge = along.norm();
      for (; left < edge; left += spacing) samples.push_back(a + left / edge * along);
      left -= edge;
    }
    if (samples.empty()) samples.push_back(outline.points[0]);
    Box box;
    for (const Vec2& p : outline.hull) box.Add(p);
    const Vec2 extent = box.high - box.low;
    const double step = std::max(3.0 / unit, std::sqrt(extent.x() * extent.y() / 150));
    for (double y = box.low.y() + step / 2; y < box.high.y(); y += step) {
      for (double x = box.low.x() + step / 2; x < box.high.x(); x += step) {
        if (fields_[i].DistanceNear(Vec2(x, y), DistanceField::kFar) < -0.3 * step) samples.push_back(Vec2(x, y));
      }
    }
    Random random(1);
    for (int k = static_cast<int>(samples.size()) - 1; k > 0; --k) std::swap(samples[k], samples[random.Below(k + 1)]);
    return samples;
  }

  Turned& At(std::int32_t i, int turn) const {
    std::unique_ptr<Turned>& turned = charts_.turned[i][turn];
    if (turned == nullptr) {
      turned = std::make_unique<Turned>(Turn(i, charts_.angle[i] + 2 * std::numbers::pi * turn / kTurns));
    }
    return *turned;
  }

  Turned Turn(std::int32_t i, double angle) const {
    const std::vector<Vec2>& samples = charts_.samples[i];
    Turned turned;
    turned.angle = angle;
    const Rotation rotate(angle, scales_[i] / image_.pixel);
    for (const Vec2& p : outlines_[i].hull) turned.box.Add(rotate(p));
    turned.fits = (turned.box.high - turned.box.low).maxCoeff() <= options_.side + 1;
    turned.range = {Range(turned, 0), Range(turned, 1)};
    work_ += kTurnWork * std::ssize(samples);
    turned.samples.reserve(samples.size());
    for (const Vec2& p : samples) {
      const Vec2 turned_sample = rotate(p);
      const std::int32_t x = Rounded(turned_sample.x()), y = Rounded(turned_sample.y());
      turned.samples.push_back(y * image_.stride + x);
    }
    return turned;
  }

  // Range of x (axis 0) or y (axis 1) in which the chart is within the tile; the middle if it is too large.
  std::pair<int, int> Range(const Turned& turned, int axis) const {
    const int low = static_cast<int>(std::ceil(-turned.box.low[axis] - 0.5));
    const int high = static_cast<int>(std::floor(options_.side - turned.box.high[axis] + 0.5));
    if (low <= high) return {low, high};
    const int middle =
        static_cast<int>(std::lround((options_.side - turned.box.high[axis] - turned.box.low[axis]) / 2));
    return {middle, middle};
  }

  void Clamp(std::int32_t i, CellPose* pose) const {
    const Turned& turned = At(i, pose->turned);
    const auto [x0, x1] = turned.range[0];
    const auto [y0, y1] = turned.range[1];
    pose->x = std::clamp(pose->x, x0, x1);
    pose->y = std::clamp(pose->y, y0, y1);
  }

  void MeasureDepth(std::int32_t i, Turned* turned) const {
    const double reach = options_.distance / image_.pixel - options_.slack;  // beyond the outline, in pixels
    const double out = std::max(reach, 0.0) + 1;
    turned->left = static_cast<int>(std::floor(turned->box.low.x() - out));
    turned->bottom = static_cast<int>(std::floor(turned->box.low.y() - out));
    turned->width = static_cast<int>(std::ceil(turned->box.high.x() + out)) - turned->left + 1;
    turned->height = static_cast<int>(std::ceil(turned->box.high.y() + out)) - turned->bottom + 1;
    work_ += kDepthWork * turned->width * turned->height;
    turned->depth.assign(static_cast<std::size_t>(turned->width) * turned->height, 0);
    const double unit = scales_[i] / image_.pixel;
    const double c = portable::Cos(turned->angle) / unit, s = portable::Sin(turned->angle) / unit;
    turned->rows.assign(turned->height, {0, 0});
    std::int16_t* depth = turned->depth.data();
    std::vector<float> distances(turned->width);
    const auto per_unit = static_cast<float>(unit * kDepthUnit), zero = static_cast<float>(reach * kDepthUnit);
    for (int y = 0; y < turned->height; ++y, depth += turned->width) {
      const double px = turned->left, py = y + turned->bottom;
      fields_[i].Sample(Vec2(c * px + s * py, c * py - s * px), Vec2(c, -s), turned->width, distances.data());
      Span& row = turned->rows[y];
      for (int x = 0; x < turned->width; ++x) {
        const float d = zero - distances[x] * per_unit;
        if (d <= 0) continue;
        depth[x] = static_cast<std::int16_t>(std::min(d + 1, 4000.0f));
        if (row.end == 0) row.begin = x;
        row.end = x + 1;
      }
    }
    turned->own = DepthUnder(*turned, *turned, 0, 0);
  }

  // Derives (x, y) from the samples' offsets, which is unique since a chart that fits the tile reaches at most half a
  // row to either side. Computed on demand, since thousands of rotations are kept and few need it.
  void FindPlaces(Turned* turned) const {
    turned->places.reserve(turned->samples.size());
    for (const std::int32_t sample : turned->samples) {
      const int from = sample + image_.stride / 2, y = from / image_.stride - (from % image_.stride < 0 ? 1 : 0);
      turned->places.push_back({static_cast<std::int16_t>(sample - y * image_.stride), static_cast<std::int16_t>(y)});
    }
  }

  // The sum of `other`'s depth under the samples of `turned`, shifted by (x, y) pixels relative to `other`.
  std::int64_t DepthUnder(Turned& turned, const Turned& other, int x, int y) const {
    if (turned.places.empty()) FindPlaces(&turned);
    x -= other.left;
    y -= other.bottom;
    const auto width = static_cast<unsigned>(other.width), height = static_cast<unsigned>(other.height);
    std::int64_t sum = 0;
    work_ += std::ssize(turned.places);
    for (const auto& place : turned.places) {
      const auto u = static_cast<unsigned>(place[0] + x), v = static_cast<unsigned>(place[1] + y);
      if (u < width && v < height) sum += other.depth[static_cast<std::size_t>(v) * width + u];
    }
    return sum;
  }

  void Draw(std::int32_t i, std::int64_t weight64) {
    const auto weight = static_cast<std::int16_t>(weight64);
    const CellPose& pose = charts_.poses[i];
    Turned& turned = At(i, pose.turned);
    if (turned.depth.empty()) MeasureDepth(i, &turned);
    const int left = turned.left + pose.x + kBorder, bottom = turned.bottom + pose.y + kBorder;
    const int first = std::max(0, -bottom), last = std::min(turned.height, image_.stride - bottom);
    work_ += kRowWork * (last - first);
    for (int y = first; y < last; ++y) {
      const int begin = std::max(turned.rows[y].begin, -left), end = std::min(turned.rows[y].end, image_.stride - left);
      std::int32_t* to =
          image_.tiles[pose.tile].data() + static_cast<std::ptrdiff_t>(y + bottom) * image_.stride + left;
      const std::int16_t* from = turned.depth.data() + static_cast<std::ptrdiff_t>(y) * turned.width;
      for (int x = begin; x < end; ++x) to[x] += weight * from[x];
    }
  }

  // The sum of the image under the samples. May stop at any value of at least `bound`.
  std::int64_t Cost(std::int32_t i, const CellPose& pose, std::int64_t bound) const {
    const std::vector<std::int32_t>& samples = At(i, pose.turned).samples;
    const std::int32_t* image = image_.tiles[pose.tile].data() +
                                static_cast<std::ptrdiff_t>(pose.y + kBorder) * image_.stride + pose.x + kBorder;
    std::int64_t cost = 0;
    std::size_t k = 0;
    const std::size_t n = samples.size();
    while (k + 8 <= n) {
      std::int64_t part = 0;
      for (int j = 0; j < 8; ++j) part += image[samples[k + j]];
      cost += part;
      work_ += 8;
      if (cost >= bound) return cost;
      k += 8;
    }
    for (; k < n; ++k) cost += image[samples[k]];
    return cost;
  }

  // Sets *pose to a random rotation and place. Returns false if the chart does not fit the tile at this rotation.
  bool RandomPose(std::int32_t i, CellPose* pose) {
    pose->turned = kFineTurns * random_.Below(kAngles);
    const Turned& turned = At(i, pose->turned);
    if (!turned.fits) return false;
    pose->tile = atlas_[i] * options_.tiles + (options_.tiles == 1 ? 0 : random_.Below(options_.tiles));
    const auto [x0, x1] = turned.range[0];
    const auto [y0, y1] = turned.range[1];
    pose->x = x0 + random_.Below(x1 - x0 + 1);
    pose->y = y0 + random_.Below(y1 - y0 + 1);
    return true;
  }

  // Local search: moves *pose to the best of its neighbours until none is better.
  void Descend(std::int32_t i, CellPose* pose, std::int64_t* cost) const {
    for (int step = 4; step >= 1 && *cost > 0;) {
      CellPose best = *pose;
      std::int64_t best_cost = *cost;
      const auto look = [&](CellPose other) {
        if (!At(i, other.turned).fits) return;
        Clamp(i, &other);
        const std::int64_t value = Cost(i, other, best_cost);
        if (value < best_cost) {
          best_cost = value;
          best = other;
        }
      };
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          if (dx != 0 || dy != 0) look({pose->turned, pose->tile, pose->x + step * dx, pose->y + step * dy});
        }
      }
      look({(pose->turned + step) % kTurns, pose->tile, pose->x, pose->y});
      look({(pose->turned + kTurns - step) % kTurns, pose->tile, pose->x, pose->y});
      if (best_cost < *cost) {
        *pose = best;
        *cost = best_cost;
      } else {
        step /= 2;
      }
    }
  }

  // The depth of i's samples in j, summed.
  std::int64_t Overlap(std::int32_t i, std::int32_t j) {
    const CellPose &p = charts_.poses[i], &q = charts_.poses[j];
    if (p.tile != q.tile) return 0;
    Turned& a = At(i, p.turned);
    const Turned& b = At(j, q.turned);
    if (p.x + a.box.high.x() + 1 < q.x + b.left || p.x + a.box.low.x() - 1 > q.x + b.left + b.width) return 0;
    if (p.y + a.box.high.y() + 1 < q.y + b.bottom || p.y + a.box.low.y() - 1 > q.y + b.bottom + b.height) return 0;
    return DepthUnder(a, b, p.x - q.x, p.y - q.y);
  }

  // Increases the weights of pairs that overlap, by how much they overlap, and decreases the others. Returns the sum of
  // overlaps.
  std::int64_t Weigh() {
    const auto n = static_cast<std::int32_t>(charts_.poses.size());
    struct Found {
      std::int32_t i, j;
      std::int64_t overlap;
    };
    std::vector<Found> found;
    std::int64_t most = 1, sum = 0;
    for (std::int32_t i = 0; i < n; ++i) {
      if (!charts_.overlaps[i]) continue;
      work_ += n;
      for (std::int32_t j = 0; j < n; ++j) {
        if (i == j || (charts_.overlaps[j] && j < i)) continue;
        const std::int64_t overlap = Overlap(i, j) + Overlap(j, i);
        if (overlap == 0) continue;
        found.push_back({i, j, overlap});
        most = std::max(most, overlap);
        sum += overlap;
      }
    }
    for (auto& pairs : charts_.pairs) {
      for (Pair& pair : pairs) pair.weight *= 0.95;
      std::erase_if(pairs, [](const Pair& pair) { return pair.weight < 1; });
    }
    for (const Found& f : found) {
      const double factor = 1.2 + 0.8 * static_cast<double>(f.overlap) / static_cast<double>(most);
      Raise(f.i, f.j, factor);
      Raise(f.j, f.i, factor);
    }
    return sum;
  }

  void Raise(std::int32_t i, std::int32_t j, double factor) {
    for (Pair& pair : charts_.pairs[i]) {
      if (pair.other != j) continue;
      pair.weight = std::min(kMostWeight, pair.weight / 0.95 * factor);
      return;
    }
    charts_.pairs[i].push_back({j, factor});
  }

  // With `times` 1, removes chart i from the image, and draws its partners in pairs once more with the part of the
  // pair's weight that exceeds 1. With -1, undoes that.
  void Lift(std::int32_t i, int times) {
    Draw(i, -times * kWeightUnit);
    for (const Pair& pair : charts_.pairs[i]) Draw(pair.other, times * std::lround(kWeightUnit * (pair.weight - 1)));
  }

  // Moves the chart to a better place if it overlaps others. Returns whether it overlapped others and still does.
  bool Move(std::int32_t i) {
    constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
    charts_.overlaps[i] = false;
    const std::int64_t own = kWeightUnit * At(i, charts_.poses[i].turned).own;
    if (Cost(i, charts_.poses[i], kMost) == own) return false;
    Lift(i, 1);
    std::int64_t cost = Cost(i, charts_.poses[i], kMost);
    ++moves_;
    CellPose best = charts_.poses[i];
    Descend(i, &best, &cost);
    constexpr int kKept = 3;
    std::array<std::pair<std::int64_t, CellPose>, kKept> kept;
    kept.fill({kMost, {}});
    for (int k = 0; k < kTries && cost > 0; ++k) {
      CellPose pose;
      if (!RandomPose(i, &pose)) continue;
      const std::int64_t value = Cost(i, pose, kept.back().first);
      if (value >= kept.back().first) continue;
      kept.back() = {value, pose};
      for (int m = kKept - 1; m > 0 && kept[m].first < kept[m - 1].first; --m) std::swap(kept[m], kept[m - 1]);
    }
    for (auto& [value, pose] : kept) {
      if (value == kMost || cost == 0) continue;
      Descend(i, &pose, &value);
      if (value < cost) {
        cost = value;
        best = pose;
      }
    }
    charts_.poses[i] = best;
    charts_.overlaps[i] = cost > 0;
    Lift(i, -1);
    return cost > 0;
  }

  const std::vector<Outline>& outlines_;
  const std::vector<int>& atlas_;
  const std::vector<DistanceField>& fields_;
  const std::vector<double>& scales_;
  const RearrangeOptions& options_;
  Random random_;
  struct {
    double pixel;  // in the texture
    int stride;
    std::vector<std::vector<std::int32_t>> tiles;  // weighted depth of each pixel in the charts
  } image_;
  struct Pair {
    std::int32_t other;
    double weight;
  };
  // Data of the charts; each vector has one element per chart.
  struct {
    std::vector<std::vector<Pair>> pairs;  // the pairs with weights above 1
    std::vector<char> overlaps;            // whether it overlapped others after its last move
    std::vector<double> angle;             // at turn 0
    std::vector<std::vector<Vec2>> samples;
    mutable std::vector<std::vector<std::unique_ptr<Turned>>> turned;  // computed on demand
    std::vector<CellPose> poses;
  } charts_;
  bool too_large_ = false;  // some chart is too large for the tile
  std::int64_t moves_ = 0;
  mutable std::int64_t work_ = 0;
};

}  // namespace

bool Rearrange(const std::vector<Outline>& outlines, const std::vector<int>& atlas,
               const std::vector<DistanceField>& fields, const std::vector<double>& scales,
               const RearrangeOptions& options, const Execution& execution, std::vector<Pose>* poses,
               std::int64_t* work) {
  return Search(outlines, atlas, fields, scales, options, *poses).Run(execution, poses, work);
}

}  // namespace planish
