// Solves Poisson equations on small discs roughly and cheaply; StretchEstimate has thousands of them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace planish {

// Solves A u = b for a symmetric positive definite matrix A with the entries -weight between neighbours, by conjugate
// gradients preconditioned with symmetric successive over-relaxation (SSOR), where an iteration costs one product with
// A (Eisenstat 1981). Takes four tenths of the iterations of Jacobi preconditioning, at less than twice the work of
// each. Not thread-safe.
class PoissonSolver {
 public:
  // Starts a new equation with at most n unknowns.
  void Start(std::int32_t n);
  // Adds the next row i: A_ii = diagonal > 0, and the start value of u_i. `neighbours(add)` calls add(j, weight) once
  // for each j with A_ij = -weight, and returns b_i.
  template <typename Neighbours>
  void AddRow(double diagonal, double start, const Neighbours& neighbours);
  // Call once after each Start(). Iterates until the residual r is less than `tolerance` times b, both measured as the
  // root of r^t M^-1 r with the preconditioner M.
  void Solve(double tolerance, int most_iterations);

  // The solution, per row.
  const std::vector<double>& solution() const { return u_; }

 private:
  // One triangle of A. Most rows have only a few entries on either side of the diagonal: these are in `rows`, padded
  // with zeros, since loops of varying length cost more. Further entries are in `more`.
  struct Triangle {
    static constexpr int kWidth = 4;
    struct Row {
      std::array<double, kWidth> weight;
      std::array<std::int32_t, kWidth> column;
    };
    struct Entry {
      std::int32_t row, column;
      double weight;
    };
    std::vector<Row> rows;
    std::vector<Entry> more;  // in the order of rows
  };
  class Products;

  std::int32_t size_ = 0;
  Triangle lower_, upper_;
  std::vector<double> diagonal_, inverse_;  // D / omega and its inverse
  std::vector<double> b_, u_, residual_, direction_, step_, product_;
};

template <typename Neighbours>
void PoissonSolver::AddRow(double diagonal, double start, const Neighbours& neighbours) {
  const std::int32_t row = size_++;
  std::array<Triangle::Row*, 2> rows = {&upper_.rows[row], &lower_.rows[row]};
  *rows[0] = *rows[1] = {};
  std::array<int, 2> count = {0, 0};
  b_[row] = neighbours([&](std::int32_t column, double weight) {
    const int below = column < row ? 1 : 0;
    const int place = count[below]++;
    if (place < Triangle::kWidth) {
      rows[below]->column[place] = column;
      rows[below]->weight[place] = weight;
    } else {
      (below ? lower_ : upper_).more.push_back({row, column, weight});
    }
  });
  diagonal_[row] = diagonal;
  u_[row] = start;
}

}  // namespace planish
