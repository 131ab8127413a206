// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/triangulate_lines.h"

#include <algorithm>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "holba/estimation/lines/line_triangulation.h"
#include "holba/estimation/lines/line_uncertainty.h"

namespace holba {
namespace {

// Two images that show a line leave nothing to tell a wrong one, but it costs a camera nothing
// either, and the third image can be registered by it.
constexpr size_t kMinImages = 2;
// Of the ends of a line across it, by their depth: farther out its image in the next photograph
// says nothing. COLMAP's smallest angle of points gives depths about as badly.
constexpr double kMaxRelativeSigma = 0.05;
// After an adjustment, in units of LineOptions::max_distance_px, observations are too far off.
constexpr double kFilterFactor = 2.0;
constexpr double kMergeFactor = 4.0;
// Open matches of a segment that are looked at, the best first: all pairs of them are tried.
constexpr size_t kMaxSupports = 12;

class LineTriangulator {
 public:
  LineTriangulator(const LineOptions& options, MapperState* state)
      : options_(options), state_(*state), model_(state->model()), views_(state->model()) {}

  LineChanges OfImage(image_t image_id) {
    const size_t num_segments =
        std::min(model_.images.at(image_id).lines2D.size(), state_.graph().NumSegments(image_id));
    for (line2D_t idx = 0; idx < num_segments; ++idx) OfSegment({image_id, idx});
    return changes_;
  }

  LineChanges Merge(std::span<const line3D_t> ids) {
    for (const line3D_t id : ids) {
      while (model_.lines3D.contains(id) && MergeOne(id)) {
      }
    }
    return changes_;
  }

  size_t Filter(std::span<const line3D_t> ids) {
    size_t num_removed = 0;
    for (const line3D_t id : ids) {
      if (model_.lines3D.contains(id)) num_removed += FilterOne(id);
    }
    return num_removed;
  }

 private:
  line3D_t LineOf(const LineObservation& observation) const {
    const Image* image = model_.images.Find(observation.image_id);
    return image != nullptr ? image->lines2D[observation.line2D_idx].line3D_id : kNoId;
  }

  std::optional<LineSupport> SupportOf(const LineObservation& observation) {
    const IdealView& view = views_.Of(observation.image_id);
    const auto ideal = view.ToIdeal(
        model_.images.at(observation.image_id).lines2D[observation.line2D_idx].segment);
    if (!ideal || ideal->Length() < options_.min_segment_px) return std::nullopt;
    return LineSupport(view, *ideal, observation.image_id);
  }

  std::vector<LineSupport> SupportsOf(std::span<const LineObservation> track) {
    std::vector<LineSupport> supports;
    for (const LineObservation& observation : track) {
      if (auto support = SupportOf(observation)) supports.push_back(std::move(*support));
    }
    return supports;
  }

  void OfSegment(const LineObservation& self) {
    if (LineOf(self) != kNoId) return;
    const auto matches = state_.graph().LineCorrespondencesOf(self.image_id, self.line2D_idx);
    if (matches.empty()) return;
    const auto support = SupportOf(self);
    if (!support) return;
    std::vector<LineObservation> open = {self};
    std::optional<std::pair<double, line3D_t>> best;
    for (const LineCorrespondence& match : matches) {
      const LineObservation other{match.image_id, match.line2D_idx};
      if (!model_.images.contains(other.image_id)) continue;
      const line3D_t id = LineOf(other);
      if (id == kNoId) {
        if (open.size() < kMaxSupports) open.push_back(other);
        continue;
      }
      const LineWithExtent placed = WithExtent(model_.lines3D.at(id));
      if (!ShowsLine(*support, placed.line, placed.t_start, placed.t_end, options_.max_distance_px,
                     options_.min_overlap))
        continue;
      const double squared = SquaredDistance(*support, placed.line);
      if (!best || squared < best->first) best = {squared, id};
    }
    if (best) {
      state_.Observe(best->second, self);
      ++changes_.continued;
      return;
    }
    Create(&open);
  }

  void Create(std::vector<LineObservation>* open) {
    // What matches a match belongs to the same line, most likely.
    const size_t num_direct = open->size();
    for (size_t i = 1; i < num_direct && open->size() < kMaxSupports; ++i) {
      const LineObservation from = (*open)[i];
      for (const LineCorrespondence& match :
           state_.graph().LineCorrespondencesOf(from.image_id, from.line2D_idx)) {
        const LineObservation other{match.image_id, match.line2D_idx};
        if (open->size() == kMaxSupports || !model_.images.contains(other.image_id) ||
            LineOf(other) != kNoId || std::find(open->begin(), open->end(), other) != open->end())
          continue;
        open->push_back(other);
      }
    }
    std::vector<LineSupport> supports;
    std::vector<LineObservation> seen;
    for (const LineObservation& observation : *open) {
      auto support = SupportOf(observation);
      if (!support) continue;
      supports.push_back(std::move(*support));
      seen.push_back(observation);
    }
    if (supports.size() < kMinImages) return;
    const auto line = TriangulateLine(supports, options_, kMinImages, kMaxRelativeSigma);
    if (!line) return;
    std::vector<LineObservation> track;
    for (size_t i = 0; i < seen.size(); ++i) {
      if (line->is_inlier[i]) track.push_back(seen[i]);
    }
    state_.AddLine(line->line.Pluecker(), line->line.At(line->t_start), line->line.At(line->t_end),
                   track);
    ++changes_.created;
  }

