// Gluing charts, where the cost of seams falls most.
#include <algorithm>
#include <utility>

#include "core/mesh/symmetry.h"
#include "core/unwrap/seam_search.h"

namespace planish {

bool SeamSearch::IsImage(std::int32_t i, std::int32_t j) const {
  const std::int32_t i_image = ImageOf(i), j_image = ImageOf(j);
  return i_image >= 0 && j_image >= 0 && std::minmax(i_image, j_image) < std::minmax(i, j);
}

void SeamSearch::Push(std::int32_t i, bool all, double most_area) {
  std::vector<HalfedgeHandle> outline = segmentation_.Outline(i);
  const std::size_t edges = outline.size();
  for (const auto& [border, other] : BordersAlong(segmentation_.gluing(), segmentation_.chart(), &outline)) {
    if (!all && other < i) continue;
    if (IsImage(i, other) || std::min(area_[i], area_[other]) > most_area) continue;
    if (edges + estimates_.of(other).outline.size() < 2 * border.size() + 3) continue;
    const double most = (ImageOf(i) >= 0 ? 2 : 1) * (cost_.OfPath(border) + tuning_.chart_price);
    if (HasFailed({border.front().idx(), border.size()}, i, other)) continue;
    queue_.push({most, false, pushed_++, {i, other, {border.begin(), border.end()}}, version_[i], version_[other]});
  }
}

bool SeamSearch::Join(const Segmentation::Joint& joint, Glued* glued) {
  std::optional<Segmentation::Joined> joined = segmentation_.Join(joint);
  if (!joined) return false;
  const std::int32_t i = joint.chart, j = joint.other;
  glued->joined.push_back(*std::move(joined));
  glued->areas.push_back({area_[i], area_[j]});
  area_[i] += std::exchange(area_[j], 0.0);
  return true;
}

template <class IsOfUse>
std::optional<double> SeamSearch::Estimate(std::int32_t i, const IsOfUse& is_of_use, std::optional<Draft> draft,
                                           Glued* glued) {
  glue_left_ -= static_cast<double>(segmentation_.charts()[i].size());
  if (draft) {
    estimates_.Swap(i, &draft->estimate);
    glued->estimates.emplace_back(i, std::move(draft->estimate));
  } else {
    glued->estimates.emplace_back(i, estimates_.Replace(i));
  }
  if (!MayBeSound(i)) return std::nullopt;
  const double cost = CostOf(i);
  if (!is_of_use(cost)) return cost;
  estimates_.Trace(i);
  return IsSound(i) ? std::optional(CostOf(i)) : std::nullopt;
}

void SeamSearch::Undo(Glued* glued) {
  for (std::size_t k = glued->joined.size(); k-- > 0;) {
    const Segmentation::Joined& joined = glued->joined[k];
    area_[joined.chart] = glued->areas[k][0];
    area_[joined.other] = glued->areas[k][1];
    segmentation_.UndoJoin(joined);
  }
  for (std::size_t k = glued->estimates.size(); k-- > 0;) {
    estimates_.Swap(glued->estimates[k].first, &glued->estimates[k].second);
  }
}

std::optional<Segmentation::Joint> SeamSearch::BorderOf(std::int32_t i, std::int32_t j,
                                                        std::vector<HalfedgeHandle> border) const {
  if (border.empty() || surface_.face_across(border.front()) < 0) return std::nullopt;
  if (ChartOf(border.front()) != i) {
    std::reverse(border.begin(), border.end());
    for (HalfedgeHandle& h : border) h = surface_.mesh->opposite_halfedge_handle(h);
  }
  const Gluing& gluing = segmentation_.gluing();
  for (std::size_t k = 0; k < border.size(); ++k) {
    const HalfedgeHandle h = border[k];
    const bool is_border =
        gluing.IsOutline(h) && surface_.face_across(h) >= 0 && ChartOf(h) == i && ChartAcross(h) == j;
    if (!is_border) return std::nullopt;
    if (k == 0) continue;
    // A slit of either chart may end between the two edges.
    const HalfedgeHandle last = border[k - 1], across = gluing.mesh().opposite_halfedge_handle(h);
    if (gluing.After(last) != h || gluing.After(across) != gluing.mesh().opposite_halfedge_handle(last)) {
      return std::nullopt;
    }
  }
  if (segmentation_.Outline(i).size() + segmentation_.Outline(j).size() < 2 * border.size() + 3) return std::nullopt;
  return Segmentation::Joint{i, j, std::move(border)};
}

std::optional<double> SeamSearch::Try(const Segmentation::Joint& joint, double least, std::optional<Draft> draft) {
  const std::int32_t i = joint.chart, j = joint.other, i_image = ImageOf(i), j_image = ImageOf(j);
  const bool is_own = i_image == j || (i_image == i && j_image == j);
  std::vector<HalfedgeHandle> border;
  if (i_image >= 0 && j_image >= 0) {
    border = ImageOf(joint.border);
    if (is_own && !border.empty() && !Meet(joint.border, border)) return std::nullopt;
  }
  // Image charts are estimated only where this chart gains enough.
  const bool has_image = !is_own && i_image >= 0 && j_image >= 0;
  const std::int32_t to = !has_image ? -1 : i_image == i || j_image == j ? i : i_image;
  const std::int32_t from = !has_image ? -1 : i_image == i ? j_image : j_image == j ? i_image : j_image;
  double gain = CostOf(i) + CostOf(j) + cost_.OfPath(joint.border), other_gain = 0;
  Glued glued;
  bool is_sound = Join(joint, &glued);
  if (is_sound && has_image) {
    std::optional<Segmentation::Joint> other = BorderOf(to, from, std::move(border));
    if (other) other->is_part = joint.is_part;
    is_sound = other && Join(*other, &glued);
    if (is_sound) {
      double& its_gain = to == i ? gain : other_gain;
      its_gain += (to == i ? 0 : CostOf(to)) + CostOf(from) + cost_.OfPath(other->border);
    }
  }
  const bool is_pair = has_image && to != i;
  const auto estimate = [&](std::int32_t chart, const auto& is_of_use, std::optional<Draft> made, double* its_gain) {
    const std::optional<double> cost = Estimate(chart, is_of_use, std::move(made), &glued);
    *its_gain -= cost.value_or(0);
    is_sound = is_sound && cost.has_value();
  };
  if (is_sound) {
    estimate(
        i, [&](double cost) { return (is_pair ? 2 : 1) * (gain - cost) >= kWorthIt; }, std::move(draft), &gain);
  }
  if (is_sound && is_pair && 2 * gain >= least) {
    estimate(
        to, [&](double cost) { return gain + (other_gain - cost) >= kWorthIt; }, std::nullopt, &other_gain);
    gain += other_gain;
  } else if (is_pair) {
    gain *= 2;
  }
  if (!is_sound || gain < least) {
    Undo(&glued);
    return is_sound ? std::optional(gain) : std::nullopt;
  }
  for (const Segmentation::Joined& joined : glued.joined) {
    ++version_[joined.chart];
    ++version_[joined.other];
  }
  if (!charts_.image.empty()) {
    std::vector<std::int32_t>& image = charts_.image;
    if (i_image >= 0 && j_image >= 0) {
      if (i_image == j || i_image == i || j_image == j) image[i] = i;
    } else if (i_image < 0 && j_image >= 0 && j_image != j) {
      image[i] = j_image;
      image[j_image] = i;
    } else if (j_image == j) {
      image[i] = i;
    }
  }
  return gain;
}

bool SeamSearch::MayBeDrafted(const Segmentation::Joint& joint) const {
  const std::int32_t i = joint.chart, j = joint.other, i_image = ImageOf(i), j_image = ImageOf(j);
  return i_image < 0 || j_image < 0 || (i_image != i && i_image != j && j_image != j);
}

std::optional<SeamSearch::Draft> SeamSearch::TakeDraft(const Candidate& candidate) {
  const auto found = drafts_.find(candidate.number);
  if (found == drafts_.end()) return std::nullopt;
  std::optional<Draft> draft = std::move(found->second);
  drafts_.erase(found);
  return draft;
}

void SeamSearch::MakeDrafts(const Candidate& best) {
  const int threads = job_.execution.Team().size();
  if (threads == 1 || drafts_.contains(best.number) || !MayBeDrafted(best.joint)) return;
  std::erase_if(drafts_, [&](const auto& entry) {
    const Draft& draft = entry.second;
    return !IsCurrent(draft.chart, draft.version, draft.other, draft.other_version);
  });
  ++stamp_;
  stamps_.resize(count(), 0);
  const auto mark = [&](std::int32_t i, std::int32_t j) { stamps_[i] = stamps_[j] = stamp_; };
  for (const auto& [number, draft] : drafts_) mark(draft.chart, draft.other);
  std::vector<Candidate> chosen = {best}, popped;
  mark(best.joint.chart, best.joint.other);
  const auto most = static_cast<std::size_t>(kAheadPerThread * threads);
  while (!queue_.empty() && chosen.size() < most && popped.size() < 4 * most) {
    popped.push_back(queue_.top());
    queue_.pop();
    const Candidate& next = popped.back();
    const std::int32_t i = next.joint.chart, j = next.joint.other;
    if (!IsCurrent(i, next.version, j, next.other_version) || !MayBeDrafted(next.joint)) continue;
    if (stamps_[i] == stamp_ || stamps_[j] == stamp_) continue;
    mark(i, j);
    chosen.push_back(next);
  }
  for (Candidate& candidate : popped) queue_.push(std::move(candidate));
  std::vector<Segmentation::Joined> joined;
  std::vector<Draft*> drafts;
  for (const Candidate& candidate : chosen) {
    std::optional<Segmentation::Joined> of_two = segmentation_.Join(candidate.joint);
    if (!of_two) continue;
    joined.push_back(*std::move(of_two));
    Draft& draft = drafts_[candidate.number];
    draft = {candidate.joint.chart, candidate.joint.other, candidate.version, candidate.other_version, {}};
    drafts.push_back(&draft);
  }
  estimates_.Reserve();
  job_.execution.Team().ForEach(
      std::ssize(drafts),
      [&](std::int64_t k) {
        const std::int32_t i = drafts[k]->chart;
        drafts[k]->estimate = estimates_.Replace(i);
        if (MayBeSound(i)) estimates_.Trace(i);
      },
      /*chunk_size=*/1);
  for (std::size_t k = drafts.size(); k-- > 0;) {
    estimates_.Swap(drafts[k]->chart, &drafts[k]->estimate);
    segmentation_.UndoJoin(joined[k]);
  }
}

double SeamSearch::Glue(double most_area) {
  double gained = 0;
  queue_ = {};
  drafts_ = {};
  for (std::int32_t i = 0; i < count(); ++i) {
    if (!segmentation_.charts()[i].empty()) Push(i, false, most_area);
  }
  while (!queue_.empty() && glue_left_ > 0 && GoesOn()) {
    Tell();
    Candidate best = queue_.top();
    queue_.pop();
    const std::int32_t i = best.joint.chart, j = best.joint.other;
    if (!IsCurrent(i, best.version, j, best.other_version)) continue;
    // A candidate that gains nearly as much as the next one may gain at most is glued at once.
    constexpr double kNearly = 0.9;
    const double least = best.is_known || queue_.empty() ? kWorthIt : std::max(kWorthIt, kNearly * queue_.top().gain);
    MakeDrafts(best);
    const std::optional<double> gain = Try(best.joint, least, TakeDraft(best));
    if (!gain || !(*gain >= kWorthIt)) {
      const TriMesh& mesh = segmentation_.gluing().mesh();
      const std::size_t edges = best.joint.border.size();
      Fail({best.joint.border.front().idx(), edges}, i, j);
      Fail({mesh.opposite_halfedge_handle(best.joint.border.back()).idx(), edges}, j, i);
      continue;
    }
    if (*gain < least) {
      best.gain = *gain;
      best.is_known = true;
      queue_.push(std::move(best));
      continue;
    }
    gained += *gain;
    Push(i, true, most_area);
    const std::int32_t image = ImageOf(i);
    if (image >= 0 && image != i) Push(image, true, most_area);
  }
  return gained;
}

void SeamSearch::GlueCrumbs() {
  std::swap(glue_left_, crumb_left_);  // Try() counts in glue_left_
  Glue(tuning_.crumb_area * charts_.total_area);
  std::swap(glue_left_, crumb_left_);
}

}  // namespace planish
