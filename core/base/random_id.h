// Unique ids from the system's source of randomness. Thread-safe.
#pragma once

#include <cstdint>
#include <string>

namespace planish {

// 64 random bits.
std::uint64_t Entropy();

// A UUID of version 4.
std::string NewUuid();

}  // namespace planish
