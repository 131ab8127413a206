// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/reliability.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <set>
#include <vector>

#include "holba/base/threads.h"
#include "holba/estimation/lines/line_uncertainty.h"
#include "holba/estimation/points/point_uncertainty.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

enum class Verdict : uint8_t { kReliable, kFewImages, kSmallAngle, kUncertain };

Verdict Judge(const ReliabilityOptions& options, const ViewMap& views, double sigma_px,
              const Point3D& point) {
  if (NumImages(point.track) < static_cast<size_t>(options.min_point_images))
    return Verdict::kFewImages;
  if (MaxTriangulationAngleRad(views, point.xyz, point.track) <
      DegToRad(options.min_point_angle_deg))
    return Verdict::kSmallAngle;
  const auto covariance = PointCovariance(views, point.xyz, point.track, sigma_px);
  if (!covariance) return Verdict::kUncertain;
  double depth = 0.0;
  for (const PointObservation& o : point.track)
    depth += views.at(o.image_id).Depth(point.xyz) / static_cast<double>(point.track.size());
  const double sigma =
      std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(*covariance, Eigen::EigenvaluesOnly)
                    .eigenvalues()[2]);
  return sigma <= options.max_point_relative_sigma * depth ? Verdict::kReliable
                                                           : Verdict::kUncertain;
}

Verdict Judge(const ReliabilityOptions& options, const ViewMap& views, double sigma_px,
              line3D_t line_id, const Reconstruction& model) {
  const Line3D& line = model.lines3D.at(line_id);
  std::set<image_t> images;
  for (const LineObservation& o : line.track) images.insert(o.image_id);
  if (images.size() < static_cast<size_t>(options.min_line_images)) return Verdict::kFewImages;
  const auto uncertainty = UncertaintyOfLine(model, views, line_id, sigma_px);
  return uncertainty && uncertainty->RelativeSigma() <= options.max_line_relative_sigma
             ? Verdict::kReliable
             : Verdict::kUncertain;
}

}  // namespace

void ReliabilityOptions::Describe(OptionTable* table) const {
  table->Section("Reliability");
  table->Field("min_point_images", &min_point_images, AtLeast(2),
               "Points of fewer images do not move cameras.");
  table->Field("min_point_angle_deg", &min_point_angle_deg, Between(0, 90),
               "Nor do points whose rays meet at less.");
  table->Field("min_line_images", &min_line_images, AtLeast(2),
               "Lines of fewer images do not move cameras.");
  table->Field("max_point_relative_sigma", &max_point_relative_sigma, GreaterThan(0),
               "Nor do points with a greater standard deviation, relative to their depth.");
  table->Field("max_line_relative_sigma", &max_line_relative_sigma, GreaterThan(0),
               "Nor do lines whose ends have a greater one.");
}

Reliability ClassifyFeatures(const ReliabilityOptions& options, double point_sigma_px,
                             double line_sigma_px, int num_threads, const Reconstruction& model) {
  const ViewMap views(model);
  std::vector<Verdict> of_point(model.points3D.size()), of_line(model.lines3D.size());
  ParallelFor(num_threads, of_point.size(), [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      of_point[i] = Judge(options, views, point_sigma_px, (model.points3D.begin() + i)->second);
  });
  ParallelFor(num_threads, of_line.size(), [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      of_line[i] = Judge(options, views, line_sigma_px, (model.lines3D.begin() + i)->first, model);
  });

  Reliability result;
  const auto count = [&](const char* kind, Verdict verdict, int min_images, double min_angle_deg,
                         double max_sigma) {
    std::string reason;
    if (verdict == Verdict::kFewImages) {
      reason = fmt::format("{} in fewer than {} images", kind, min_images);
    } else if (verdict == Verdict::kSmallAngle) {
      reason = fmt::format("{} whose rays meet at less than {:g} degrees", kind, min_angle_deg);
    } else {
      reason =
          fmt::format("{} uncertain by more than {:g} % of their depth", kind, 100.0 * max_sigma);
    }
    ++result.reasons[reason];
  };
  for (size_t i = 0; i < of_point.size(); ++i) {
    if (of_point[i] == Verdict::kReliable) continue;
    result.unreliable_points.insert((model.points3D.begin() + i)->first);
    count("points", of_point[i], options.min_point_images, options.min_point_angle_deg,
          options.max_point_relative_sigma);
  }
  for (size_t i = 0; i < of_line.size(); ++i) {
    if (of_line[i] == Verdict::kReliable) continue;
    result.unreliable_lines.insert((model.lines3D.begin() + i)->first);
    count("lines", of_line[i], options.min_line_images, 0.0, options.max_line_relative_sigma);
  }
  return result;
}

}  // namespace holba
