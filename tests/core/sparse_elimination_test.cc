// SparseElimination beside a dense factorization, on random matrices of the kind that it is for.
#include "core/linalg/sparse_elimination.h"

#include <cmath>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "Eigen/Dense"
#include "gtest/gtest.h"

namespace planish {
namespace {

using Matrix = SparseElimination::Matrix;
using Pattern = std::set<std::pair<int, int>>;  // off the diagonal, both (i, j) and (j, i)

Pattern RandomPattern(int rows, double density, std::mt19937* random) {
  Pattern pattern;
  std::bernoulli_distribution joins(density);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < i; ++j) {
      if (!joins(*random)) continue;
      pattern.insert({i, j});
      pattern.insert({j, i});
    }
  }
  return pattern;
}

// Rows with a diagonal of 1 and entries below 0 that add up to -`sum`; not symmetric.
Matrix RandomMatrix(int rows, const Pattern& pattern, double sum, std::mt19937* random) {
  std::uniform_real_distribution<double> weight(0.01, 1);
  std::vector<Eigen::Triplet<double>> entries;
  std::vector<double> total(rows, 0);
  for (const auto& [i, j] : pattern) {
    entries.emplace_back(i, j, weight(*random));
    total[i] += entries.back().value();
  }
  for (Eigen::Triplet<double>& e : entries) e = {e.row(), e.col(), -sum * e.value() / total[e.row()]};
  for (int i = 0; i < rows; ++i) entries.emplace_back(i, i, 1);
  Matrix matrix(rows, rows);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

std::vector<Eigen::Vector2d> RandomPairs(int rows, std::mt19937* random) {
  std::uniform_real_distribution<double> number(-1, 1);
  std::vector<Eigen::Vector2d> pairs;
  for (int i = 0; i < rows; ++i) pairs.emplace_back(number(*random), number(*random));
  return pairs;
}

// The largest difference to the solution by a dense LU factorization with pivots.
double Difference(const SparseElimination& elimination, const Matrix& a, const std::vector<Eigen::Vector2d>& right) {
  std::vector<Eigen::Vector2d> x = right;
  elimination.Solve(a, &x);
  Eigen::MatrixXd b(right.size(), 2);
  for (std::size_t i = 0; i < right.size(); ++i) b.row(static_cast<Eigen::Index>(i)) = right[i];
  const Eigen::MatrixXd expected = Eigen::MatrixXd(a).fullPivLu().solve(b);
  double largest = 0;
  for (std::size_t i = 0; i < right.size(); ++i) {
    const double off = (x[i].transpose() - expected.row(static_cast<Eigen::Index>(i))).cwiseAbs().maxCoeff();
    if (!(off <= largest)) largest = off;
  }
  return largest;
}

TEST(SparseElimination, SolvesLikeADenseFactorization) {
  std::mt19937 random(1);
  for (int round = 0; round < 200; ++round) {
    const int rows = 1 + static_cast<int>(random() % 40);
    const Pattern pattern = RandomPattern(rows, round % 4 == 0 ? 0.5 : 3.0 / rows, &random);
    const Matrix first = RandomMatrix(rows, pattern, 0.9, &random);
    EXPECT_LT(Difference(SparseElimination(first), first, RandomPairs(rows, &random)), 1e-13) << "round " << round;
  }
}

// The pattern is that of the first matrix, the numbers are those of each.
TEST(SparseElimination, SolvesOtherMatricesOfThePattern) {
  std::mt19937 random(2);
  constexpr int kRows = 60;
  const Pattern pattern = RandomPattern(kRows, 0.05, &random);
  const SparseElimination elimination(RandomMatrix(kRows, pattern, 0.9, &random));
  for (int round = 0; round < 20; ++round) {
    const Matrix matrix = RandomMatrix(kRows, pattern, 0.9, &random);
    EXPECT_LT(Difference(elimination, matrix, RandomPairs(kRows, &random)), 1e-13);
  }
}

// As in a barycentric map: rows add up to 0, but for those next to the outline.
TEST(SparseElimination, MeansOfNeighboursOnAPathLieOnALine) {
  constexpr int kRows = 1000;
  std::vector<Eigen::Triplet<double>> entries;
  for (int i = 0; i < kRows; ++i) {
    entries.emplace_back(i, i, 1);
    if (i > 0) entries.emplace_back(i, i - 1, -0.5);
    if (i + 1 < kRows) entries.emplace_back(i, i + 1, -0.5);
  }
  Matrix matrix(kRows, kRows);
  matrix.setFromTriplets(entries.begin(), entries.end());
  std::vector<Eigen::Vector2d> x(kRows, Eigen::Vector2d::Zero());
  x.back() = Eigen::Vector2d(0.5, -1);  // half of the neighbour beyond: (1, -2)
  SparseElimination(matrix).Solve(matrix, &x);
  for (int i = 0; i < kRows; ++i) {
    const double along = (i + 1.0) / (kRows + 1);
    EXPECT_NEAR(x[i].x(), along, 1e-12);
    EXPECT_NEAR(x[i].y(), -2 * along, 2e-12);
  }
}

TEST(SparseElimination, SingularMatricesHaveNoFiniteSolution) {
  Matrix matrix(2, 2);
  const std::vector<Eigen::Triplet<double>> entries = {{0, 0, 1}, {0, 1, -1}, {1, 0, -1}, {1, 1, 1}};
  matrix.setFromTriplets(entries.begin(), entries.end());
  std::vector<Eigen::Vector2d> x = {Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1)};
  SparseElimination(matrix).Solve(matrix, &x);
  EXPECT_FALSE(x[0].allFinite() && x[1].allFinite());
}

}  // namespace
}  // namespace planish
