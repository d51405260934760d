#include "core/pack/silhouette.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/mesh/box_tree.h"

namespace planish {
namespace {

constexpr double kRounding = 1e-9;  // cells, relative to 1; added wherever rounding could lose a cell

// The cells within `radius` of the segment ab, row by row.
struct Capsule {
  Vec2 a, b;
  double radius;
  Vec2 offset;  // from the segment to its right side; its length is `radius`

  Capsule(const Vec2& from, const Vec2& to, double r) : a(from), b(to), radius(r), offset(r, 0) {
    if (a.y() > b.y()) std::swap(a, b);
    const Vec2 along = b - a;
    const double length = along.norm();
    if (length > 0) offset = Vec2(along.y(), -along.x()) * (radius / length);
  }

  // sign * x of the rightmost (sign 1) or leftmost (sign -1) point of the capsule at height y, where the capsule must
  // have a point.
  double End(double y, double sign) const {
    const double height = std::clamp(y, a.y(), b.y());
    const double along = b.y() > a.y() ? (height - a.y()) / (b.y() - a.y()) : 0;
    double best = sign * (a.x() + along * (b.x() - a.x()));  // on the segment itself
    for (const Vec2& p : {a, b}) {
      const double dy = y - p.y();
      if (std::abs(dy) <= radius) {
        best = std::max(best, sign * p.x() + std::sqrt(std::max(0.0, radius * radius - dy * dy)));
      }
    }
    const Vec2 shift = sign * offset;
    const double low = a.y() + shift.y(), high = b.y() + shift.y();
    if (high > low && y >= low && y <= high) {
      const double t = (y - low) / (high - low);
      best = std::max(best, sign * (a.x() + shift.x() + t * (b.x() - a.x())));
    }
    return best;
  }

  // The largest sign * x of the capsule's points with y0 <= y <= y1. There must be such a point.
  double Farthest(double y0, double y1, double sign) const {
    const Vec2& tip = sign * a.x() >= sign * b.x() ? a : b;
    const double low = std::max(y0, a.y() - radius), high = std::min(y1, b.y() + radius);
    // On a vertical segment all points are equally far.
    const double at = a.x() == b.x() ? std::clamp(low, a.y(), b.y()) : tip.y();
    return End(std::clamp(at, std::min(low, high), std::max(low, high)), sign);
  }
};

class Grid {
 public:
  Grid(int width, int height)
      : width_(width),
        height_(height),
        words_((width + 63) / 64),
        bits_(static_cast<std::size_t>(words_) * height, 0) {}

  void Set(int y, int begin, int end) {
    begin = std::max(begin, 0);
    end = std::min(end, width_);
    if (begin < end) SetBits(bits_.data() + static_cast<std::size_t>(y) * words_, begin, end);
  }

  // Swaps rows and columns.
  Grid Transposed() const {
    Grid to(height_, width_);
    std::array<std::uint64_t, 64> block;
    for (int top = 0; top < height_; top += 64) {
      const int rows = std::min(64, height_ - top);
      for (int w = 0; w < words_; ++w) {
        for (int y = 0; y < rows; ++y) block[y] = bits_[static_cast<std::size_t>(top + y) * words_ + w];
        std::fill(block.begin() + rows, block.end(), 0);
        Transpose(&block);
        for (int x = 0; x < std::min(64, width_ - 64 * w); ++x) {
          to.bits_[static_cast<std::size_t>(64 * w + x) * to.words_ + top / 64] = block[x];
        }
      }
    }
    return to;
  }

  void Extract(Silhouette* s) const {
    s->width = width_;
    s->height = height_;
    s->row_begin.reserve(height_ + 1);
    for (int y = 0; y < height_; ++y) {
      s->row_begin.push_back(static_cast<std::int32_t>(s->spans.size()));
      const std::uint64_t* row = bits_.data() + static_cast<std::size_t>(y) * words_;
      int x = 0;
      while (true) {
        const int begin = Find(row, x, 0);
        if (begin >= width_) break;
        const int end = std::min(width_, Find(row, begin, ~std::uint64_t{0}));
        s->spans.push_back({begin, end});
        s->cells += end - begin;
        x = end;
      }
    }
    s->row_begin.push_back(static_cast<std::int32_t>(s->spans.size()));
  }

 private:
  // Transposes 64 rows of 64 bits: swaps squares of 32 bits across the diagonal, then those of 16 within each, and so
  // on.
  static void Transpose(std::array<std::uint64_t, 64>* rows) {
    std::uint64_t low = ~std::uint64_t{0} >> 32;  // mask of the lower half of each square
    for (int half = 32; half >= 1; half /= 2) {
      for (int y = 0; y < 64; ++y) {
        if ((y & half) != 0) continue;
        std::uint64_t &above = (*rows)[y], &below = (*rows)[y + half];
        const std::uint64_t differ = (above >> half ^ below) & low;
        above ^= differ << half;
        below ^= differ;
      }
      low ^= low << half / 2;
    }
  }

