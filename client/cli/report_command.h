// The pages that `unwrap --report` writes, of one file and of a batch.
#pragma once

#include <string>

#include "client/cli/arguments.h"
#include "client/cli/mesh_input.h"
#include "client/cli/report_page.h"
#include "client/cli/report_sheet.h"

namespace planish::cli {

// The map of `result`, whose warnings have the file's ids, and beside it the UV that `input` had, if all of it has
// some.
FinishedPage UnwrapReport(const MeshInput& input, const UnwrapResult& result, const Arguments& arguments);

// A page of a batch's sheet.
struct SheetPageJob {
  const ReportSheet& sheet;
  std::string page;    // its place on the sheet
  std::string output;  // the file that the batch wrote
  std::string made;    // SheetMember::made
};

// Writes the page of a file that was unwrapped; gives its card.
Json WritePage(const SheetPageJob& job, const MeshInput& input, const UnwrapResult& result, const Arguments& arguments);

// The same for a file that an earlier run has done: its page stays if it was made of the same. Otherwise there is a new
// one of the output alone, without what it was before and how it was solved.
Json KeepPage(const SheetPageJob& job, int texcoord, const Arguments& arguments);

}  // namespace planish::cli
