#pragma once

#include <string>

namespace planish {

// A random UUID (version 4).
std::string NewRequestId();

}  // namespace planish
