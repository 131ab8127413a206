// SPDX-License-Identifier: BSD-3-Clause
#include "holba/view/view_observations.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <optional>

#include "holba/base/threads.h"
#include "holba/estimation/lines/line_uncertainty.h"
#include "holba/estimation/points/point_uncertainty.h"

namespace holba {
namespace {

// Where the observations of each feature begin.
std::vector<size_t> Begins(const std::vector<uint32_t>& lengths) {
  std::vector<size_t> begins = {0};
  for (const uint32_t length : lengths) begins.push_back(begins.back() + length);
  return begins;
}

float ErrorOfPoint(const Camera& camera, const Image& image, const Eigen::Vector3d& xyz,
                   const Eigen::Vector2d& seen) {
  Eigen::Vector2d pixel;
  if (!camera.model->project(camera.params.data(), image.cam_from_world * xyz, &pixel))
    return -1.0f;
  const double error = (pixel - seen).norm();
  return std::isfinite(error) ? static_cast<float>(error) : -1.0f;
}

float ErrorOfLine(const IdealView& view, const PlueckerLine& line, const LineSegment2d& segment) {
  const auto ideal = view.ToIdeal(segment);
  const auto image = view.Project(line);
  if (!ideal || !image) return -1.0f;
  const double error = std::max(std::abs(image->dot(ideal->start.homogeneous())),
                                std::abs(image->dot(ideal->end.homogeneous())));
  return std::isfinite(error) ? static_cast<float>(error) : -1.0f;
}

// Model units: the relative sigma of its ends by their mean depth in the images of its track.
float SigmaOfLine(const Reconstruction& model, const ViewMap& views, line3D_t id,
                  const Line3D& line, double sigma_px) {
  const auto uncertainty = UncertaintyOfLine(model, views, id, sigma_px);
  if (!uncertainty) return 0.0f;
  double depth = 0.0;
  for (const LineObservation& observation : line.track)
    depth += views.at(observation.image_id).Depth(0.5 * (line.start + line.end));
  const double sigma =
      uncertainty->RelativeSigma() * depth / static_cast<double>(line.track.size());
  return std::isfinite(sigma) && sigma > 0.0 ? static_cast<float>(sigma) : 0.0f;
}

}  // namespace

uint16_t PositionOfView(double pixels, const Camera& camera) {
  const double side = static_cast<double>(std::max<uint64_t>({camera.width, camera.height, 1}));
  const double part = (pixels / side + 0.125) / 1.25;
  if (!(part > 0.0)) return 0;
  return static_cast<uint16_t>(std::lround(std::min(part, 1.0) * 65535.0));
}

ViewObservations ObservationsOfPoints(const Reconstruction& model, const ViewMap& views,
                                      double sigma_px, int num_threads,
                                      std::vector<int16_t>* covariances) {
  ViewObservations result;
  for (const auto& [id, point] : model.points3D)
    result.length.push_back(static_cast<uint32_t>(point.track.size()));
  const std::vector<size_t> begins = Begins(result.length);
  result.image.resize(begins.back());
  result.positions.resize(2 * begins.back());
  result.error_px.resize(begins.back());
  result.sigma.resize(model.points3D.size());
  covariances->assign(6 * model.points3D.size(), 0);
  ParallelFor(num_threads, model.points3D.size(), [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Point3D& point = (model.points3D.begin() + i)->second;
      for (size_t k = 0; k < point.track.size(); ++k) {
        const PointObservation& observation = point.track[k];
        const Image& image = model.images.at(observation.image_id);
        const Camera& camera = model.cameras.at(image.camera_id);
        const Eigen::Vector2d& xy = image.points2D[observation.point2D_idx].xy;
        const size_t at = begins[i] + k;
        result.image[at] = views.IndexOf(observation.image_id);
        result.error_px[at] = ErrorOfPoint(camera, image, point.xyz, xy);
        for (int c = 0; c < 2; ++c) result.positions[2 * at + c] = PositionOfView(xy[c], camera);
      }
      const auto covariance = PointCovariance(views, point.xyz, point.track, sigma_px);
      if (!covariance || !covariance->allFinite()) continue;
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(*covariance,
                                                                  Eigen::EigenvaluesOnly);
      const double variance = solver.eigenvalues()[2];
      if (!(variance > 0.0)) continue;
      result.sigma[i] = static_cast<float>(std::sqrt(variance));
      int16_t* out = &(*covariances)[6 * i];
      for (int r = 0; r < 3; ++r) {
        for (int c = r; c < 3; ++c) {
          *out++ = static_cast<int16_t>(std::lround((*covariance)(r, c) / variance * 32767.0));
        }
      }
    }
  });
  return result;
}

ViewObservations ObservationsOfLines(const Reconstruction& model, const ViewMap& views,
                                     double sigma_px, int num_threads) {
  ViewObservations result;
  for (const auto& [id, line] : model.lines3D)
    result.length.push_back(static_cast<uint32_t>(line.track.size()));
  const std::vector<size_t> begins = Begins(result.length);
  result.image.resize(begins.back());
  result.positions.resize(4 * begins.back());
  result.error_px.resize(begins.back());
  result.sigma.resize(model.lines3D.size());
  ParallelFor(num_threads, model.lines3D.size(), [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const auto& [id, line] = *(model.lines3D.begin() + i);
      for (size_t k = 0; k < line.track.size(); ++k) {
        const LineObservation& observation = line.track[k];
        const Image& image = model.images.at(observation.image_id);
        const Camera& camera = model.cameras.at(image.camera_id);
        const LineSegment2d& segment = image.lines2D[observation.line2D_idx].segment;
        const size_t at = begins[i] + k;
        result.image[at] = views.IndexOf(observation.image_id);
        result.error_px[at] = ErrorOfLine(views.at(observation.image_id), line.line, segment);
        const double ends[] = {segment.start.x(), segment.start.y(), segment.end.x(),
                               segment.end.y()};
        for (int c = 0; c < 4; ++c) result.positions[4 * at + c] = PositionOfView(ends[c], camera);
      }
      if (!line.track.empty()) result.sigma[i] = SigmaOfLine(model, views, id, line, sigma_px);
    }
  });
  return result;
}

}  // namespace holba
