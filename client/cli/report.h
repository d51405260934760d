// The pages that `report` and `unwrap --report` write, and the contact sheet of many: an index page with a small
// picture and the key figures of every file, and a page for each.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "client/cli/check.h"
#include "client/cli/mesh_input.h"
#include "client/cli/report_page.h"
#include "client/cli/results.h"
#include "client/cli/unwrap_files.h"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish::cli {

// A file on the sheet.
struct SheetRow {
  std::string name;
  std::string page;            // path of its page below ReportSheet::pages(), with '/'; empty without a page
  std::string result;          // "usable", "failed", ...: ToString(BatchResult); "shown" where nothing was unwrapped
  std::string message;         // why it failed or is not usable
  Json card;                   // FinishedPage::card; null without a page
  double seconds = -1;         // that the unwrap took; negative: nothing was unwrapped
  std::int64_t triangles = 0;  // where there is no card; 0: not known
};

// Where the pages of a sheet are.
class ReportSheet {
 public:
  // `place`, as --report or -o has it: DIR holds index.html and the pages, FILE.html is the sheet itself and FILE_files
  // holds the pages.
  explicit ReportSheet(const std::string& place);

  const std::filesystem::path& index() const { return index_; }
  const std::filesystem::path& pages() const { return pages_; }
  // "props/a.obj" has the page "props/a.obj.html".
  static std::string PageOf(const std::string& key) { return key + ".html"; }
  std::string PathOf(const std::string& page) const { return (pages_ / page).string(); }
  // Where the sheet is, seen from a page.
  std::string SheetFrom(const std::string& page) const;

  // Makes the directory of the pages. Throws planish::Error: FILE_UNWRITABLE.
  void Prepare() const;
  // Writes a page, in a directory that need not exist yet. Throws FILE_UNWRITABLE.
  void WritePage(const std::string& page, const std::string& html) const;
  // Writes the sheet. Throws FILE_UNWRITABLE.
  void Write(const std::vector<SheetRow>& rows) const;

 private:
  std::filesystem::path index_, pages_;
};

// The sheet: client/report/sheet.html with the rows in it. Pictures of all rows are in the page.
std::string SheetPage(const std::string& title, const std::string& pages_from_sheet, const std::vector<SheetRow>& rows);

// A PNG file of some 20 KB: the surface with a checkerboard in its UV, and the layout beside it. `uv` as in DrawMap(),
// but not limited to the unit square: a larger layout is scaled down.
std::string SheetPicture(const Mesh& mesh, const std::vector<double>& uv);

// A page about the map of `result`, whose warnings have the file's ids, beside the UV of the input, if it has any; with
// the images of both, if they moved into the new map. Reads the files that were written. `output`: where to, "-" is
// stdout. `options`: the options of the unwrap.
FinishedPage UnwrapReport(const UnwrapFiles& files, const UnwrapResult& result, const std::string& output,
                          const UnwrapOptions& options);

// A page of a sheet.
struct SheetPageJob {
  const ReportSheet& sheet;
  std::string page;    // its place on the sheet
  std::string output;  // the file that the batch wrote
  std::string made;    // SheetMember::made
};

// Writes the page of a file that was unwrapped; gives its card.
Json WritePage(const SheetPageJob& job, const UnwrapFiles& files, const UnwrapResult& result,
               const UnwrapOptions& options);

// The same for a file that an earlier run has done: its page is kept if `made` is equal. Otherwise a new page is
// written, of the output alone, without the UV before and the solve.
Json KeepPage(const SheetPageJob& job, int texcoord, const UnwrapOptions& options);

// ---- Pages about the UV that files have

// Tiles of a page; 0: the defaults of MapCheckOptions.
struct PageTiles {
  int texture_size = 0;
  int tiles = 0;
  double padding = 2;  // texels
};
MapCheckOptions CheckOptionsOf(const PageTiles& tiles);

// Throws UV_MISSING.
void RequireUv(const MeshInput& input, const CheckedMap& map);

// Writes a page of a sheet about the set `texcoord` of the file; gives its card, null after an interrupt.
Json WriteFilePage(const SheetPageJob& job, const MeshInput& input, int texcoord, const PageTiles& tiles,
                   const Execution& execution);

}  // namespace planish::cli
