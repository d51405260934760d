#pragma once

#include <string>

#include "absl/status/status.h"

namespace planish {

// Writes a small file into `directory` and removes it. UNAVAILABLE with a message for people if that cannot be done.
absl::Status TryToWrite(const std::string& directory);

}  // namespace planish
