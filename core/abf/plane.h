// Diagonal 3x3 matrices on the plane of angle changes that sum to zero, where one face's part of the Newton step lives.
#pragma once

namespace planish {

// e(a) = a0 a1 + a1 a2 + a2 a0: the determinant of diag(a) on the plane, up to a factor that does not depend on a.
inline double PlaneDeterminant(const double* a) {
  return a[0] * a[1] + a[1] * a[2] + a[2] * a[0];
}

}  // namespace planish
