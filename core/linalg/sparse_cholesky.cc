#include "core/linalg/sparse_cholesky.h"

#include <cholmod.h>
#include <omp.h>

#include <cstring>
#include <mutex>
#include <vector>

#include "absl/strings/str_cat.h"

// Of OpenBLAS; null where the BLAS is another one.
extern "C" {
[[gnu::weak]] int openblas_get_parallel();
[[gnu::weak]] void openblas_set_num_threads(int threads);
}

namespace planish {
namespace {

constexpr Eigen::Index kSmallGraph = 3000;  // vertices

// What the numeric part of CHOLMOD must hold. BLAS is to work on the calling thread alone; and an OpenBLAS that was
// built without threads (Debian's libopenblas0-serial) shares its buffers between callers without a lock: of two matrix
// products at a time, one in a hundred came out wrong. Then one caller at a time has it.
std::unique_lock<std::mutex> HoldBlas() {
  static std::mutex* const mutex = new std::mutex;
  static const bool is_shared = [] {
    if (openblas_set_num_threads != nullptr) openblas_set_num_threads(1);
    return openblas_get_parallel != nullptr && openblas_get_parallel() == 0;
  }();
  return is_shared ? std::unique_lock(*mutex) : std::unique_lock<std::mutex>();
}

// METIS draws its random numbers from the C library's one generator, which it seeds each time: two calls at a time
// would disturb each other's, and with them the last bits of what is solved.
bool DissectAlone(cholmod_sparse* graph, int* order, cholmod_common* common) {
  static std::mutex* const mutex = new std::mutex;
  const std::lock_guard lock(*mutex);
  return cholmod_metis(graph, nullptr, 0, 1, order, common) != 0;
}

cholmod_sparse View(const SparseMatrix& lower) {
  cholmod_sparse view = {};
  view.nrow = view.ncol = static_cast<std::size_t>(lower.rows());
  view.nzmax = static_cast<std::size_t>(lower.nonZeros());
  // CHOLMOD takes pointers to non-const but only reads here.
  view.p = const_cast<int*>(lower.outerIndexPtr());
  view.i = const_cast<int*>(lower.innerIndexPtr());
  view.x = const_cast<double*>(lower.valuePtr());
  view.stype = -1;
  view.itype = CHOLMOD_INT;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  view.sorted = 1;
  view.packed = 1;
  return view;
}

// The pattern of the block graph, lower triangle.
SparseMatrix BlockPattern(const SparseMatrix& lower, int block_size) {
  const Eigen::Index blocks = lower.rows() / block_size;
  std::vector<Eigen::Triplet<double, int>> entries;
  for (Eigen::Index j = 0; j < blocks; ++j) {
    for (SparseMatrix::InnerIterator it(lower, j * block_size); it; ++it) {
      if (it.row() % block_size == 0) {
        entries.emplace_back(static_cast<int>(it.row() / block_size), static_cast<int>(j), 1.0);
      }
    }
  }
  SparseMatrix pattern(blocks, blocks);
  pattern.setFromTriplets(entries.begin(), entries.end());
  return pattern;
}

}  // namespace

struct SparseCholesky::Impl {
  Impl() {
    cholmod_start(&common);
    common.print = 0;
    common.supernodal = CHOLMOD_SUPERNODAL;
    // The matrix is permuted by an ordering that CHOLMOD gets from here.
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_GIVEN;
    common.postorder = 1;
  }
  ~Impl() {
    cholmod_free_factor(&factor, &common);
    cholmod_free_dense(&solution, &common);
    cholmod_free_dense(&workspace_y, &common);
    cholmod_free_dense(&workspace_e, &common);
    cholmod_finish(&common);
  }

  bool SamePattern(const SparseMatrix& lower) const {
    return factor != nullptr && static_cast<Eigen::Index>(column_begin.size()) == lower.cols() + 1 &&
           static_cast<Eigen::Index>(row.size()) == lower.nonZeros() &&
           std::memcmp(column_begin.data(), lower.outerIndexPtr(), column_begin.size() * sizeof(int)) == 0 &&
           std::memcmp(row.data(), lower.innerIndexPtr(), row.size() * sizeof(int)) == 0;
  }

