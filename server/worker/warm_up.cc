#include "server/worker/warm_up.h"

#include <cmath>

#include "core/base/heap.h"
#include "core/draco/codec.h"
#include "core/mesh/mesh.h"
#include "server/worker/work.h"

namespace planish {
namespace {

// A dome over n x n squares.
Mesh Dome(int n) {
  Mesh mesh;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      const double x = 2.0 * i / n - 1, y = 2.0 * j / n - 1;
      mesh.positions.emplace_back(x, y, std::exp(-2 * (x * x + y * y)));
    }
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const int a = j * (n + 1) + i, d = a + n + 1;
      mesh.faces.push_back({a, a + 1, d + 1});
      mesh.faces.push_back({a, d + 1, d});
    }
  }
  return mesh;
}

}  // namespace

void WarmUp() {
  const absl::StatusOr<std::string> draco = EncodeDraco(Dome(4));
  if (!draco.ok()) return;
  const absl::StatusOr<BlobPtr> blob = Blob::Copy(*draco);
  if (!blob.ok()) return;
  worker::v1::WorkRequest request;
  // One chart only: cutting and packing take long and load nothing more.
  request.mutable_options()->set_seams(v1::SEAMS_NONE);
  DoWork(request, {*blob}, {});
  ReturnFreedMemory();
}

}  // namespace planish
