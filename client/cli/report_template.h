// The built page of client/report, as it is in the repository.
#pragma once

#include <string_view>

namespace planish::cli {

std::string_view ReportTemplate();

}  // namespace planish::cli
