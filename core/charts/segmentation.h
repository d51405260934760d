// The charts of a surface: which faces each one has, and where it is slit open. Every chart is a disc.
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
  // kWhole: each connected piece of the surface is a chart, slit open where it is closed or has holes or handles.
  // kStretch: charts end where their estimated root mean square stretch would exceed `max_stretch`.
  enum class Kind { kWhole, kStretch };

  // `surface` must outlive this. After a stop request kStretch ends with more and smaller charts. After a cancellation
  // the result is incomplete and must not be used.
  Segmentation(const Surface& surface, Kind kind, double max_stretch, const Execution& execution,
               const AtlasTuning& tuning = {});

  // Continues from the charts `before` of the same faces (kStretch). Rejoin() has made `surface` from their surface.
  // Glued edges stay glued, and charts are merged across the new pairs of half-edges.
  Segmentation(const Surface& surface, const Segmentation& before, double max_stretch, const Execution& execution);

  // The charts of `half`, from which the second side of `mirror` takes no part, and their mirror images. `surface` has
  // all faces. If `half` has n charts, chart n + i is the image of chart i, empty if chart i lies across the plane.
  // Faces of the second side without an image, and pieces of charts that are not connected, become further charts.
  // `half` must have the polygons `mirror.polygon`, and no chart with faces both from the first side and from across
  // the plane.
  static Segmentation Mirrored(const Surface& surface, const Segmentation& half, const Mirror& mirror);

  // Copies the charts of `other`, the segmentation of a surface of about the same shape. Face f of `surface` gets the
  // chart of face like[f] of `other`; if like[f] is -1, the chart of a neighbour. Chart i is like chart i of
  // `other`, without pieces that are not connected with the largest. Slits run near the slits of `other`. Some
  // charts may be empty, and pieces of `surface` without a counterpart become further charts.
  static Segmentation Like(const Surface& surface, const Segmentation& other, std::vector<std::int32_t> like,
                           const Execution& execution);

  const Gluing& gluing() const { return gluing_; }
  // Per face: its chart; -1 for faces that take no part.
  const std::vector<std::int32_t>& chart() const { return chart_; }
  // Faces of each chart, ascending.
  const std::vector<std::vector<std::int32_t>>& charts() const { return faces_; }
  // Per vertex of the surface's mesh: the u from which estimates of the stretch of charts may start (StretchEstimate).
  // Empty for kWhole.
  const std::vector<float>& kept() const { return kept_; }

  // Whether part of a chart's outline is a slit: the same edge from both sides.
  bool HasSlit(std::int32_t chart) const;

  struct Cut {
    std::int32_t chart;
    // Two faces of the chart that must end up in different parts; -1: two faces that are far apart.
    std::int32_t face = -1, other_face = -1;
    // Per face of the chart, in the order of charts(): the number of its part, from 0 on. Every part must be connected.
    // Empty: two parts, cut halfway between the two faces.
    std::vector<std::int32_t> part = {};
  };
  // Cuts each of these charts in parts. One part keeps the chart's number, the others get new ones. Returns the numbers
  // of all parts, ascending. Charts of one face, or of one polygon, are not cut.
  std::vector<std::int32_t> Split(const std::vector<Cut>& cuts, const Execution& execution);

  // Two charts and one of their borders (gluing.h): half-edges of `chart`, in the order of its outline.
  struct Joint {
    std::int32_t chart, other;
    std::vector<HalfedgeHandle> border;
    bool is_part = false;  // `border` is a part of the border; the rest becomes a slit
  };
  // The outline of a chart, from FirstOnOutline() (gluing.h) on; empty if it has no faces.
  std::vector<HalfedgeHandle> Outline(std::int32_t chart) const;
  // All joints at which two charts could become one disc, sorted by `chart`, the lower number of the two. `outlines`:
  // Outline() of every chart.
  std::vector<Joint> Joints(std::vector<std::vector<HalfedgeHandle>> outlines) const;

  // The result of Join(), from which UndoJoin() restores both charts.
  struct Joined {
    std::int32_t chart, other;
    GluedBorder border;
    std::vector<std::int32_t> faces, other_faces;  // of the two charts before
  };
  // Joins two charts into one with the number `chart`; `other` is then empty. Returns nullopt, and changes nothing, if
  // a vertex of the outline would open wider than AtlasTuning::Widest(). The joint, or the joint of
  // which it is a part, must come from Joints(), and the two charts must not have changed since.
  std::optional<Joined> Join(const Joint& joint);
  // Undoes the last Join() of these two charts.
  void UndoJoin(const Joined& joined);
  // Moves the border of two charts, or a slit of one (`chart` twice): half-edges `from` are glued, `to` become seams.
  // Returns false, and changes nothing, if that would not leave as many discs, or if an outline would open wider than
  // AtlasTuning::Widest() where it changes.
  bool MoveSeam(std::int32_t chart, std::int32_t other, std::span<const HalfedgeHandle> from,
                std::span<const HalfedgeHandle> to);
  // Undoes the last MoveSeam(), with the same arguments, of these two charts.
  void UndoMoveSeam(std::int32_t chart, std::int32_t other, std::span<const HalfedgeHandle> from,
                    std::span<const HalfedgeHandle> to);
  // Removes empty charts and renumbers the others in the same order.
  void DropEmpty();

  // A distance, and the index of the source from which it is measured.
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
  // Arrays that Split() and others keep between calls, so that a call takes no time for faces that it does not change.
  // Empty before the first call. Per face; is_seen: per half-edge.
  struct {
    std::vector<Nearness> nearness;
    std::vector<std::int32_t> moving;
    std::vector<char> is_seen, is_glued;
  } scratch_;
};

}  // namespace planish
