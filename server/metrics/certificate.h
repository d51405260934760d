#pragma once

#include <string>

#include "absl/time/time.h"

namespace planish {

// When the first certificate in the PEM file expires; the epoch if there is none that can be read.
absl::Time CertificateFileEnd(const std::string& pem_file);

}  // namespace planish
