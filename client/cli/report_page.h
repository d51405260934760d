// The page of a report: one HTML file with all it shows, for browsers with WebGL 2.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/cli/check.h"
#include "client/cli/mesh_input.h"
#include "client/cli/report_images.h"
#include "client/cli/results.h"

namespace planish::cli {

// A map on the page. Its references must stay valid until the page is made.
struct ReportedMap {
  std::string name;  // "hero.glb", "before"
  const MeshInput& input;
  const CheckedMap& map;  // has UV
  const MapCheckOptions& options;
  double padding = 0;  // texels round charts that the layout shows
  MapTextures textures;
};

// What a page of a sheet has in addition (report.h).
struct SheetMember {
  std::string sheet;    // where the sheet is, seen from the page: "../index.html"
  std::string made;     // what the page was made of, so that a later run knows it again
  std::string picture;  // of the map, a PNG file
};

struct FinishedPage {
  std::string html;
  // The figures of the last map for a sheet: "triangles", "charts", "stretch" (L2), "efficiency", "overlaps" (pairs),
  // "flipped", "warnings" (as many as the page lists); of a member "made" and "picture" (base64) too.
  Json card;
};

// The page: client/report/template.html with the data in it. Positions and UV are rounded to 16 bits of their extent;
// the data take some 10 bytes a triangle, and the images of `images` their own (ReportImages). `unwrap` is what `unwrap
// --json` printed about the last map, with "tolerance" if that is known; null: nothing. `title`: what the page is
// about; empty: the names of the maps. At most two maps. A member of a sheet has its card in it: ReadCard().
// Deterministic.
FinishedPage ReportPage(const std::vector<ReportedMap>& maps, ReportImages* images, const std::optional<Json>& unwrap,
                        const std::string& title = "", const std::optional<SheetMember>& member = std::nullopt);

// The card of the page in the file `path`; null if that is no page of a sheet.
Json ReadCard(const std::string& path);

// `json` for the inside of a <script>: nothing in it looks like the end of that.
std::string ForScript(const Json& json);

// A page of client/report with `data` where its data belong.
std::string FillTemplate(std::string_view page, const std::string& data);

// The built pages of client/report, from the repository.
std::string_view ReportTemplate();  // of one mesh, or two
std::string_view SheetTemplate();   // of many: report.h

}  // namespace planish::cli
