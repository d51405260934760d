// Small vectors and blocks of floats, one SSE or NEON register wide, for the loops of the multigrid and of the Cholesky
// factorization.
#pragma once

#include <cstring>

namespace planish {

using Float2 = float __attribute__((vector_size(8)));
using Float4 = float __attribute__((vector_size(16)));
using Double2 = double __attribute__((vector_size(16)));

template <typename Vector, typename Scalar>
Vector Load(const Scalar* p) {
  Vector v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
template <typename Vector, typename Scalar>
void Store(const Vector& v, Scalar* p) {
  std::memcpy(p, &v, sizeof v);
}

// ---- 2x2 blocks by rows: (a00, a01, a10, a11).

// The four products of a x; RowSums() adds them up to a x.
inline Float4 Terms(const Float4& a, const Float2& x) {
  return a * __builtin_shufflevector(x, x, 0, 1, 0, 1);
}
inline Float2 RowSums(const Float4& terms) {
  return __builtin_shufflevector(terms, terms, 0, 2) + __builtin_shufflevector(terms, terms, 1, 3);
}
// The matrix product a b.
inline Float4 Product(const Float4& a, const Float4& b) {
  return __builtin_shufflevector(a, a, 0, 0, 2, 2) * __builtin_shufflevector(b, b, 0, 1, 0, 1) +
         __builtin_shufflevector(a, a, 1, 1, 3, 3) * __builtin_shufflevector(b, b, 2, 3, 2, 3);
}
inline Float4 Transposed(const Float4& a) {
  return __builtin_shufflevector(a, a, 0, 2, 1, 3);
}

// Sums of products of 2x4 and 4x4 blocks (stored as 2x2 parts by rows, each by rows) with vectors. Sums full registers
// first, and their parts at the end.
struct Products2 {
  Float4 terms = {};
  void Add(const float* block, const Float4& x) {
    terms += Load<Float4>(block) * __builtin_shufflevector(x, x, 0, 1, 0, 1) +
             Load<Float4>(block + 4) * __builtin_shufflevector(x, x, 2, 3, 2, 3);
  }
  Float2 Value() const { return RowSums(terms); }
};
struct Products4 {
  Products2 upper, lower;
  void Add(const float* block, const Float4& x) {
    upper.Add(block, x);
    lower.Add(block + 8, x);
  }
  Float4 Value() const { return __builtin_shufflevector(upper.Value(), lower.Value(), 0, 1, 2, 3); }
};

// ---- Complex numbers as pairs.

// The block that multiplies a pair by the complex number z.
inline Float4 ComplexBlock(const Float2& z) {
  return Float4{z[0], -z[1], z[1], z[0]};
}

}  // namespace planish
