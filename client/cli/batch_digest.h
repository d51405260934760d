// What a result depends on, as digests: the bytes that were read and the options that were given.
#pragma once

#include <string>

#include "client/cli/arguments.h"

namespace planish::cli {

// The SHA-256 in hexadecimal of what is in the file `path`, and for a .gltf of the buffers that it refers to as well.
// Throws planish::Error: FILE_UNREADABLE. A buffer that cannot be read counts as missing.
std::string InputDigest(const std::string& path);

// The SHA-256 in hexadecimal of one file's bytes; empty if it cannot be read.
std::string FileDigest(const std::string& path);

// The SHA-256 in hexadecimal of every option that changes a byte of the output (`threads` does not).
std::string SettingsDigest(const Arguments& arguments);

}  // namespace planish::cli
