// The text of `man planishd` around the flags.
#pragma once

#include "core/base/command_pages.h"

namespace planish {

ManFrame ManPage();

}  // namespace planish