  // The first bit from x on that differs from those of `flip`; width_ or more if there is none.
  int Find(const std::uint64_t* row, int x, std::uint64_t flip) const {
    int w = x >> 6;
    if (w >= words_) return width_;
    std::uint64_t word = (row[w] ^ flip) & (~std::uint64_t{0} << (x & 63));
    while (word == 0) {
      if (++w == words_) return width_;
      word = row[w] ^ flip;
    }
    return 64 * w + __builtin_ctzll(word);
  }

  int width_, height_, words_;
  std::vector<std::uint64_t> bits_;
};

// The result of MakeSilhouette() if `at` is null, of MakeFixedSilhouette() otherwise: shifted by less than a cell.
Silhouette Rasterize(const Outline& outline, double angle, double scale, double radius, const Vec2* at) {
  const Rotation rotate(angle, scale);
  radius += scale * outline.slack;
  std::vector<Vec2> points(outline.points.size());
  Box box;
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i] = rotate(outline.points[i]);
    box.Add(points[i]);
  }
  const double margin = radius + kRounding * (1 + scale * outline.radius);
  Silhouette silhouette;
  silhouette.centre = Vec2::Constant(margin) - box.low;
  Vec2 shift = Vec2::Zero();
  if (at != nullptr) shift = *at - silhouette.centre;
  shift -= Vec2(std::floor(shift.x()), std::floor(shift.y()));
  silhouette.centre += shift;
  for (Vec2& p : points) p += silhouette.centre;
  const Vec2 extent = box.high - box.low + Vec2::Constant(2 * margin) + shift;
  const int width = std::max(1, Ceil(extent.x()));
  const int height = std::max(1, Ceil(extent.y()));
  Grid grid(width, height);

  ScanLines middles;
  const double slack = margin - radius;
  for (const auto& [from, to] : outline.edges) {
    const Capsule capsule(points[from], points[to], radius + slack);
    const int first = std::max(0, Floor(capsule.a.y() - capsule.radius));
    const int last = std::min(height - 1, Floor(capsule.b.y() + capsule.radius));
    for (int y = first; y <= last; ++y) {
      const double left = -capsule.Farthest(y, y + 1, -1), right = capsule.Farthest(y, y + 1, 1);
      grid.Set(y, Floor(left), Floor(right) + 1);
    }
    middles.AddEdge(points[from], points[to], 0.5);
  }
  middles.ForEachInside([&](int y, int begin, int end) { grid.Set(y, begin, end); });
  grid.Extract(&silhouette);
  return silhouette;
}

}  // namespace

Silhouette MakeSilhouette(const Outline& outline, double angle, double scale, double radius) {
  return Rasterize(outline, angle, scale, radius, nullptr);
}

Silhouette QuarterTurn(const Silhouette& s) {
  Silhouette turned;
  turned.centre = Vec2(s.height - s.centre.y(), s.centre.x());
  // A row of the new grid is a column of the old one, read from the top.
  Grid grid(s.width, s.height);
  for (int y = 0; y < s.height; ++y) {
    for (std::int32_t i = s.row_begin[y]; i < s.row_begin[y + 1]; ++i) {
      grid.Set(s.height - 1 - y, s.spans[i].begin, s.spans[i].end);
    }
  }
  grid.Transposed().Extract(&turned);
  return turned;
}

Silhouette HalfTurn(const Silhouette& s) {
  Silhouette turned = {s.width, s.height, {}, {}, Vec2(s.width - s.centre.x(), s.height - s.centre.y()), s.cells};
  const auto spans = static_cast<std::int32_t>(s.spans.size());
  turned.row_begin.reserve(s.row_begin.size());
  for (auto begin = s.row_begin.rbegin(); begin != s.row_begin.rend(); ++begin)
    turned.row_begin.push_back(spans - *begin);
  turned.spans.reserve(s.spans.size());
  for (auto span = s.spans.rbegin(); span != s.spans.rend(); ++span) {
    turned.spans.push_back({s.width - span->end, s.width - span->begin});
  }
  return turned;
}

FixedSilhouette MakeFixedSilhouette(const Outline& outline, double angle, double scale, double radius, const Vec2& at) {
  Silhouette silhouette = Rasterize(outline, angle, scale, radius, &at);
  const Vec2 corner = at - silhouette.centre;
  return {std::move(silhouette), static_cast<int>(std::lround(corner.x())), static_cast<int>(std::lround(corner.y()))};
}

}  // namespace planish