  absl::Status Analyze(const SparseMatrix& lower, int block_size) {
    const SparseMatrix pattern = BlockPattern(lower, block_size);
    cholmod_sparse graph = View(pattern);
    std::vector<int> block_order(static_cast<std::size_t>(pattern.rows()));
    // Nested dissection for large graphs, minimum degree for small ones, which is as good there and quicker. CHOLMOD
    // refuses METIS on a few odd graphs too.
    const bool has_order = pattern.rows() > kSmallGraph && DissectAlone(&graph, block_order.data(), &common);
    if (!has_order && !cholmod_amd(&graph, nullptr, 0, block_order.data(), &common)) {
      return absl::ResourceExhaustedError("no memory for the ordering of the reduced system");
    }
    std::vector<int> order;
    order.reserve(static_cast<std::size_t>(lower.rows()));
    for (const int block : block_order) {
      for (int k = 0; k < block_size; ++k) order.push_back(block * block_size + k);
    }
    cholmod_free_factor(&factor, &common);
    cholmod_sparse matrix = View(lower);
    factor = cholmod_analyze_p(&matrix, order.data(), nullptr, 0, &common);
    if (factor == nullptr) return absl::ResourceExhaustedError("no memory for the symbolic factorization");
    column_begin.assign(lower.outerIndexPtr(), lower.outerIndexPtr() + lower.cols() + 1);
    row.assign(lower.innerIndexPtr(), lower.innerIndexPtr() + lower.nonZeros());
    return absl::OkStatus();
  }

  mutable cholmod_common common;
  cholmod_factor* factor = nullptr;
  // Pattern that `factor` was analyzed for.
  std::vector<int> column_begin, row;
  // Kept between solves by cholmod_solve2.
  mutable cholmod_dense *solution = nullptr, *workspace_y = nullptr, *workspace_e = nullptr;
};

SparseCholesky::SparseCholesky() : impl_(std::make_unique<Impl>()) {}
SparseCholesky::~SparseCholesky() = default;

absl::Status SparseCholesky::Factorize(const SparseMatrix& lower, int block_size) {
  // CHOLMOD would start four threads for any factorization, whatever the caller's share of the machine is.
  omp_set_max_active_levels(0);
  if (lower.rows() == 0) return absl::OkStatus();
  if (!impl_->SamePattern(lower)) {
    if (absl::Status status = impl_->Analyze(lower, block_size); !status.ok()) return status;
  }
  cholmod_sparse matrix = View(lower);
  const std::unique_lock<std::mutex> blas = HoldBlas();
  if (!cholmod_factorize(&matrix, impl_->factor, &impl_->common)) {
    return absl::ResourceExhaustedError("no memory for the factorization of the reduced system");
  }
  if (impl_->common.status == CHOLMOD_NOT_POSDEF) {
    return absl::FailedPreconditionError(absl::StrCat("matrix is not positive definite: pivot ", impl_->factor->minor,
                                                      " of ", impl_->factor->n, " is not positive"));
  }
  return absl::OkStatus();
}

void SparseCholesky::Solve(const Eigen::VectorXd& b, Eigen::VectorXd* x) const {
  if (b.size() == 0) {
    x->resize(0);
    return;
  }
  const std::unique_lock<std::mutex> blas = HoldBlas();
  cholmod_dense rhs = {};
  rhs.nrow = rhs.nzmax = rhs.d = static_cast<std::size_t>(b.size());
  rhs.ncol = 1;
  rhs.x = const_cast<double*>(b.data());
  rhs.xtype = CHOLMOD_REAL;
  rhs.dtype = CHOLMOD_DOUBLE;
  if (!cholmod_solve2(CHOLMOD_A, impl_->factor, &rhs, nullptr, &impl_->solution, nullptr, &impl_->workspace_y,
                      &impl_->workspace_e, &impl_->common)) {
    throw std::bad_alloc();
  }
  *x = Eigen::Map<const Eigen::VectorXd>(static_cast<const double*>(impl_->solution->x), b.size());
}

}  // namespace planish
