#pragma once

#include <string>

#include "grpcpp/server_context.h"

namespace planish {

// The W3C trace context of a call: that of its metadata "traceparent" if there is exactly one and it is valid, else a
// new one.
std::string TraceparentOf(const grpc::CallbackServerContext& context);

}  // namespace planish
