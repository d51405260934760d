#include "core/pack/board.h"

#include <algorithm>
#include <bit>
#include <cassert>

namespace planish {
namespace {

constexpr std::uint64_t kAll = ~std::uint64_t{0};
// Silhouettes added to a row before its longest run of free cells is measured again.
constexpr int kStale = 8;
// Cost of a search in nanoseconds: per row, per probe, and per word of a probe. Each cell of the rim costs 1 more.
constexpr std::int64_t kNanosPerRow = 1, kNanosPerProbe = 4, kNanosPerWord = 2;

// The longest run of bits that are 0.
int LongestRun(const std::uint64_t* words, int count) {
  int longest = 0, run = 0;
  for (int w = 0; w < count; ++w) {
    for (int at = 0; at < 64;) {
      const std::uint64_t rest = words[w] >> at;
      const int zeros = std::min(std::countr_zero(rest), 64 - at);
      run += zeros;
      longest = std::max(longest, run);
      at += zeros;
      if (at == 64) break;
      run = 0;
      at += std::min(std::countr_one(words[w] >> at), 64 - at);
    }
  }
  return longest;
}

}  // namespace

// Orders the probes by rows: the row with the longest span, the first and the last row, then rows in between, spread
// out.
Probes::Probes(const Silhouette& s) {
  all.reserve(s.spans.size());
  std::vector<std::int32_t> longest_of(s.height, 0);
  for (std::int32_t y = 0; y < s.height; ++y) {
    for (std::int32_t i = s.row_begin[y]; i < s.row_begin[y + 1]; ++i) {
      longest_of[y] = std::max(longest_of[y], s.spans[i].end - s.spans[i].begin);
    }
  }
  std::vector<char> used(s.height, 0);
  std::size_t rows = 0;
  const auto use = [&](std::int32_t y) {
    if (used[y]) return;
    used[y] = 1;
    if (rows < kChecked) longest[rows] = {y, longest_of[y]};
    ++rows;
    for (std::int32_t i = s.row_begin[y]; i < s.row_begin[y + 1]; ++i) {
      const auto [begin, end] = s.spans[i];
      const int level = std::bit_width(static_cast<unsigned>(end - begin)) - 1, second = end - (1 << level);
      all.push_back({static_cast<std::int16_t>(y),
                     {static_cast<std::int16_t>(begin >> 6), static_cast<std::int16_t>(second >> 6)},
                     {static_cast<std::int8_t>(begin & 63), static_cast<std::int8_t>(second & 63)},
                     static_cast<std::int8_t>(level)});
    }
  };
  use(static_cast<std::int32_t>(std::max_element(longest_of.begin(), longest_of.end()) - longest_of.begin()));
  use(0);
  use(s.height - 1);
  for (std::int32_t step = std::bit_floor(static_cast<std::uint32_t>(s.height)); step >= 1; step /= 2) {
    for (std::int32_t y = step; y < s.height; y += step) use(y);
  }
}

Rim MakeRim(const Silhouette& s, int most) {
  Rim rim;
  const auto add = [&](int x, int y) {
    rim.cells.push_back({static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)});
  };
  const auto row = [&](int y) {
    return y < 0 || y >= s.height ? std::pair(0, 0) : std::pair(s.row_begin[y], s.row_begin[y + 1]);
  };
  // Left and right neighbours of spans, and cells above or below a span that are in no span themselves.
  for (int y = -1; y <= s.height; ++y) {
    const auto [begin, end] = row(y);
    for (int i = begin; i < end; ++i) {
      add(s.spans[i].begin - 1, y);
      if (i + 1 == end || s.spans[i + 1].begin > s.spans[i].end + 1) add(s.spans[i].end, y);
    }
    for (const int other : {y - 1, y + 1}) {
      const auto [other_begin, other_end] = row(other);
      for (int i = other_begin; i < other_end; ++i) {
        // The parts of the span that no span of row y covers.
        int x = s.spans[i].begin;
        const auto add_until = [&](int to) {
          for (; x < std::min(to, s.spans[i].end); ++x) add(x, y);
        };
        for (int k = begin; k < end && s.spans[k].begin < s.spans[i].end; ++k) {
          add_until(s.spans[k].begin);
          x = std::max(x, s.spans[k].end);
        }
        add_until(s.spans[i].end);
      }
    }
  }
  const auto count = static_cast<std::int64_t>(rim.cells.size());
  if (count > most) {
    for (int i = 0; i < most; ++i) rim.cells[i] = rim.cells[i * count / most];
    rim.cells.resize(most);
    rim.cells.shrink_to_fit();  // thousands of rims are kept
  }
  return rim;
}

