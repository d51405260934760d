#include "core/linalg/multigrid.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "Eigen/Cholesky"
#include "absl/strings/str_format.h"
#include "core/base/status_macros.h"
#include "core/linalg/vector_ops.h"

namespace planish {

absl::Status Multigrid::Build(const BlockMatrix<float>& matrix, const std::vector<std::complex<double>>& z,
                              std::int32_t num_coupled, ThreadTeam& team, const Interrupter* interrupter) {
  team_ = &team;
  coarse_.clear();
  finest_.a.SetPattern(matrix.row_begin, matrix.column, tuning_.chunk_rows, team_);
  if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
  SetValues(matrix, &finest_.a, team_);
  finest_.coordinates.centre = z;
  finest_.ResizeVectors();
  PLANISH_RETURN_IF_ERROR(finest_.a.InvertDiagonal(tuning_.undamped_part, team_));
  double theta = tuning_.strength;
  // Adds a level below `level`; false if `level` cannot be coarsened.
  const auto coarsen = [&](auto* level, std::int32_t coupled) -> absl::StatusOr<bool> {
    if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
    MultigridLevel<4> next;
    const bool built = level->BuildCoarse(tuning_, theta, coupled, &next.a, team_, interrupter);
    if (IsInterrupted(interrupter)) return absl::CancelledError("cancelled");
    if (!built) return false;
    PLANISH_RETURN_IF_ERROR(level->FillCoarse(tuning_, &next, team_, interrupter));
    next.ResizeVectors();
    coarse_.push_back(std::move(next));
    return true;
  };
  coarse_.reserve(static_cast<std::size_t>(tuning_.max_levels));
  PLANISH_ASSIGN_OR_RETURN(bool more, coarsen(&finest_, num_coupled));
  if (!more) return absl::FailedPreconditionError("multigrid: the rows are coupled too weakly to be aggregated");
  while (more && coarse_.back().num_rows() > tuning_.coarsest_rows &&
         coarse_.size() < static_cast<std::size_t>(tuning_.max_levels)) {
    theta *= tuning_.strength_ratio;
    PLANISH_ASSIGN_OR_RETURN(more, coarsen(&coarse_.back(), coarse_.back().num_rows()));
  }
  // Dense matrices of this many block rows take about 400 bytes for each row of the finest level, which is within the
  // reservation of EstimateUnwrap(). Small ones do not matter.
  const auto root = static_cast<std::int64_t>(std::sqrt(static_cast<double>(finest_.num_rows())));
  const std::int64_t most = std::min(tuning_.max_dense_rows, std::max(2 * tuning_.coarsest_rows, root));
  if (coarse_.back().num_rows() > most) {
    return absl::FailedPreconditionError(
        absl::StrFormat("multigrid: coarsening ended at %d rows on level %d; the coarsest level may have %d",
                        coarse_.back().num_rows(), coarse_.size() + 1, most));
  }
  return InvertCoarsest();
}

absl::Status Multigrid::Refresh(const BlockMatrix<float>& matrix, const std::vector<std::complex<double>>& z,
                                const Interrupter* interrupter) {
  SetValues(matrix, &finest_.a, team_);
  finest_.coordinates.centre = z;
  PLANISH_RETURN_IF_ERROR(finest_.a.InvertDiagonal(tuning_.undamped_part, team_));
  PLANISH_RETURN_IF_ERROR(finest_.FillCoarse(tuning_, &coarse_[0], team_, interrupter));
  for (std::size_t l = 1; l < coarse_.size(); ++l) {
    PLANISH_RETURN_IF_ERROR(coarse_[l - 1].FillCoarse(tuning_, &coarse_[l], team_, interrupter));
  }
  return InvertCoarsest();
}

absl::Status Multigrid::InvertCoarsest() {
  const LevelMatrix<4>& a = coarse_.back().a;
  // Factorized in place: these are the largest matrices of a small mesh.
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(4 * a.num_rows(), 4 * a.num_rows());
  for (std::int32_t i = 0; i < a.num_rows(); ++i) {
    for (std::int32_t k = a.row_begin[i]; k < a.row_begin[i + 1]; ++k) {
      dense.block<4, 4>(4 * i, 4 * a.column[k]) = DenseBlock<4>(a.Block(k));
    }
  }
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factorization(dense);
  if (factorization.info() != Eigen::Success) {
    return absl::FailedPreconditionError("multigrid: the coarsest matrix is not positive definite");
  }
  inverse_ = factorization.solve(Eigen::MatrixXd::Identity(dense.rows(), dense.cols())).cast<float>();
  return absl::OkStatus();
}

void Multigrid::Cycle() const {
  finest_.RelaxFromZero(team_);
  finest_.Restrict(&coarse_[0].b, team_);
  for (std::size_t l = 0; l + 1 < coarse_.size(); ++l) {
    coarse_[l].RelaxFromZero(team_);
    coarse_[l].Restrict(&coarse_[l + 1].b, team_);
  }
  const Eigen::Index n = inverse_.rows();
  Eigen::Map<Eigen::VectorXf>(coarse_.back().x.data(), n).noalias() =
      inverse_ * Eigen::Map<const Eigen::VectorXf>(coarse_.back().b.data(), n);
  for (std::size_t l = coarse_.size() - 1; l-- > 0;) coarse_[l].CorrectAndRelax(coarse_[l + 1].x, team_);
  finest_.CorrectAndRelax(coarse_[0].x, team_);
}

void Multigrid::Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const {
  // The cycle is linear; scaling keeps small residuals away from float's underflow.
  const double scale = Largest(*team_, r.cwiseAbs());
  if (scale == 0) {
    *z = r;
    return;
  }
  const Eigen::Index n = r.size();
  z->resize(n);
  team_->ForEach(n, [&](std::int64_t i) { finest_.b[static_cast<std::size_t>(i)] = static_cast<float>(r[i] / scale); });
  Cycle();
  team_->ForEach(n, [&](std::int64_t i) { (*z)[i] = scale * finest_.x[static_cast<std::size_t>(i)]; });
}

double Multigrid::operator_complexity() const {
  double numbers = static_cast<double>(finest_.a.value.size());
  for (const MultigridLevel<4>& level : coarse_) numbers += static_cast<double>(level.a.value.size());
  return numbers / static_cast<double>(finest_.a.value.size());
}

}  // namespace planish
