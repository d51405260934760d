#include "client/cli/report_template.h"

#include <cstddef>

// PLANISH_REPORT_TEMPLATE is the file's path, which CMake passes: the assembler copies the bytes, so that no compiler
// has to parse them.
asm(".pushsection .rodata\n"
    "planish_report_template:\n"
    ".incbin \"" PLANISH_REPORT_TEMPLATE
    "\"\n"
    "planish_report_template_end:\n"
    ".byte 0\n"
    ".popsection\n");

extern "C" {
extern const char planish_report_template[];
extern const char planish_report_template_end[];
}

namespace planish::cli {

std::string_view ReportTemplate() {
  return {planish_report_template, static_cast<std::size_t>(planish_report_template_end - planish_report_template)};
}

}  // namespace planish::cli
