#include "core/linalg/block_matrix.h"

namespace planish {

template <typename Scalar>
void Multiply(const BlockMatrix<Scalar>& a, const Eigen::VectorXd& x, Eigen::VectorXd* y, ThreadTeam& team) {
  using Block = Eigen::Array<Scalar, 2, 1>;
  y->resize(x.size());
  team.ForEach(a.num_rows(), [&](std::int64_t i) {
    Eigen::Array2d upper(0, 0), lower(0, 0);
    for (std::int32_t k = a.row_begin[i]; k < a.row_begin[i + 1]; ++k) {
      const Scalar* block = &a.value[4 * static_cast<std::size_t>(k)];
      const Eigen::Array2d at = x.segment<2>(2 * Eigen::Index{a.column[k]}).array();
      upper += Eigen::Map<const Block>(block).template cast<double>() * at;
      lower += Eigen::Map<const Block>(block + 2).template cast<double>() * at;
    }
    (*y)[2 * i] = upper.sum();
    (*y)[2 * i + 1] = lower.sum();
  });
}

template void Multiply(const BlockMatrix<float>&, const Eigen::VectorXd&, Eigen::VectorXd*, ThreadTeam&);
template void Multiply(const BlockMatrix<double>&, const Eigen::VectorXd&, Eigen::VectorXd*, ThreadTeam&);

}  // namespace planish
