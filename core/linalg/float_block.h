// Small vectors and blocks of floats, one SSE or NEON register wide, for the loops of the multigrid.
#pragma once

#include <cstdint>
#include <cstring>

namespace planish {

using Float2 = float __attribute__((vector_size(8)));
using Float4 = float __attribute__((vector_size(16)));

template <typename Vector>
Vector Load(const float* p) {
  Vector v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
template <typename Vector>
void Store(const Vector& v, float* p) {
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
// a b.
inline Float4 Product(const Float4& a, const Float4& b) {
  return __builtin_shufflevector(a, a, 0, 0, 2, 2) * __builtin_shufflevector(b, b, 0, 1, 0, 1) +
         __builtin_shufflevector(a, a, 1, 1, 3, 3) * __builtin_shufflevector(b, b, 2, 3, 2, 3);
}
inline Float4 Transposed(const Float4& a) {
  return __builtin_shufflevector(a, a, 0, 2, 1, 3);
}

// ---- Complex numbers as pairs.

// The block that multiplies a pair by the complex number z.
inline Float4 ComplexBlock(const Float2& z) {
  return Float4{z[0], -z[1], z[1], z[0]};
}

}  // namespace planish
