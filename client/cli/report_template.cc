#include "client/cli/report_template.h"

#include <cstddef>

// PLANISH_REPORT is the directory of the files, which CMake passes: the assembler copies the bytes, so that no compiler
// has to parse them.
#define PLANISH_INCLUDE(symbol, file)                    \
  asm(".pushsection .rodata\n" symbol                    \
      ":\n"                                              \
      ".incbin \"" PLANISH_REPORT "/" file "\"\n" symbol \
      "_end:\n"                                          \
      ".byte 0\n"                                        \
      ".popsection\n")
PLANISH_INCLUDE("planish_report_template", "template.html");
PLANISH_INCLUDE("planish_sheet_template", "sheet_template.html");

extern "C" {
extern const char planish_report_template[];
extern const char planish_report_template_end[];
extern const char planish_sheet_template[];
extern const char planish_sheet_template_end[];
}

namespace planish::cli {

std::string_view ReportTemplate() {
  return {planish_report_template, static_cast<std::size_t>(planish_report_template_end - planish_report_template)};
}

std::string_view SheetTemplate() {
  return {planish_sheet_template, static_cast<std::size_t>(planish_sheet_template_end - planish_sheet_template)};
}

}  // namespace planish::cli
