#include "core/linalg/preconditioner.h"

namespace planish {

JacobiPreconditioner::JacobiPreconditioner(const Eigen::VectorXd& diagonal)
    : inverse_(diagonal.unaryExpr([](double d) { return d == 0 ? 1.0 : 1.0 / std::abs(d); })) {}

}  // namespace planish
