#include "server/rpc/trace_header.h"

#include <string_view>

#include "core/base/random_id.h"
#include "core/base/trace_context.h"

namespace planish {

std::string TraceparentOf(const grpc::CallbackServerContext& context) {
  const auto [first, last] = context.client_metadata().equal_range("traceparent");
  std::string traceparent;
  if (first != last && std::next(first) == last) {
    traceparent = ParseTraceparent(std::string_view(first->second.data(), first->second.size()));
  }
  if (!traceparent.empty()) return traceparent;
  return NewTraceparent(Entropy);
}

}  // namespace planish
