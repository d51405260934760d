#include "server/rpc/trace_header.h"

#include <cstdint>
#include <random>
#include <string_view>

#include "core/base/trace_context.h"

namespace planish {

std::string TraceparentOf(const grpc::CallbackServerContext& context) {
  const auto [first, last] = context.client_metadata().equal_range("traceparent");
  std::string traceparent;
  if (first != last && std::next(first) == last) {
    traceparent = ParseTraceparent(std::string_view(first->second.data(), first->second.size()));
  }
  if (!traceparent.empty()) return traceparent;
  return NewTraceparent([] {
    std::random_device random;
    return (std::uint64_t{random()} << 32) | random();
  });
}

}  // namespace planish
