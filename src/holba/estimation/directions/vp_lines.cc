// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/directions/vp_lines.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "holba/estimation/directions/direction_fit.h"
#include "holba/scene/views.h"

namespace holba {
namespace {

// Lines in fewer images are left out: two views always define a line, even a wrong one.
constexpr size_t kMinImages = 3;
constexpr int kHeldIterations = 5;

struct SegmentInView {
  const IdealView* view;
  LineSegment2d ideal;
  DirectionEvidence evidence;
};
// By image.
using LineSegments = std::map<image_t, std::vector<SegmentInView>>;

// Root mean square distance of the segments' ends from a line's images; an end further away than
// max_px counts with that.
double ErrorPx(const LineSegments& segments, const PlueckerLine& line, double max_px) {
  double sum = 0.0;
  size_t count = 0;
  for (const auto& [image_id, of_image] : segments) {
    for (const SegmentInView& segment : of_image) {
      const std::optional<Eigen::Vector3d> image = segment.view->Project(line);
      for (const Eigen::Vector2d& end : {segment.ideal.start, segment.ideal.end}) {
        const double distance = image ? std::abs(image->dot(end.homogeneous())) : max_px;
        sum += std::min(distance, max_px) * std::min(distance, max_px);
        ++count;
      }
    }
  }
  return std::sqrt(sum / static_cast<double>(count));
}

// The line along `direction` that fits the segments best (Cauchy loss of 1 px), near a point.
// Empty: they do not fix it.
std::optional<PlueckerLine> FitAlong(const LineSegments& segments, const Eigen::Vector3d& direction,
                                     Eigen::Vector3d point) {
  Eigen::Matrix<double, 3, 2> across;
  across.col(0) = direction.unitOrthogonal();
  across.col(1) = direction.cross(across.col(0));
  for (int iteration = 0; iteration < kHeldIterations; ++iteration) {
    Eigen::Matrix2d H = Eigen::Matrix2d::Zero();
    Eigen::Vector2d b = Eigen::Vector2d::Zero();
    for (const auto& [image_id, of_image] : segments) {
      for (const SegmentInView& segment : of_image) {
        // The image of the line is the normal of its plane with the camera centre, in the camera's
        // pixels: linear in the point.
        const Eigen::Matrix3d to_image =
            segment.view->InverseK().transpose() * segment.view->R() * -CrossMatrix(direction);
        const Eigen::Vector3d image = to_image * (point - segment.view->centre());
        const double scale = image.head<2>().norm();
        if (!(scale > 0.0)) return std::nullopt;
        for (const Eigen::Vector2d& end : {segment.ideal.start, segment.ideal.end}) {
          const double residual = image.dot(end.homogeneous()) / scale;
          const Eigen::RowVector2d J = end.homogeneous().transpose() * to_image * across / scale;
          const double weight = 1.0 / (1.0 + residual * residual);
          H += weight * J.transpose() * J;
          b += weight * residual * J.transpose();
        }
      }
    }
    const Eigen::Vector2d step = H.ldlt().solve(-b);
    if (!step.allFinite()) return std::nullopt;
    point += across * step;
  }
  return PlueckerLine::FromPointDirection(point, direction);
}

// Directions to which enough of a line's segments run, by rising error.
std::vector<size_t> Agreeing(const LineLabelOptions& options, const LineSegments& segments,
                             const std::vector<Eigen::Vector3d>& directions) {
  const double max_squared = options.max_error_px * options.max_error_px;
  const double min_images =
      std::max<double>(std::min<size_t>(options.min_images, segments.size()),
                       options.min_image_share * static_cast<double>(segments.size()));
  std::vector<std::pair<double, size_t>> agreeing;
  for (size_t i = 0; i < directions.size(); ++i) {
    size_t num_images = 0;
    double sum = 0.0;
    for (const auto& [image_id, of_image] : segments) {
      double worst = 0.0;
      for (const SegmentInView& segment : of_image) {
        worst = std::max(worst, segment.evidence.SquaredError(directions[i]));
      }
      num_images += worst < max_squared;
      sum += std::min(worst, max_squared);
    }
    if (static_cast<double>(num_images) >= min_images) agreeing.emplace_back(sum, i);
  }
  std::sort(agreeing.begin(), agreeing.end());
  std::vector<size_t> order;
  for (const auto& [error, i] : agreeing) order.push_back(i);
  return order;
}

}  // namespace

void LineLabelOptions::Describe(OptionTable* table) const {
  table->Section("VpLines");
  table->Field("max_error_px", &max_error_px, GreaterThan(0),
               "Largest distance of a segment's ends from the line to the vanishing point.");
  table->Field("min_images", &min_images, AtLeast(1),
               "Images in which a line runs to its vanishing point; of a line in fewer: all.");
  table->Field("min_image_share", &min_image_share, Between(0, 1),
               "The same as a part of the line's images.");
  table->Field("max_error_factor", &max_error_factor, AtLeast(1),
               "Largest error of a line along its vanishing point relative to its own.");
  table->Field("error_allowance_px", &error_allowance_px, AtLeast(0), "The same, in addition.");
  table->Field("min_lines", &min_lines, AtLeast(1), "Vanishing points of fewer lines are removed.");
}

LineLabelReport LabelLines(const LineLabelOptions& options, Reconstruction* model) {
  LineLabelReport report;
  const ViewMap views(*model);
  std::vector<group3D_t> vp_ids;
  std::vector<Eigen::Vector3d> directions;
  model->DeleteMembers({}, [](group3D_t, const Group3D& group, line3D_t) { return group.type->IsParallelism(); });
  for (const auto& [id, group] : model->groups3D) {
    if (!group.type->IsParallelism()) continue;
    vp_ids.push_back(id);
    directions.push_back(
        Eigen::Vector3d(group.params[0], group.params[1], group.params[2]).normalized());
    report.lines_of_vp[id] = 0;
  }
  for (const auto& [line_id, line] : model->lines3D) {
    LineSegments segments;
    for (const LineObservation& observation : line.track) {
      const IdealView& view = views.at(observation.image_id);
      const LineSegment2d& segment =
          model->images.at(observation.image_id).lines2D[observation.line2D_idx].segment;
      const std::optional<LineSegment2d> ideal = view.ToIdeal(segment);
      if (!ideal || !(ideal->Length() > 0.0)) continue;
      segments[observation.image_id].push_back(
          {&view, *ideal, DirectionEvidence(*ideal, view.K() * view.R())});
    }
    if (segments.size() < kMinImages) {
      ++report.dropped["line: in fewer than 3 images"];
      continue;
    }
    const std::vector<size_t> candidates = Agreeing(options, segments, directions);
    if (candidates.empty()) {
      ++report.dropped["line: runs to no vanishing point"];
      continue;
    }
    const double max_px = options.max_error_px;
    const double max_held_px = options.max_error_factor * ErrorPx(segments, line.line, max_px) +
                               options.error_allowance_px;
    const Eigen::Vector3d middle = 0.5 * (line.start + line.end);
    const auto best = std::find_if(candidates.begin(), candidates.end(), [&](size_t i) {
      const auto held = FitAlong(segments, directions[i], middle);
      return held && ErrorPx(segments, *held, max_px) <= max_held_px;
    });
    if (best == candidates.end()) {
      ++report.dropped["line: leaves its segments along its vanishing point"];
      continue;
    }
    model->AddLineMember(vp_ids[*best], line_id);
    ++report.lines_of_vp[vp_ids[*best]];
    ++report.num_labelled_lines;
  }
  std::set<group3D_t> removed;
  for (const auto& [id, num_lines] : report.lines_of_vp) {
    if (static_cast<int>(num_lines) >= options.min_lines) continue;
    removed.insert(id);
    report.num_labelled_lines -= num_lines;
    if (num_lines > 0) report.dropped["line: its vanishing point has too few"] += num_lines;
  }
  report.num_removed_vps = removed.size();
  if (removed.empty()) return report;
  for (const group3D_t id : removed) report.lines_of_vp.erase(id);
  model->DeleteGroups3D([&](group3D_t id, const Group3D&) { return removed.contains(id); });
  return report;
}

}  // namespace holba
