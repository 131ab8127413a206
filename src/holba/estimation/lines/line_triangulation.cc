// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/line_triangulation.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "holba/geometry/angle.h"

namespace holba {
namespace {

// Unit normal of the plane through the centre and the segment.
Eigen::Vector3d PlaneNormal(const LineSupport& support) {
  const Eigen::Vector3d a = support.ray_from_pixel * support.start.homogeneous(),
                        b = support.ray_from_pixel * support.end.homogeneous();
  return a.cross(b).normalized();
}

// The meet of two supports' planes, with the point that the middle of the first segment shows.
std::optional<AnchoredLine> Meet(const LineSupport& a, const LineSupport& b, double min_sine) {
  const Eigen::Vector3d n1 = PlaneNormal(a), n2 = PlaneNormal(b);
  const Eigen::Vector3d direction = n1.cross(n2);
  if (!(direction.norm() >= min_sine)) return std::nullopt;
  const Eigen::Vector3d ray =
      (a.ray_from_pixel * (0.5 * (a.start + a.end)).homogeneous()).normalized();
  const double across = n2.dot(ray);
  if (std::abs(across) < min_sine) return std::nullopt;
  const double length = n2.dot(b.centre - a.centre) / across;
  const AnchoredLine line{direction.normalized(), a.centre + length * ray};
  if (!(a.Depth(line.point) > 0.0) || !(b.Depth(line.point) > 0.0)) return std::nullopt;
  return line;
}

// Share of the shorter interval that both cover.
double Overlap(const std::pair<double, double>& a, const std::pair<double, double>& b) {
  const double both = std::min(a.second, b.second) - std::max(a.first, b.first);
  const double shorter = std::min(a.second - a.first, b.second - b.first);
  return shorter > 0.0 ? both / shorter : 0.0;
}

struct Agreement {
  std::vector<bool> is_inlier;
  size_t num_images = 0;
  double cost = 0.0;  // truncated squares, px^2
};

Agreement Agree(std::span<const LineSupport> supports, const AnchoredLine& line,
                const std::pair<double, double>& extent, const LineOptions& options) {
  Agreement agreement;
  const double bound = 2.0 * options.max_distance_px * options.max_distance_px;
  std::set<uint32_t> views;
  for (const LineSupport& support : supports) {
    const bool shows = ShowsLine(support, line, extent.first, extent.second,
                                 options.max_distance_px, options.min_overlap);
    agreement.is_inlier.push_back(shows);
    agreement.cost += shows ? std::min(SquaredDistance(support, line), bound) : bound;
    if (shows) views.insert(support.view);
  }
  agreement.num_images = views.size();
  return agreement;
}

std::vector<LineSupport> Selected(std::span<const LineSupport> supports,
                                  const std::vector<bool>& which) {
  std::vector<LineSupport> selected;
  for (size_t i = 0; i < supports.size(); ++i) {
    if (which[i]) selected.push_back(supports[i]);
  }
  return selected;
}

}  // namespace

bool ShowsLine(const LineSupport& support, const AnchoredLine& line, double t_start, double t_end,
               double max_distance_px, double min_overlap) {
  const auto image = support.Image(line);
  if (!image) return false;
  if (std::abs(image->dot(support.start.homogeneous())) > max_distance_px ||
      std::abs(image->dot(support.end.homogeneous())) > max_distance_px)
    return false;
  const auto extent = support.Extent(line);
  return extent && Overlap(*extent, {t_start, t_end}) >= min_overlap;
}

std::optional<TriangulatedLine> TriangulateLine(std::span<const LineSupport> supports,
                                                const LineOptions& options, size_t min_num_images,
                                                double max_relative_sigma) {
  const double min_sine = std::sin(DegToRad(options.min_ray_plane_angle_deg));
  std::optional<std::pair<AnchoredLine, Agreement>> best;
  for (size_t i = 0; i < supports.size(); ++i) {
    for (size_t j = i + 1; j < supports.size(); ++j) {
      if (supports[i].view == supports[j].view) continue;
      const auto line = Meet(supports[i], supports[j], min_sine);
      const auto extent = line ? supports[i].Extent(*line) : std::nullopt;
      if (!extent) continue;
      Agreement agreement = Agree(supports, *line, *extent, options);
      if (!agreement.is_inlier[i] || !agreement.is_inlier[j]) continue;
      const bool is_better =
          !best || agreement.num_images > best->second.num_images ||
          (agreement.num_images == best->second.num_images && agreement.cost < best->second.cost);
      if (is_better) best = {*line, std::move(agreement)};
    }
  }
  if (!best || best->second.num_images < min_num_images) return std::nullopt;

  TriangulatedLine result;
  result.line = best->first;
  result.is_inlier = best->second.is_inlier;
  for (int round = 0; round < 2; ++round) {
    const std::vector<LineSupport> inliers = Selected(supports, result.is_inlier);
    if (!FitLine(inliers, LinePrior(), options.max_distance_px, &result.line)) return std::nullopt;
    const auto extent = ExtentOfLine(inliers, result.line);
    if (!extent) return std::nullopt;
    result.t_start = extent->first;
    result.t_end = extent->second;
    Agreement agreement = Agree(supports, result.line, *extent, options);
    result.num_images = agreement.num_images;
    result.is_inlier = std::move(agreement.is_inlier);
    if (result.num_images < min_num_images) return std::nullopt;
  }
  const auto uncertainty =
      UncertaintyOfFit(Selected(supports, result.is_inlier), LinePrior(), options.sigma_px,
                       result.line, result.t_start, result.t_end);
  if (!uncertainty || uncertainty->RelativeSigma() > max_relative_sigma) return std::nullopt;
  result.relative_sigma = uncertainty->RelativeSigma();
  return result;
}

}  // namespace holba