Board::Board(int most_side, int longest) : stride_((most_side + 2 * kMargin + 63) / 64 + 2) {
  assert(most_side <= kMostCells);
  const int size = most_side + 2 * kMargin;
  // The number of levels that suffices to test the longest span.
  const int levels = std::bit_width(static_cast<unsigned>(std::min(longest, size)));
  levels_.assign(levels, std::vector<std::uint64_t>(static_cast<std::size_t>(stride_) * size, kAll));
}

void Board::Clear(int side, std::int64_t* work) {
  side_ = side;
  size_ = side + 2 * kMargin;
  *work += std::ssize(levels_) * size_ * stride_;
  stale_.assign(size_, 0);
  longest_free_.assign(size_, 0);
  std::fill_n(longest_free_.begin() + kMargin, side_, side_);
  for (std::size_t k = 0; k < levels_.size(); ++k) {
    std::vector<std::uint64_t> row(stride_, kAll);
    for (int x = kMargin; x < kMargin + side_ + 1 - (1 << k); ++x) row[x >> 6] &= ~(std::uint64_t{1} << (x & 63));
    for (int y = kMargin; y < kMargin + side_; ++y) {
      std::copy(row.begin(), row.end(), levels_[k].begin() + static_cast<std::ptrdiff_t>(y) * stride_);
    }
    std::fill(levels_[k].begin() + static_cast<std::ptrdiff_t>(kMargin + side_) * stride_,
              levels_[k].begin() + static_cast<std::ptrdiff_t>(size_) * stride_, kAll);
  }
}

void Board::Add(const Silhouette& s, int x, int y, int shift, std::int64_t* work) {
  const int first_row = kMargin + (y >> shift), last_row = kMargin + ((y + s.height - 1) >> shift);
  for (int row = std::max(0, first_row); row <= std::min(size_ - 1, last_row); ++row) {
    std::uint64_t* const taken = levels_[0].data() + static_cast<std::size_t>(row) * stride_;
    const int begin_row = std::max(0, ((row - kMargin) << shift) - y);
    const int end_row = std::min(s.height, ((row - kMargin + 1) << shift) - y);
    int lowest = size_, highest = -1;  // cells newly taken in this row
    for (std::int32_t i = s.row_begin[begin_row]; i < s.row_begin[end_row]; ++i) {
      const int begin = std::max(0, kMargin + ((x + s.spans[i].begin) >> shift));
      const int last = std::min(size_ - 1, kMargin + ((x + s.spans[i].end - 1) >> shift));
      if (begin > last) continue;
      lowest = std::min(lowest, begin);
      highest = std::max(highest, last);
      SetBits(taken, begin, last + 1);
    }
    if (highest < 0) continue;
    if (++stale_[row] == kStale) {
      stale_[row] = 0;
      longest_free_[row] = LongestRun(taken, stride_);
      *work += stride_;
    }
    for (std::size_t k = 1; k < levels_.size(); ++k) {
      // A run that holds one of these cells begins less than its length before it.
      const int begin_word = std::max(0, lowest - (1 << k) + 1) >> 6, end_word = (highest >> 6) + 1;
      const int reach = 1 << (k - 1), q = reach >> 6, b = reach & 63;
      const std::uint64_t* below = levels_[k - 1].data() + static_cast<std::size_t>(row) * stride_;
      std::uint64_t* above = levels_[k].data() + static_cast<std::size_t>(row) * stride_;
      *work += end_word - begin_word;
      for (int w = begin_word; w < end_word; ++w) {
        const std::uint64_t low = w + q < stride_ ? below[w + q] : kAll;
        const std::uint64_t high = w + q + 1 < stride_ ? below[w + q + 1] : kAll;
        above[w] = below[w] | (b == 0 ? low : low >> b | high << (64 - b));
      }
    }
  }
}

