// What `man planish` says beside the flags.
#pragma once

#include "core/base/command_pages.h"

namespace planish::cli {

ManFrame ManPage();

}  // namespace planish::cli
