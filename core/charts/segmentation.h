// Which faces make up which chart, and where charts are slit open: every chart is a disc.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/base/execution.h"
#include "core/charts/gluing.h"
#include "core/charts/surface.h"
#include "core/charts/tuning.h"
#include "core/mesh/symmetry.h"

namespace planish {

class Segmentation {
 public:
  // Charts as large as the surface lets them be (kWhole): connected pieces, slit open where they are closed or have
  // holes or handles. Or cut so that their estimated root mean square stretch is at most `max_stretch` (kStretch).
  enum class Kind { kWhole, kStretch };

  // `surface` must outlive this. After a stop request kStretch ends with more and smaller charts. Of no use after a
  // cancellation.
  Segmentation(const Surface& surface, Kind kind, double max_stretch, const Execution& execution,
               const AtlasTuning& tuning = {});

  // Goes on from other charts of the same faces (kStretch), whose surface Rejoin() has made `surface` of: what was
  // glued is glued, and charts are merged across new pairs of half-edges.
  Segmentation(const Surface& surface, const Segmentation& before, double max_stretch, const Execution& execution);

  // The charts of `half`, which leaves out the second side of `mirror`, and their mirror images. `surface` has the same
  // faces. Chart n + i, of n, is the image of chart i, and empty where that lies across the plane. Further charts are
  // what lies apart from these images. `half` must have `mirror.polygon`, and no chart of faces from the first side and
  // from across the plane.
  static Segmentation Mirrored(const Surface& surface, const Segmentation& half, const Mirror& mirror);

  const Gluing& gluing() const { return gluing_; }
  // Per face: its chart; -1 for faces that take no part.
  const std::vector<std::int32_t>& chart() const { return chart_; }
  // Faces of each chart, ascending.
  const std::vector<std::vector<std::int32_t>>& charts() const { return faces_; }
  // Per vertex of the surface's mesh: where estimates of the stretch of charts may start (StretchEstimate). Empty for
  // kWhole.
  const std::vector<float>& kept() const { return kept_; }

  // Whether part of a chart's outline is a slit: the same edge from both sides.
  bool HasSlit(std::int32_t chart) const;

  struct Cut {
    std::int32_t chart;
    // Two of its faces that must come apart; -1: any, the farther apart the better.
    std::int32_t face = -1, other_face = -1;
    // Per face of the chart, in the order of charts(): the part it goes to, from 0 on, each of them connected. Empty:
    // two parts, cut halfway between the two faces.
    std::vector<std::int32_t> part = {};
  };
  // Cuts each of these charts in parts. One part keeps its number, the others get new ones; all of those numbers are
  // returned, ascending. Charts of one face, or polygon, stay.
  std::vector<std::int32_t> Split(const std::vector<Cut>& cuts, const Execution& execution);

  // Two charts and one of their borders (gluing.h): half-edges of `chart`, in the order of its outline.
  struct Joint {
    std::int32_t chart, other;
    std::vector<HalfedgeHandle> border;
  };
  // The outline of a chart, from FirstOnOutline() (gluing.h) on; empty if it has no faces.
  std::vector<HalfedgeHandle> Outline(std::int32_t chart) const;
  // All joints at which two charts could become one disc, by `chart`, which is the lower number of the two. `outlines`:
  // Outline() of each.
  std::vector<Joint> Joints(std::vector<std::vector<HalfedgeHandle>> outlines) const;

  // What Join() has done.
  struct Joined {
    std::int32_t chart, other;
    GluedBorder border;
    std::vector<std::int32_t> faces, other_faces;  // before
  };
  // Makes one chart of two, which keeps the number `chart`; `other` is empty then. Nothing if a vertex of the outline
  // would open wider than AtlasTuning::widest. The joint is one of Joints(), and the two charts have not changed since.
  std::optional<Joined> Join(const Joint& joint);
  // The last Join() of these two charts.
  void UndoJoin(const Joined& joined);
  // Moves the border of two charts, or a slit of one (`chart` twice): half-edges `from` are glued, `to` become seams.
  // Nothing happens, and it returns false, unless that leaves as many discs, none of whose outlines opens wider than
  // AtlasTuning::widest where they have changed. With `from` and `to` exchanged it puts everything back.
  bool MoveSeam(std::int32_t chart, std::int32_t other, std::span<const HalfedgeHandle> from,
                std::span<const HalfedgeHandle> to);
  // Closes the gaps in the numbers that empty charts leave. The order stays.
  void DropEmpty();

  // A distance, and the number of what it is measured from.
  using Nearness = std::pair<double, std::int32_t>;

 private:
  Segmentation(const Surface& surface, const AtlasTuning& tuning)
      : surface_(surface), tuning_(tuning), gluing_(surface), chart_(surface.num_faces(), -1) {}
  void CollectFaces();
  void PrepareScratch();
  void MakeDiscs();
  bool HandOver(std::int32_t chart, std::int32_t other, std::span<const HalfedgeHandle> from,
                std::span<const HalfedgeHandle> to);
  bool Recut(std::int32_t chart, std::int32_t other, std::span<const HalfedgeHandle> from,
             std::span<const HalfedgeHandle> to);
  bool IsDisc(const std::vector<std::int32_t>& faces, std::vector<char>* is_seen) const;

  const Surface& surface_;
  const AtlasTuning tuning_;
  Gluing gluing_;
  std::vector<std::int32_t> chart_;
  std::vector<std::vector<std::int32_t>> faces_;
  std::vector<float> kept_;
  // What Split() keeps between calls, so that faces which stay where they are take no time; empty before the first.
  // Per face; is_seen: per half-edge.
  struct {
    std::vector<Nearness> nearness;
    std::vector<std::int32_t> moving;
    std::vector<char> is_seen, is_glued;
  } scratch_;
};

}  // namespace planish
