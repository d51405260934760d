#include "core/unwrap/outlines.h"

#include <utility>

#include "core/mesh/box_tree.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/predicates.h"

namespace planish {
namespace {

Vec2 Uv(const CornerUv& uv, std::int32_t corner) {
  return {uv[2 * corner], uv[2 * corner + 1]};
}
Vec2 From(const CornerUv& uv, std::int32_t c) {
  return Uv(uv, 3 * (c / 3) + Next(c % 3));
}
Vec2 To(const CornerUv& uv, std::int32_t c) {
  return Uv(uv, 3 * (c / 3) + Prev(c % 3));
}

// Half-edges on outlines, loop by loop.
struct Outlines {
  std::vector<std::int32_t> half_edge;
  std::vector<std::int32_t> begin = {0};  // of each loop in half_edge, and the end
  std::vector<std::int32_t> loop;         // of each in half_edge
  bool is_torn = false;
};

Outlines Trace(const std::vector<std::int32_t>& opposite, const CornerUv& uv, const Execution& execution) {
  struct Part {
    std::vector<std::int32_t> outline;
    bool is_torn = false;
  };
  Outlines outlines;
  std::vector<std::int32_t> starts;
  for (const Part& part :
       execution.Collect<Part>(static_cast<std::int64_t>(opposite.size()), [&](std::int64_t begin, std::int64_t end) {
         Part chunk;
         for (auto c = static_cast<std::int32_t>(begin); c < end; ++c) {
           const std::int32_t o = opposite[c];
           if (o < 0) {
             chunk.outline.push_back(c);
           } else if (o < c && (From(uv, c) != To(uv, o) || To(uv, c) != From(uv, o))) {
             chunk.is_torn = true;
           }
         }
         return chunk;
       })) {
    outlines.is_torn |= part.is_torn;
    starts.insert(starts.end(), part.outline.begin(), part.outline.end());
  }
  if (outlines.is_torn || execution.IsStopped()) return outlines;
  std::vector<char> seen(opposite.size(), 0);
  for (const std::int32_t start : starts) {
    if (seen[start]) continue;
    const auto loop = static_cast<std::int32_t>(outlines.begin.size()) - 1;
    for (std::int32_t c = start; !seen[c]; c = NextOnOutline(opposite, c)) {
      seen[c] = 1;
      outlines.half_edge.push_back(c);
      outlines.loop.push_back(loop);
    }
    outlines.begin.push_back(static_cast<std::int32_t>(outlines.half_edge.size()));
  }
  return outlines;
}

// Per loop: the chart it belongs to, some number.
std::vector<std::int32_t> ChartsOf(const std::vector<std::int32_t>& opposite, const Outlines& outlines,
                                   std::int32_t* count) {
  std::vector<std::int32_t> chart(opposite.size() / 3, -1), of_loop, stack;
  for (std::size_t loop = 0; loop + 1 < outlines.begin.size(); ++loop) {
    const std::int32_t start = outlines.half_edge[outlines.begin[loop]] / 3;
    if (chart[start] < 0) {
      chart[start] = (*count)++;
      stack.push_back(start);
    }
    while (!stack.empty()) {
      const std::int32_t f = stack.back();
      stack.pop_back();
      for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
        const std::int32_t o = opposite[c];
        if (o < 0 || chart[o / 3] >= 0) continue;
        chart[o / 3] = chart[f];
        stack.push_back(o / 3);
      }
    }
    of_loop.push_back(chart[start]);
  }
  return of_loop;
}

BoxTree TreeOf(const Outlines& outlines, const CornerUv& uv, const Execution& execution) {
  std::vector<Box> boxes(outlines.half_edge.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    boxes[i].Add(From(uv, outlines.half_edge[i]));
    boxes[i].Add(To(uv, outlines.half_edge[i]));
  }
  return BoxTree(std::move(boxes), execution);
}

bool DoNotMeet(const Outlines& outlines, const CornerUv& uv, const BoxTree& tree, const Execution& execution) {
  const auto n = static_cast<std::int32_t>(outlines.half_edge.size());
  const auto follower = [&](std::int32_t i) {
    const std::int32_t loop = outlines.loop[i];
    return i + 1 == outlines.begin[loop + 1] ? outlines.begin[loop] : i + 1;
  };
  const std::vector<char> parts = execution.Collect<char>(n, [&](std::int64_t begin, std::int64_t end) -> char {
    for (auto i = static_cast<std::int32_t>(begin); i < end && !execution.IsStoppedAt(i); ++i) {
      const Vec2 from = From(uv, outlines.half_edge[i]), to = To(uv, outlines.half_edge[i]);
      const bool clear = tree.ForEachMeeting(tree.boxes()[i], [&](std::int32_t j) {
        if (j <= i) return true;
        const Vec2 other_from = From(uv, outlines.half_edge[j]), other_to = To(uv, outlines.half_edge[j]);
        const bool follows = follower(i) == j, precedes = follower(j) == i;
        if (!follows && !precedes) return !SegmentsMeet(from, to, other_from, other_to);
        // Neighbours share an end; they meet elsewhere only if one folds back onto the other.
        const Vec2 &a = follows ? from : other_from, &b = follows ? to : other_to, &c = follows ? other_to : to;
        return !(Orientation(a, b, c) == 0 && (b - a).dot(c - b) <= 0);
      });
      if (!clear) return 1;
    }
    return 0;
  });
  for (const char meets : parts) {
    if (meets) return false;
  }
  return !execution.IsStopped();
}

// Whether the outlines of other charts wind round some point of each chart's outline.
bool LiesInsideAnother(const Outlines& outlines, const std::vector<std::int32_t>& chart_of_loop,
                       std::int32_t num_charts, const CornerUv& uv, const BoxTree& tree, const Execution& execution) {
  Box all;
  for (const Box& box : tree.boxes()) all.Add(box);
  std::vector<char> done(num_charts, 0);
  for (std::size_t loop = 0; loop < chart_of_loop.size() && !execution.IsStopped(); ++loop) {
    const std::int32_t chart = chart_of_loop[loop];
    if (done[chart]) continue;
    done[chart] = 1;
    // A ray to the right, and how often outlines cross it.
    const Vec2 p = From(uv, outlines.half_edge[outlines.begin[loop]]);
    Box ray;
    ray.Add(p);
    ray.Add(Vec2(all.high.x(), p.y()));
    int winding = 0;
    tree.ForEachMeeting(ray, [&](std::int32_t j) {
      if (chart_of_loop[outlines.loop[j]] == chart) return true;
      const Vec2 from = From(uv, outlines.half_edge[j]), to = To(uv, outlines.half_edge[j]);
      if (from.y() <= p.y() && to.y() > p.y() && Orientation(from, to, p) > 0) ++winding;
      if (from.y() > p.y() && to.y() <= p.y() && Orientation(from, to, p) < 0) --winding;
      return true;
    });
    if (winding != 0) return true;
  }
  return false;
}

}  // namespace

bool OutlinesAreApart(const std::vector<std::int32_t>& opposite, const CornerUv& uv, const Execution& execution) {
  const Outlines outlines = Trace(opposite, uv, execution);
  if (outlines.is_torn || outlines.half_edge.empty() || execution.IsStopped()) return false;
  const BoxTree tree = TreeOf(outlines, uv, execution);
  if (!DoNotMeet(outlines, uv, tree, execution)) return false;
  if (outlines.begin.size() == 2) return true;  // one loop
  std::int32_t num_charts = 0;
  const std::vector<std::int32_t> chart_of_loop = ChartsOf(opposite, outlines, &num_charts);
  return !LiesInsideAnother(outlines, chart_of_loop, num_charts, uv, tree, execution) && !execution.IsStopped();
}

}  // namespace planish
