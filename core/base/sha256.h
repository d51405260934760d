#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace planish {

inline constexpr std::size_t kSha256Bytes = 32;

// The 32 bytes of the SHA-256 of `bytes`. Throws std::bad_alloc if the crypto library has no memory.
std::string Sha256(std::string_view bytes);

}  // namespace planish