  bool MergeOne(line3D_t id) {
    const Line3D& line = model_.lines3D.at(id);
    for (const LineObservation& observation : line.track) {
      for (const LineCorrespondence& match :
           state_.graph().LineCorrespondencesOf(observation.image_id, observation.line2D_idx)) {
        const line3D_t other = LineOf({match.image_id, match.line2D_idx});
        if (other == kNoId || other == id ||
            !tried_.insert({std::min(id, other), std::max(id, other)}).second)
          continue;
        std::vector<LineObservation> track = line.track;
        const Line3D& second = model_.lines3D.at(other);
        // What did not go together does not until one of them is seen by more images.
        size_t& length_tried =
            state_.line_merges_tried[{std::min(id, other), std::max(id, other)}];
        const size_t length = line.track.size() + second.track.size();
        if (length <= length_tried) continue;
        length_tried = length;
        track.insert(track.end(), second.track.begin(), second.track.end());
        const std::vector<LineSupport> supports = SupportsOf(track);
        AnchoredLine joint =
            WithExtent(second.track.size() > line.track.size() ? second : line).line;
        // A fit does not bring together what is far apart.
        const double far_px = kMergeFactor * options_.max_distance_px;
        const bool is_near = std::all_of(supports.begin(), supports.end(), [&](const auto& s) {
          return SquaredDistance(s, joint) <= 2.0 * far_px * far_px;
        });
        if (supports.size() != track.size() || !is_near ||
            !FitLine(supports, LinePrior(), options_.max_distance_px, &joint))
          continue;
        const auto extent = ExtentOfLine(supports, joint);
        if (!extent || !std::all_of(supports.begin(), supports.end(), [&](const LineSupport& s) {
              return ShowsLine(s, joint, extent->first, extent->second, options_.max_distance_px,
                               options_.min_overlap);
            }))
          continue;
        state_.MergeLines(id, other);
        SetLine(id, joint, *extent);
        ++changes_.merged;
        return true;
      }
    }
    return false;
  }

  void SetLine(line3D_t id, const AnchoredLine& line, const std::pair<double, double>& extent) {
    Line3D& record = state_.mutable_model()->lines3D.at(id);
    record.line = line.Pluecker();
    record.start = line.At(extent.first);
    record.end = line.At(extent.second);
  }

  size_t FilterOne(line3D_t id) {
    const Line3D& line = model_.lines3D.at(id);
    const LineWithExtent placed = WithExtent(line);
    std::vector<LineObservation> wrong;
    std::vector<LineSupport> supports;
    std::set<image_t> images;
    for (const LineObservation& observation : line.track) {
      const auto support = SupportOf(observation);
      const bool fits = support && ShowsLine(*support, placed.line, placed.t_start, placed.t_end,
                                             kFilterFactor * options_.max_distance_px, 0.0);
      if (!fits) {
        wrong.push_back(observation);
        continue;
      }
      supports.push_back(*support);
      images.insert(observation.image_id);
    }
    const auto extent = ExtentOfLine(supports, placed.line);
    const auto uncertainty = extent ? UncertaintyOfFit(supports, LinePrior(), options_.sigma_px,
                                                       placed.line, extent->first, extent->second)
                                    : std::nullopt;
    if (images.size() < kMinImages || !uncertainty ||
        uncertainty->RelativeSigma() > 2.0 * kMaxRelativeSigma) {
      const size_t count = line.track.size();
      state_.DeleteLine(id);
      return count;
    }
    for (const LineObservation& observation : wrong) state_.Forget(observation);
    SetLine(id, placed.line, *extent);
    return wrong.size();
  }

  const LineOptions& options_;
  MapperState& state_;
  const Reconstruction& model_;
  ViewCache views_;
  std::set<std::pair<line3D_t, line3D_t>> tried_;
  LineChanges changes_;
};

}  // namespace

LineChanges& LineChanges::operator+=(const LineChanges& other) {
  created += other.created;
  continued += other.continued;
  merged += other.merged;
  return *this;
}

LineChanges TriangulateLines(const LineOptions& options, image_t image_id, MapperState* state) {
  return LineTriangulator(options, state).OfImage(image_id);
}
LineChanges MergeLines(const LineOptions& options, std::span<const line3D_t> line_ids,
                       MapperState* state) {
  return LineTriangulator(options, state).Merge(line_ids);
}
size_t FilterLines(const LineOptions& options, std::span<const line3D_t> line_ids,
                   MapperState* state) {
  return LineTriangulator(options, state).Filter(line_ids);
}

}  // namespace holba
