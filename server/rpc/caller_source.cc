#include "server/rpc/caller_source.h"

namespace planish {
namespace {

class OpenCallerSource : public CallerSource {
 public:
  absl::StatusOr<Caller> Identify(const grpc::CallbackServerContext&) const override {
    return Caller{kDefaultTenant, "", Rights::All(), ""};
  }
};

}  // namespace

std::unique_ptr<CallerSource> NewOpenCallerSource() {
  return std::make_unique<OpenCallerSource>();
}

}  // namespace planish
