// A small file as text: settings, certificates, lists.
#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace planish {

// All bytes of the file, none for an empty file. `what` names its purpose in errors. INVALID_ARGUMENT: "cannot read
// WHAT PATH: No such file or directory", with the system's reason.
absl::StatusOr<std::string> ReadTextFile(const std::string& what, const std::string& path);

}  // namespace planish
