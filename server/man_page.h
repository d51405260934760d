// What `man planishd` says beside the flags.
#pragma once

#include "core/base/command_pages.h"

namespace planish {

ManFrame ManPage();

}  // namespace planish
