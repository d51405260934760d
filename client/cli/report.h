// The pages that `report` and `unwrap --report` write. The contact sheet of many files is an index page, with a small
// picture and the key figures of every file, and a page for each file.
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
  std::string result;          // ToString(BatchResult), e.g. "usable"; "shown" for a page of `report`
  std::string message;         // why it failed or is not usable
  Json card;                   // FinishedPage::card; null without a page
  double seconds = -1;         // time of the unwrap; negative: nothing was unwrapped
  std::int64_t triangles = 0;  // number of triangles, for a file without a card; 0: not known
};

// The paths of a contact sheet and its pages.
class ReportSheet {
 public:
  // `place`: the value of --report or -o. For DIR, the sheet is DIR/index.html and the pages are in DIR; for FILE.html,
  // the sheet is FILE.html and the pages are in FILE_files.
  explicit ReportSheet(const std::string& place);

  const std::filesystem::path& index() const { return index_; }
  const std::filesystem::path& pages() const { return pages_; }
  // "props/a.obj" has the page "props/a.obj.html".
  static std::string PageOf(const std::string& key) { return key + ".html"; }
  std::string PathOf(const std::string& page) const { return (pages_ / page).string(); }
  // The path of the sheet relative to a page, for a link.
  std::string SheetFrom(const std::string& page) const;

  // Makes the directory of the pages. Throws FILE_UNWRITABLE, also if the sheet could not be written.
  void Prepare() const;
  // Writes a page, and makes its directory if necessary. Throws FILE_UNWRITABLE.
  void WritePage(const std::string& page, const std::string& html) const;
  // Writes the sheet. Throws FILE_UNWRITABLE.
  void Write(const std::vector<SheetRow>& rows) const;

 private:
  std::filesystem::path index_, pages_;
};

// The HTML of a sheet: client/report's template with the rows and their pictures. `pages_from_sheet`: the path from the
// sheet to the pages, with '/' at the end unless it is empty.
std::string SheetPage(const std::string& title, const std::string& pages_from_sheet, const std::vector<SheetRow>& rows);

// A PNG file of about 20 KB: the surface with a checkerboard, and the layout beside it. `uv` is as for DrawMap(), but
// need not be in the unit square: a larger layout is scaled down.
std::string SheetPicture(const Mesh& mesh, const std::vector<double>& uv);

// A page about the map of `result`, whose warnings have the file's ids, beside the UV of the input, if it has any; with
// the images of both, if they moved into the new map. Reads the files that were written. `output`: where to, "-" is
// stdout. `options`: the options of the unwrap.
FinishedPage UnwrapReport(const UnwrapFiles& files, const UnwrapResult& result, const std::string& output,
                          const UnwrapOptions& options);

// A page of a sheet.
struct SheetPageJob {
  const ReportSheet& sheet;
  std::string page;    // path of the page below ReportSheet::pages()
  std::string output;  // the file that the batch wrote
  std::string made;    // SheetMember::made
};

// Writes the page of a file that was unwrapped; gives its card.
Json WritePage(const SheetPageJob& job, const UnwrapFiles& files, const UnwrapResult& result,
               const UnwrapOptions& options);

// Returns the card of a file that an earlier run has done. Its page is kept if its `made` equals that of `job`.
// Otherwise a new page is written, which shows only the output, without the UV before the unwrap and the solve.
Json KeepPage(const SheetPageJob& job, int texcoord, const UnwrapOptions& options);

// ---- Pages about the UV that files have

// The tiles that a page assumes for UV; 0: the default of MapCheckOptions.
struct PageTiles {
  int texture_size = 0;
  int tiles = 0;
  double padding = 2;  // texels
};
MapCheckOptions CheckOptionsOf(const PageTiles& tiles);

// Throws UV_MISSING if `map`, which is that of `input`, has no UV.
void RequireUv(const MeshInput& input, const CheckedMap& map);

// Writes a page of a sheet about the set `texcoord` of the file; gives its card, null after an interrupt.
Json WriteFilePage(const SheetPageJob& job, const MeshInput& input, int texcoord, const PageTiles& tiles,
                   const Execution& execution);

}  // namespace planish::cli
