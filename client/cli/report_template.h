// The built pages of client/report, as they are in the repository.
#pragma once

#include <string_view>

namespace planish::cli {

std::string_view ReportTemplate();  // of one mesh, or two: report_page.h
std::string_view SheetTemplate();   // of many: report_sheet.h

}  // namespace planish::cli
