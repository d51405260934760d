#pragma once

#include <string>

namespace planish {

// 32 raw bytes.
std::string Sha256(const std::string& bytes);

}  // namespace planish
