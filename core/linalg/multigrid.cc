#include "core/linalg/multigrid.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "Eigen/Cholesky"
#include "absl/strings/str_format.h"
#include "core/base/status_macros.h"
#include "core/linalg/multigrid_level.h"
#include "core/linalg/vector_ops.h"

namespace planish {
struct Multigrid::Impl {
  absl::Status Build(const BlockMatrix<float>& matrix, const std::vector<std::complex<double>>& z,
                     std::int32_t num_coupled, const Interrupter* interrupter);
  absl::Status Refresh(const BlockMatrix<float>& matrix, const std::vector<std::complex<double>>& z,
                       const Interrupter* interrupter);
  absl::Status FactorizeCoarsest();
  // One cycle on the finest level, and on coarse level l.
  void Cycle();
  void Cycle(std::size_t l);

  MultigridTuning tuning;
  ThreadTeam* team = nullptr;
  MultigridLevel<2> finest;
  std::vector<MultigridLevel<4>> coarse;
  // Inverse of the coarsest matrix.
  Eigen::MatrixXf inverse;
};

namespace {

// Dense matrices of so many block rows take some 400 bytes for each row of the finest level, which is within what
// EstimateUnwrap() reserves; small ones are nothing.
std::int64_t MostDenseRows(std::int64_t finest_rows, const MultigridTuning& tuning) {
  const auto root = static_cast<std::int64_t>(std::sqrt(static_cast<double>(finest_rows)));
  return std::min(tuning.max_dense_rows, std::max(2 * tuning.coarsest_rows, root));
}

}  // namespace

absl::Status Multigrid::Impl::Build(const BlockMatrix<float>& matrix, const std::vector<std::complex<double>>& z,
                                    std::int32_t num_coupled, const Interrupter* interrupter) {
  coarse.clear();
  finest.a.SetPattern(matrix.row_begin, matrix.column, tuning.chunk_rows, team);
  if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
  SetValues(matrix, &finest.a, team);
  finest.coordinates.centre = z;
  finest.ResizeVectors();
  PLANISH_RETURN_IF_ERROR(finest.a.InvertDiagonal(tuning.undamped_part, team));
  double theta = tuning.strength;
  // Adds a level below `level`; false if that cannot be coarsened.
  const auto coarsen = [&](auto* level, std::int32_t coupled) -> absl::StatusOr<bool> {
    if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
    MultigridLevel<4> next;
    const bool built = level->BuildCoarse(tuning, theta, coupled, &next.a, team, interrupter);
    if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
    if (!built) return false;
    level->FillCoarse(&next.coordinates, &next.a, team, interrupter);
    if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
    PLANISH_RETURN_IF_ERROR(next.a.InvertDiagonal(tuning.undamped_part, team));
    next.ResizeVectors();
    coarse.push_back(std::move(next));
    return true;
  };
  coarse.reserve(static_cast<std::size_t>(tuning.max_levels));
  PLANISH_ASSIGN_OR_RETURN(bool more, coarsen(&finest, num_coupled));
  if (!more) return absl::FailedPreconditionError("multigrid: the rows are coupled too weakly to be aggregated");
  while (more && coarse.back().num_rows() > tuning.coarsest_rows &&
         coarse.size() < static_cast<std::size_t>(tuning.max_levels)) {
    theta *= tuning.strength_ratio;
    PLANISH_ASSIGN_OR_RETURN(more, coarsen(&coarse.back(), coarse.back().num_rows()));
  }
  const std::int64_t most = MostDenseRows(finest.num_rows(), tuning);
  if (coarse.back().num_rows() > most) {
    return absl::FailedPreconditionError(
        absl::StrFormat("multigrid: coarsening ended at %d rows on level %d; the coarsest level may have %d",
                        coarse.back().num_rows(), coarse.size() + 1, most));
  }
  return FactorizeCoarsest();
}

absl::Status Multigrid::Impl::Refresh(const BlockMatrix<float>& matrix, const std::vector<std::complex<double>>& z,
                                      const Interrupter* interrupter) {
  SetValues(matrix, &finest.a, team);
  finest.coordinates.centre = z;
  PLANISH_RETURN_IF_ERROR(finest.a.InvertDiagonal(tuning.undamped_part, team));
  if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
  finest.FillCoarse(&coarse[0].coordinates, &coarse[0].a, team, interrupter);
  for (std::size_t l = 0;; ++l) {
    if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
    PLANISH_RETURN_IF_ERROR(coarse[l].a.InvertDiagonal(tuning.undamped_part, team));
    if (l + 1 == coarse.size()) break;
    coarse[l].FillCoarse(&coarse[l + 1].coordinates, &coarse[l + 1].a, team, interrupter);
  }
  return FactorizeCoarsest();
}

absl::Status Multigrid::Impl::FactorizeCoarsest() {
  const LevelMatrix<4>& a = coarse.back().a;
  // Factorized in its place: these are the largest matrices of a small mesh.
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(4 * a.num_rows(), 4 * a.num_rows());
  for (std::int32_t i = 0; i < a.num_rows(); ++i) {
    for (std::int32_t k = a.row_begin[i]; k < a.row_begin[i + 1]; ++k) {
      for (int p = 0; p < 4; ++p) {
        for (int q = 0; q < 4; ++q) {
          dense(4 * i + p, 4 * a.column[k] + q) = a.Block(k)[8 * (p / 2) + 4 * (q / 2) + 2 * (p % 2) + q % 2];
        }
      }
    }
  }
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factorization(dense);
  if (factorization.info() != Eigen::Success) {
    return absl::FailedPreconditionError("multigrid: the coarsest matrix is not positive definite");
  }
  inverse = factorization.solve(Eigen::MatrixXd::Identity(dense.rows(), dense.cols())).cast<float>();
  return absl::OkStatus();
}

void Multigrid::Impl::Cycle() {
  finest.RelaxFromZero(team);
  finest.Restrict(&coarse[0].b, team);
  Cycle(0);
  finest.CorrectAndRelax(coarse[0].x, team);
}

void Multigrid::Impl::Cycle(std::size_t l) {
  MultigridLevel<4>& level = coarse[l];
  if (l + 1 == coarse.size()) {
    const Eigen::Index n = inverse.rows();
    Eigen::Map<Eigen::VectorXf>(level.x.data(), n).noalias() =
        inverse * Eigen::Map<const Eigen::VectorXf>(level.b.data(), n);
    return;
  }
  level.RelaxFromZero(team);
  level.Restrict(&coarse[l + 1].b, team);
  Cycle(l + 1);
  level.CorrectAndRelax(coarse[l + 1].x, team);
}

Multigrid::Multigrid(const MultigridTuning& tuning) : impl_(std::make_unique<Impl>()) {
  impl_->tuning = tuning;
}
Multigrid::~Multigrid() = default;

absl::Status Multigrid::Build(const BlockMatrix<float>& matrix, const std::vector<std::complex<double>>& z,
                              std::int32_t num_coupled, ThreadTeam& team, const Interrupter* interrupter) {
  impl_->team = &team;
  return impl_->Build(matrix, z, num_coupled, interrupter);
}
absl::Status Multigrid::Refresh(const BlockMatrix<float>& matrix, const std::vector<std::complex<double>>& z,
                                const Interrupter* interrupter) {
  return impl_->Refresh(matrix, z, interrupter);
}

void Multigrid::Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const {
  // The cycle is linear; scaling keeps small residuals clear of float's underflow.
  const double scale = Largest(*impl_->team, r.cwiseAbs());
  if (scale == 0) {
    *z = r;
    return;
  }
  MultigridLevel<2>& finest = impl_->finest;
  const Eigen::Index n = r.size();
  z->resize(n);
  constexpr std::int64_t kChunk = 16384;
  impl_->team->For(n, kChunk, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) finest.b[static_cast<std::size_t>(i)] = static_cast<float>(r[i] / scale);
  });
  impl_->Cycle();
  impl_->team->For(n, kChunk, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) (*z)[i] = scale * finest.x[static_cast<std::size_t>(i)];
  });
}

int Multigrid::num_levels() const {
  return static_cast<int>(impl_->coarse.size()) + 1;
}

double Multigrid::operator_complexity() const {
  double numbers = static_cast<double>(impl_->finest.a.value.size());
  for (const MultigridLevel<4>& level : impl_->coarse) numbers += static_cast<double>(level.a.value.size());
  return numbers / static_cast<double>(impl_->finest.a.value.size());
}

}  // namespace planish