template <int kWords>
bool Board::FreePlacesIn(const Probes& probes, int y, std::uint64_t* places, int words, std::int64_t* work) const {
  const int count = kWords > 0 ? kWords : words;
  std::uint64_t own[kWords > 0 ? kWords : 1];
  std::uint64_t* const free = kWords > 0 ? own : places;
  std::fill_n(free, count, kAll);
  std::int64_t read = 0;
  std::uint64_t any = kAll;
  int begin = 0, end = count;  // the range of words with free places; all words if kWords > 0
  for (const Probes::Probe& probe : probes.all) {
    assert(probe.level < std::ssize(levels_));
    const std::uint64_t* const row = Row(probe.level, y + probe.row);
    const std::uint64_t* const a = row + probe.words[0];
    const std::uint64_t* const b = row + probe.words[1];
    // Words are shifted left in two steps, since a shift by 64 is undefined.
    const int right_a = probe.bits[0], left_a = 63 - right_a, right_b = probe.bits[1], left_b = 63 - right_b;
    any = 0;
    read += kNanosPerProbe + kNanosPerWord * (end - begin);
    for (int w = begin; w < end; ++w) {
      const std::uint64_t taken_a = a[w] >> right_a | a[w + 1] << 1 << left_a;
      const std::uint64_t taken_b = b[w] >> right_b | b[w + 1] << 1 << left_b;
      free[w] &= ~(taken_a | taken_b);
      any |= free[w];
    }
    if (any == 0) break;
    if constexpr (kWords == 0) {
      while (free[begin] == 0) ++begin;
      while (free[end - 1] == 0) --end;
    }
  }
  *work += read;
  if (any == 0) return false;
  if constexpr (kWords > 0) std::copy(own, own + kWords, places);
  return true;
}

bool Board::FreePlaces(const Probes& probes, int y, std::uint64_t* places, int words, std::int64_t* work) const {
  *work += kNanosPerRow;
  for (const auto& [row, length] : probes.longest) {
    if (longest_free_[y + row] < length) return false;
  }
  switch (words) {
    case 1:
      return FreePlacesIn<1>(probes, y, places, words, work);
    case 2:
      return FreePlacesIn<2>(probes, y, places, words, work);
    case 3:
      return FreePlacesIn<3>(probes, y, places, words, work);
    case 4:
      return FreePlacesIn<4>(probes, y, places, words, work);
    default:
      return FreePlacesIn<0>(probes, y, places, words, work);
  }
}

int Board::FindSpot(const Silhouette& s, const Rim& rim, const Probes& probes, int first, int last, int rows_beyond,
                    Spot* best, std::int64_t* work) const {
  const int columns = size_ - s.width + 1, rows = size_ - s.height + 1;
  if (columns <= 0 || rows <= 0) return -1;
  const int words = (columns + 63) / 64;
  // The places of three consecutive rows, each between two words of zeros.
  const int width = words + 2;
  std::vector<std::uint64_t> window(static_cast<std::size_t>(3) * width, 0);
  const auto places = [&](int y) { return window.data() + static_cast<std::size_t>(y % 3) * width + 1; };
  bool any[3] = {false, false, false};
  const double share = 1.0 / static_cast<double>(std::max<std::size_t>(1, rim.cells.size()));
  const auto clear = [&](int y) { std::fill_n(places(y), words, 0); };
  first = std::max(first, kMargin);
  if (first + s.height > kMargin + side_) return -1;
  any[first % 3] = FreePlaces(probes, first, places(first), words, work);
  int found = -1;
  if (!any[first % 3]) clear(first);
  for (int y = first; y + s.height <= kMargin + side_ && (found < 0 ? y <= last : y - found <= rows_beyond); ++y) {
    any[(y + 1) % 3] = y + 1 + s.height <= kMargin + side_ && FreePlaces(probes, y + 1, places(y + 1), words, work);
    if (!any[(y + 1) % 3]) clear(y + 1);
    if (!any[y % 3]) continue;
    if (found < 0) found = y;
    *work += 3 * words;
    const std::uint64_t *here = places(y), *above = places(y + 1), *below = places(y + 2);  // below: row y - 1
    for (int w = 0; w < words; ++w) {
      if (here[w] == 0) continue;
      const std::uint64_t left = here[w] << 1 | here[w - 1] >> 63, right = here[w] >> 1 | here[w + 1] << 63;
      std::uint64_t corners = here[w] & ~(left & right) & ~(above[w] & below[w]);
      while (corners != 0) {
        const int x = 64 * w + std::countr_zero(corners);
        corners &= corners - 1;
        std::int64_t taken = 0;
        *work += std::ssize(rim.cells);
        for (const Rim::Cell& cell : rim.cells) taken += IsTaken(x + cell.x, y + cell.y) ? 1 : 0;
        const double snugness = share * static_cast<double>(taken);
        if (snugness > best->snugness || (snugness == best->snugness && x + y < best->x + best->y)) {
          *best = {x, y, snugness};
        }
      }
    }
  }
  return found;
}

}  // namespace planish
