// PoissonSolver, against Eigen's direct solver.
#include "core/charts/poisson_solver.h"

#include <cmath>
#include <random>

#include "Eigen/Dense"
#include "gtest/gtest.h"

namespace planish {
namespace {

// Row i of A x = b.
template <typename Start>
void Add(const Eigen::MatrixXd& a, const Eigen::VectorXd& b, const Start& start, PoissonSolver* solver) {
  solver->Start(static_cast<std::int32_t>(b.size()));
  for (Eigen::Index i = 0; i < b.size(); ++i) {
    solver->AddRow(a(i, i), start(i), [&](const auto& add) {
      for (Eigen::Index j = 0; j < b.size(); ++j) {
        if (j != i && a(i, j) != 0) add(static_cast<std::int32_t>(j), -a(i, j));
      }
      return b(i);
    });
  }
}

Eigen::VectorXd SolutionOf(const PoissonSolver& solver) {
  return Eigen::VectorXd::Map(solver.solution().data(), static_cast<Eigen::Index>(solver.solution().size()));
}

// Positive definite, with `neighbours` entries beside the diagonal of a row in the mean and more in the first one; a
// few are positive, as those of obtuse triangles are.
Eigen::MatrixXd RandomMatrix(int n, double neighbours, std::mt19937* random) {
  std::uniform_real_distribution<double> uniform(0, 1);
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < i; ++j) {
      if (j > 0 && uniform(*random) > neighbours / n) continue;
      const double weight = uniform(*random) < 0.1 ? -0.1 * uniform(*random) : uniform(*random);
      a(i, j) = a(j, i) = -weight;
      a(i, i) += std::abs(weight);
      a(j, j) += std::abs(weight);
    }
  }
  for (int i = 0; i < n; ++i) a(i, i) += 0.1 * uniform(*random) + 0.01;
  return a;
}

TEST(PoissonSolver, SolvesWhatADirectSolverDoes) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal(0, 1);
  PoissonSolver solver;
  for (const int n : {1, 2, 3, 7, 40, 200, 5}) {
    for (const double neighbours : {2.0, 6.0, 12.0}) {
      const Eigen::MatrixXd a = RandomMatrix(n, neighbours, &random);
      Eigen::VectorXd b(n), start(n);
      for (int i = 0; i < n; ++i) b(i) = normal(random), start(i) = normal(random);
      const Eigen::VectorXd wanted = a.ldlt().solve(b);
      Add(a, b, start, &solver);
      solver.Solve(1e-12, 1000);
      EXPECT_LT((SolutionOf(solver) - wanted).norm(), 1e-9 * wanted.norm()) << n << " rows, " << neighbours;
    }
  }
}

// The grid of the five-point Laplacian: four tenths of the iterations that the diagonal alone takes.
TEST(PoissonSolver, TakesFewIterations) {
  constexpr int kSide = 30;
  constexpr int kRows = kSide * kSide;
  Eigen::MatrixXd a = 4 * Eigen::MatrixXd::Identity(kRows, kRows);
  for (int i = 0; i < kRows; ++i) {
    if (i % kSide > 0) a(i, i - 1) = a(i - 1, i) = -1;
    if (i >= kSide) a(i, i - kSide) = a(i - kSide, i) = -1;
  }
  const Eigen::VectorXd b = Eigen::VectorXd::Ones(kRows);
  const Eigen::VectorXd wanted = a.ldlt().solve(b);
  PoissonSolver solver;
  Add(a, b, Eigen::VectorXd::Zero(kRows), &solver);
  solver.Solve(0, 10);  // 27 with the diagonal alone
  EXPECT_LT((SolutionOf(solver) - wanted).norm(), 1e-3 * wanted.norm());
}

TEST(PoissonSolver, LeavesWhatIsSolved) {
  std::mt19937 random(12);
  const Eigen::MatrixXd a = RandomMatrix(50, 6, &random);
  const Eigen::VectorXd wanted = Eigen::VectorXd::LinSpaced(50, -1, 1);
  PoissonSolver solver;
  Add(a, a * wanted, wanted, &solver);
  solver.Solve(1e-6, 100);
  EXPECT_EQ(SolutionOf(solver), wanted);
  Add(a, Eigen::VectorXd::Zero(50), Eigen::VectorXd::Zero(50), &solver);
  solver.Solve(1e-6, 100);
  EXPECT_EQ(SolutionOf(solver), Eigen::VectorXd::Zero(50));
}

}  // namespace
}  // namespace planish
