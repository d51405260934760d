#include "core/linalg/multigrid_level.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <type_traits>

namespace planish {
namespace {

using Index = std::int32_t;

// The squared Frobenius norm of the leading 2x2 part.
float SquaredNorm(const float* block) {
  return block[0] * block[0] + block[1] * block[1] + block[2] * block[2] + block[3] * block[3];
}

}  // namespace

template <int N>
std::vector<char> StrongCouplings(const LevelMatrix<N>& matrix, double theta, std::int32_t num_coupled,
                                  ThreadTeam* team) {
  const std::int32_t n = matrix.num_rows();
  std::vector<float> diagonal(n);
  team->ForEach(n, [&](std::int64_t i) { diagonal[i] = std::sqrt(SquaredNorm(matrix.Block(matrix.diagonal[i]))); });
  const auto threshold = static_cast<float>(theta * theta);
  std::vector<char> strong(matrix.column.size());
  team->ForEach(std::min(n, num_coupled), [&](std::int64_t i) {
    for (std::int32_t k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
      const std::int32_t j = matrix.column[k];
      strong[k] = j != i && j < num_coupled && SquaredNorm(matrix.Block(k)) >= threshold * diagonal[i] * diagonal[j];
    }
  });
  return strong;
}

template <int N>
Aggregates Aggregate(const LevelMatrix<N>& matrix, const std::vector<char>& strong,
                     std::int64_t second_ring_neighbours) {
  constexpr std::int32_t kFree = -2, kIsolated = -1;
  const bool wide = second_ring_neighbours > 0;
  const std::int32_t n = matrix.num_rows();
  Aggregates aggregates;
  std::vector<std::int32_t>& of_row = aggregates.of_row;
  of_row.assign(n, kFree);
  // Calls see(j) for the strong neighbours of i until see returns false. Returns whether it never did.
  const auto each_neighbour = [&](std::int32_t i, const auto& see) {
    for (std::int32_t k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
      if (strong[k] && !see(matrix.column[k])) return false;
    }
    return true;
  };
  const auto is_free = [&](std::int32_t j) { return of_row[j] == kFree; };
  const auto take = [&](std::int32_t j) {
    of_row[j] = aggregates.count;
    return true;
  };

  std::vector<std::int32_t> second_ring;
  std::vector<int> inside(wide ? n : 0, 0);  // per row of the second ring: its neighbours in the first
  for (std::int32_t i = 0; i < n; ++i) {
    if (each_neighbour(i, [](std::int32_t) { return false; })) {
      of_row[i] = kIsolated;
      continue;
    }
    if (!is_free(i) || !each_neighbour(i, is_free)) continue;
    take(i);
    each_neighbour(i, take);
    if (wide) {
      second_ring.clear();
      each_neighbour(i, [&](std::int32_t j) {
        return each_neighbour(j, [&](std::int32_t m) {
          if (is_free(m) && inside[m]++ == 0) second_ring.push_back(m);
          return true;
        });
      });
      for (const std::int32_t m : second_ring) {
        if (inside[m] >= second_ring_neighbours) take(m);
        inside[m] = 0;
      }
    }
    ++aggregates.count;
  }

  // A row between aggregates joins the one to which it is coupled most strongly. Using only the first pass's result
  // keeps aggregates from growing into chains.
  const std::vector<std::int32_t> first_pass = of_row;
  for (std::int32_t i = 0; i < n; ++i) {
    if (first_pass[i] != kFree) continue;
    float best = -1;
    for (std::int32_t k = matrix.row_begin[i]; k < matrix.row_begin[i + 1]; ++k) {
      if (!strong[k] || first_pass[matrix.column[k]] < 0) continue;
      const float coupling = SquaredNorm(matrix.Block(k));
      if (coupling > best) {
        best = coupling;
        of_row[i] = first_pass[matrix.column[k]];
      }
    }
  }

  for (std::int32_t i = 0; i < n; ++i) {
    if (of_row[i] != kFree) continue;
    take(i);
    each_neighbour(i, [&](std::int32_t j) { return is_free(j) ? take(j) : true; });
    ++aggregates.count;
  }
  return aggregates;
}

template std::vector<char> StrongCouplings(const LevelMatrix<2>&, double, std::int32_t, ThreadTeam*);
template Aggregates Aggregate(const LevelMatrix<2>&, const std::vector<char>&, std::int64_t);
template Aggregates Aggregate(const LevelMatrix<4>&, const std::vector<char>&, std::int64_t);

// ---- The structure and the numbers of the coarse levels: P and P^t A P.

namespace {

// Builds rows of unknown length in parallel chunks: row(i, add) calls add(column) for the columns of row i; repeated
// columns are merged.
template <typename Row>
void BuildRows(Index num_rows, Index num_columns, ThreadTeam* team, const Row& row, std::vector<Index>* row_begin,
               std::vector<Index>* column) {
  struct Part {
    std::vector<Index> column, length;
  };
  std::vector<Part> parts = team->Collect<Part>(num_rows, kRowsPerChunk, [&](std::int64_t begin, std::int64_t end) {
    Part part;
    std::vector<Index> last(num_columns, -1);  // per column: its last position in the part
    for (auto i = static_cast<Index>(begin); i < end; ++i) {
      const auto start = static_cast<Index>(part.column.size());
      row(i, [&](Index j) {
        if (last[j] >= start) return;
        last[j] = static_cast<Index>(part.column.size());
        part.column.push_back(j);
      });
      part.length.push_back(static_cast<Index>(part.column.size()) - start);
    }
    return part;
  });
  row_begin->assign(1, 0);
  row_begin->reserve(num_rows + 1);
  column->clear();
  for (Part& part : parts) {
    for (const Index length : part.length) row_begin->push_back(row_begin->back() + length);
    column->insert(column->end(), part.column.begin(), part.column.end());
    part = Part();
  }
}

// c += a b, or a^t b, for blocks of 2x2 parts: c is Rows x 2, b Inner x 2.
template <int Rows, int Inner, bool kTransposed>
void AddProduct(const float* a, const float* b, float* c) {
  for (int r = 0; r < Rows; ++r) {
    for (int q = 0; q < 2; ++q) {
      float* to = c + 4 * (2 * r + q);
      auto sum = Load<Float4>(to);
      for (int s = 0; s < Inner; ++s) {
        const auto part = Load<Float4>(a + 4 * (kTransposed ? Rows * s + r : Inner * r + s));
        sum += Product(kTransposed ? Transposed(part) : part, Load<Float4>(b + 4 * (2 * s + q)));
      }
      Store(sum, to);
    }
  }
}

// The largest eigenvalue of D^-1 A, estimated from below by a few power iterations.
template <int N>
double LargestEigenvalue(const LevelMatrix<N>& a, std::int64_t iterations, ThreadTeam* team) {
  using Vector = LevelVector<N>;
  const Index n = a.num_rows();
  std::vector<float> v(N * std::size_t(n)), next(N * std::size_t(n));
  std::linear_congruential_engine<std::uint32_t, 1664525, 1013904223, 0> random(1);
  for (float& entry : v) entry = static_cast<float>(random() >> 8) / 8388608.0F - 1.0F;
  double norm = std::sqrt(N / 3.0 * n);
  for (std::int64_t iteration = 0; iteration < iterations; ++iteration) {
    const auto scale = static_cast<float>(1 / norm);
    norm = std::sqrt(team->Sum(n, kRowsPerChunk, [&](std::int64_t begin, std::int64_t end) {
      double sum = 0;
      for (auto i = static_cast<Index>(begin); i < end; ++i) {
        const Vector y = SolveRow(a, i, RowProduct(a, a.row_begin[i], a.row_begin[i + 1], v.data()) * scale);
        Store(y, &next[N * std::size_t(i)]);
        for (int q = 0; q < N; ++q) sum += double(y[q]) * y[q];
      }
      return sum;
    }));
    v.swap(next);
  }
  return norm;
}

}  // namespace

template <int N>
bool MultigridLevel<N>::BuildCoarse(const MultigridTuning& tuning, double theta, Index num_coupled,
                                    LevelMatrix<4>* coarse, ThreadTeam* team, const Interrupter* interrupter) {
  const Index n = num_rows();
  Prolongation& p = prolongation;
  const std::vector<char> strong = StrongCouplings(a, theta, num_coupled, team);
  if (IsInterrupted(interrupter)) return false;
  p.aggregates = Aggregate(a, strong, N == 2 ? tuning.second_ring_neighbours : 0);
  const std::vector<Index>& aggregate = p.aggregates.of_row;
  const Index count = p.aggregates.count;
  if (count == 0 || count > tuning.slowest_coarsening * n || IsInterrupted(interrupter)) return false;
  p.most_smoothed_couplings = tuning.most_smoothed_couplings;
  p.omega = tuning.omega / (tuning.eigenvalue_margin * LargestEigenvalue(a, tuning.power_iterations, team));

  if (IsInterrupted(interrupter)) return false;
  BuildRows(
      n, count, team,
      [&](Index i, const auto& add) {
        if (i >= num_coupled) return;
        const bool smoothed = a.row_begin[i + 1] - a.row_begin[i] <= p.most_smoothed_couplings;
        for (Index k = a.row_begin[i]; k < a.row_begin[i + 1]; ++k) {
          const Index j = a.column[k];
          if (const Index c = aggregate[j]; c >= 0 && (smoothed || i == j)) add(c);
        }
      },
      &p.row_begin, &p.column);
  p.value.resize(4 * N * p.column.size());

  if (IsInterrupted(interrupter)) return false;
  p.transposed_begin.assign(count + 1, 0);
  for (const Index c : p.column) ++p.transposed_begin[c + 1];
  for (Index c = 0; c < count; ++c) p.transposed_begin[c + 1] += p.transposed_begin[c];
  p.transposed.resize(p.column.size());
  std::vector<Index> cursor(p.transposed_begin.begin(), p.transposed_begin.end() - 1);
  for (Index i = 0; i < n; ++i) {
    for (Index k = p.row_begin[i]; k < p.row_begin[i + 1]; ++k) p.transposed[cursor[p.column[k]]++] = {i, k};
  }

  if (IsInterrupted(interrupter)) return false;
  BuildRows(
      n, count, team,
      [&](Index i, const auto& add) {
        for (Index k = a.row_begin[i]; k < a.row_begin[i + 1]; ++k) {
          const Index j = a.column[k];
          for (Index m = p.row_begin[j]; m < p.row_begin[j + 1]; ++m) add(p.column[m]);
        }
      },
      &p.product_begin, &p.product_column);

  if (IsInterrupted(interrupter)) return false;
  std::vector<Index> begin, column;
  BuildRows(
      count, count, team,
      [&](Index c, const auto& add) {
        add(c);
        for (Index t = p.transposed_begin[c]; t < p.transposed_begin[c + 1]; ++t) {
          const Index i = p.transposed[t].row;
          for (Index m = p.product_begin[i]; m < p.product_begin[i + 1]; ++m) add(p.product_column[m]);
        }
      },
      &begin, &column);
  coarse->SetPattern(begin, column, tuning.coarse_chunk_rows, team);
  return true;
}

template <int N>
void MultigridLevel<N>::FillOffsets(LevelCoordinates* coarse_coordinates) {
  Prolongation& p = prolongation;
  const std::vector<Index>& aggregate = p.aggregates.of_row;
  const Index n = num_rows(), count = p.aggregates.count;
  std::vector<std::complex<double>>& centre = coarse_coordinates->centre;
  std::vector<double>& extent = coarse_coordinates->extent;
  std::vector<Index> members(count, 0);
  centre.assign(count, 0);
  extent.assign(count, 0);
  for (Index i = 0; i < n; ++i) {
    if (aggregate[i] < 0) continue;
    ++members[aggregate[i]];
    centre[aggregate[i]] += coordinates.centre[i];
  }
  for (Index c = 0; c < count; ++c) centre[c] /= members[c];
  for (Index i = 0; i < n; ++i) {
    if (aggregate[i] < 0) continue;
    extent[aggregate[i]] += std::norm(coordinates.centre[i] - centre[aggregate[i]]);
    if (N == 4) extent[aggregate[i]] += coordinates.extent[i] * coordinates.extent[i];
  }
  for (Index c = 0; c < count; ++c) extent[c] = std::sqrt(extent[c] / members[c]);
  p.offset.assign(2 * std::size_t(n), 0.0F);
  p.scale.assign(N == 2 ? 0 : std::size_t(n), 0.0F);
  for (Index i = 0; i < n; ++i) {
    const Index c = aggregate[i];
    if (c < 0 || !(extent[c] > 0)) continue;
    const std::complex<double> offset = (coordinates.centre[i] - centre[c]) / extent[c];
    Store(Float2{static_cast<float>(offset.real()), static_cast<float>(offset.imag())}, &p.offset[2 * std::size_t(i)]);
    if (N == 4) p.scale[i] = static_cast<float>(coordinates.extent[i] / extent[c]);
  }
}

template <int N>
void MultigridLevel<N>::FillProlongation(ThreadTeam* team) {
  constexpr int kParts = N / 2;
  Prolongation& p = prolongation;
  const std::vector<Index>& aggregate = p.aggregates.of_row;
  const auto omega = static_cast<float>(p.omega);
  team->ForEach(num_rows(), [&](Index i) {
    const Index row = p.row_begin[i], row_end = p.row_begin[i + 1];
    if (row == row_end) return;
    std::fill(&p.value[4 * N * std::size_t(row)], p.value.data() + 4 * N * std::size_t(row_end), 0.0F);
    const bool smoothed = a.row_begin[i + 1] - a.row_begin[i] <= p.most_smoothed_couplings;
    for (Index k = a.row_begin[i]; k < a.row_begin[i + 1]; ++k) {
      const Index j = a.column[k], c = aggregate[j];
      if (c < 0 || (!smoothed && i != j)) continue;
      // W = delta_ij - omega D_i^-1 A_ij, by parts, then W P_0j.
      Float4 w[kParts][kParts];
      for (int r = 0; r < kParts; ++r) {
        for (int q = 0; q < kParts; ++q) {
          w[r][q] = i == j && r == q ? Float4{1, 0, 0, 1} : Float4{};
          for (int s = 0; smoothed && s < kParts; ++s) {
            w[r][q] -= omega * Product(Load<Float4>(&a.inverse[N * N * std::size_t(i)] + 4 * (kParts * r + s)),
                                       Load<Float4>(a.Block(k) + 4 * (kParts * s + q)));
          }
        }
      }
      const Index at = static_cast<Index>(std::find(&p.column[row], &p.column[row_end - 1], c) - p.column.data());
      float* to = &p.value[4 * N * std::size_t(at)];
      const Float4 offset = ComplexBlock(Load<Float2>(&p.offset[2 * std::size_t(j)]));
      for (int r = 0; r < kParts; ++r) {
        Store(Load<Float4>(to + 8 * r) + w[r][0], to + 8 * r);
        Float4 beta = Product(w[r][0], offset);
        if (N == 4) beta += w[r][kParts - 1] * p.scale[j];
        Store(Load<Float4>(to + 8 * r + 4) + beta, to + 8 * r + 4);
      }
    }
  });
}

template <int N>
absl::Status MultigridLevel<N>::FillCoarse(const MultigridTuning& tuning, MultigridLevel<4>* coarse, ThreadTeam* team,
                                           const Interrupter* interrupter) {
  constexpr int kParts = N / 2;
  if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
  FillOffsets(&coarse->coordinates);
  if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
  FillProlongation(team);
  if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
  const Prolongation& p = prolongation;
  const Index count = p.aggregates.count;
  // A P, chunk by chunk: small allocations fit into memory that was freed before.
  std::vector<std::vector<float>> product(static_cast<std::size_t>((num_rows() + kRowsPerChunk - 1) / kRowsPerChunk));
  const auto product_block = [&](Index row, Index k) {
    const Index chunk = row / kRowsPerChunk;
    return product[chunk].data() + 4 * N * std::size_t(k - p.product_begin[chunk * kRowsPerChunk]);
  };
  team->For(num_rows(), kRowsPerChunk, [&](std::int64_t first, std::int64_t last) {
    std::vector<Index> place(count);  // positions of the columns in the row
    product[static_cast<std::size_t>(first / kRowsPerChunk)].assign(
        4 * N * std::size_t(p.product_begin[last] - p.product_begin[first]), 0.0F);
    for (auto i = static_cast<Index>(first); i < last; ++i) {
      for (Index k = p.product_begin[i]; k < p.product_begin[i + 1]; ++k) place[p.product_column[k]] = k;
      for (Index k = a.row_begin[i]; k < a.row_begin[i + 1]; ++k) {
        const Index j = a.column[k];
        for (Index m = p.row_begin[j]; m < p.row_begin[j + 1]; ++m) {
          AddProduct<kParts, kParts, false>(a.Block(k), &p.value[4 * N * std::size_t(m)],
                                            product_block(i, place[p.column[m]]));
        }
      }
    }
  });
  if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
  LevelMatrix<4>& matrix = coarse->a;
  team->For(count, kRowsPerChunk / 16, [&](std::int64_t first, std::int64_t last) {
    std::vector<Index> place(count);
    for (auto c = static_cast<Index>(first); c < last; ++c) {
      for (Index k = matrix.row_begin[c]; k < matrix.row_begin[c + 1]; ++k) {
        place[matrix.column[k]] = k;
        std::fill(matrix.Block(k), matrix.Block(k) + 16, 0.0F);
      }
      for (Index t = p.transposed_begin[c]; t < p.transposed_begin[c + 1]; ++t) {
        const auto [i, block] = p.transposed[t];
        for (Index m = p.product_begin[i]; m < p.product_begin[i + 1]; ++m) {
          AddProduct<2, kParts, true>(&p.value[4 * N * std::size_t(block)], product_block(i, m),
                                      matrix.Block(place[p.product_column[m]]));
        }
      }
      // An aggregate without extent does not use its beta: any positive diagonal will do.
      float* diagonal = matrix.Block(matrix.diagonal[c]);
      if (!(coarse->coordinates.extent[c] > 0)) std::copy(diagonal, diagonal + 4, diagonal + 12);
    }
  });
  if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
  return matrix.InvertDiagonal(tuning.undamped_part, team);
}

// ---- The cycle.

namespace {

// The sum of transposed blocks of P times rows.
struct Restricted {
  Float4 alpha = {}, beta = {};
  void Add(const float* block, const Float2& r) {
    const Float4 rr = __builtin_shufflevector(r, r, 0, 0, 1, 1);
    alpha += Load<Float4>(block) * rr;
    beta += Load<Float4>(block + 4) * rr;
  }
  void Add(const float* block, const Float4& r) {
    Add(block, __builtin_shufflevector(r, r, 0, 1));
    Add(block + 8, __builtin_shufflevector(r, r, 2, 3));
  }
  Float4 Value() const {
    return __builtin_shufflevector(alpha, beta, 0, 1, 4, 5) + __builtin_shufflevector(alpha, beta, 2, 3, 6, 7);
  }
};

}  // namespace

template <int N>
void MultigridLevel<N>::ResizeVectors() {
  for (std::vector<float>* v : {&b, &x, &old}) v->resize(N * std::size_t(num_rows()));
}

template <int N>
void MultigridLevel<N>::RelaxFromZero(ThreadTeam* team) {
  const auto relax = [&](Index i) {
    const Vector r = Load<Vector>(&b[N * std::size_t(i)]) - RowProduct(a, a.row_begin[i], a.diagonal[i], x.data());
    Store(SolveRow(a, i, r), &x[N * std::size_t(i)]);
  };
  team->ForEach(num_rows(), relax, a.chunk_rows);
}

template <int N>
void MultigridLevel<N>::Restrict(std::vector<float>* coarse_b, ThreadTeam* team) {
  const Prolongation& p = prolongation;
  // With (D + L + E) x = b, b - A x is E x minus the part of A right of the diagonal times x.
  team->ForEach(num_rows(), [&](Index i) {
    Vector r = -RowProduct(a, a.diagonal[i] + 1, a.row_begin[i + 1], x.data());
    if (a.HasOutside(i)) {
      r += Load<Vector>(&a.damping[N * std::size_t(i)]) * Load<Vector>(&x[N * std::size_t(i)]);
    }
    Store(r, &old[N * std::size_t(i)]);
  });
  const auto restrict_to = [&](Index c) {
    Restricted sum;
    for (Index t = p.transposed_begin[c]; t < p.transposed_begin[c + 1]; ++t) {
      const auto [row, block] = p.transposed[t];
      sum.Add(&p.value[4 * N * std::size_t(block)], Load<Vector>(&old[N * std::size_t(row)]));
    }
    Store(sum.Value(), &(*coarse_b)[4 * std::size_t(c)]);
  };
  team->ForEach(p.aggregates.count, restrict_to, kRowsPerChunk / 16);
}

template <int N>
void MultigridLevel<N>::CorrectAndRelax(const std::vector<float>& coarse_x, ThreadTeam* team) {
  const Index n = num_rows();
  const Prolongation& p = prolongation;
  team->ForEach(n, [&](Index i) {
    std::conditional_t<N == 2, Products2, Products4> correction;
    for (Index k = p.row_begin[i]; k < p.row_begin[i + 1]; ++k) {
      correction.Add(&p.value[4 * N * std::size_t(k)], Load<Float4>(&coarse_x[4 * std::size_t(p.column[k])]));
    }
    const Vector corrected = Load<Vector>(&x[N * std::size_t(i)]) + correction.Value();
    Store(corrected, &x[N * std::size_t(i)]);
    Store(corrected, &old[N * std::size_t(i)]);
  });
  team->For(n, a.chunk_rows, [&](std::int64_t begin, std::int64_t end) {
    for (auto i = static_cast<Index>(end) - 1; i >= begin; --i) {
      Vector r = Load<Vector>(&b[N * std::size_t(i)]) - RowProduct(a, a.row_begin[i], a.diagonal[i], x.data()) -
                 RowProduct(a, a.diagonal[i] + 1, a.outside_begin[i], x.data()) -
                 RowProduct(a, a.outside_begin[i], a.row_begin[i + 1], old.data());
      if (a.HasOutside(i)) {
        r += Load<Vector>(&a.damping[N * std::size_t(i)]) * Load<Vector>(&x[N * std::size_t(i)]);
      }
      Store(SolveRow(a, i, r), &x[N * std::size_t(i)]);
    }
  });
}

template struct MultigridLevel<2>;
template struct MultigridLevel<4>;

}  // namespace planish
