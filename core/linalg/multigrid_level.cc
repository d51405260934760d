#include "core/linalg/multigrid_level.h"

#include <type_traits>

namespace planish {
namespace {

using Index = std::int32_t;

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
  // With (D + L + E) x = b, b - A x is what is right of the diagonal, and E x.
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
