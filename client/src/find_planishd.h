#pragma once

#include <string>

namespace planish {

// planishd in `directory` (unless empty), else in its ../bin, else $PLANISHD, else in PATH; empty if there is none.
std::string FindPlanishd(const std::string& directory);

}  // namespace planish
