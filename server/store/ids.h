#pragma once

#include <string>

namespace planish {

// 16 random hexadecimal digits from the system's entropy. Thread-safe.
std::string RandomId();

}  // namespace planish
