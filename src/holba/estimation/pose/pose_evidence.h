// SPDX-License-Identifier: BSD-3-Clause
// All sightings of one image, prepared so that many poses can be tried.
#pragma once

#include <span>
#include <vector>

#include "holba/estimation/pose/gain.h"
#include "holba/estimation/pose/sighting_errors.h"

namespace holba {

class PoseEvidence {
 public:
  // Both must outlive it.
  PoseEvidence(const Camera& camera, const AbsolutePoseMatches& matches);

  const Camera& camera() const { return camera_; }
  const AbsolutePoseMatches& matches() const { return matches_; }
  // The calibration that directions in the camera are given for.
  const IdealCalibration& given_calibration() const { return given_; }

  // Of all sightings, their errors in units of `noise` (pixels, ideal pixels, radians). Stops and
  // gives -1 once it cannot become more than `to_beat`.
  //
  // With the camera's own intrinsics. Errors of points are those of their rays, made pixels by the
  // camera's derivatives at the observed pixel: exact at 0, the same to first order, and without
  // the camera's formulas.
  double GainOf(const Rigid3d& cam_from_world, const ForEachKind<double>& noise, const Gain& gain,
                double to_beat) const;
  // With other intrinsics; exact errors.
  double GainOf(const Rigid3d& cam_from_world, std::span<const double> params,
                const ForEachKind<double>& noise, const Gain& gain, double to_beat) const;

  // Squared errors in pixels, ideal pixels and radians; infinite where there is none.
  void SquaredErrors(const Rigid3d& cam_from_world, std::span<const double> params,
                     ForEachKind<std::vector<double>>* squared) const;

 private:
  size_t NumSightings() const {
    return matches_.points.size() + matches_.lines.size() + matches_.directions.size();
  }

  const Camera& camera_;
  const AbsolutePoseMatches& matches_;
  IdealCalibration given_;
  // Points with rays, column by column: X (3), ray (3), d_pixel by the ray over the relative sigma
  // (6, row-major). Of length stride_, which is num_rays_ up to whole blocks; the rest has no
  // error.
  size_t num_rays_ = 0, stride_ = 0;
  std::vector<double> columns_;
  // Of line sightings with ideal pixels: the ends as normalised image coordinates (x/z, y/z).
  struct PreparedLine {
    PlueckerLine line;
    Eigen::Vector3d start, end;
    double weight;  // 1 / relative_sigma^2
  };
  std::vector<PreparedLine> lines_;
};

}  // namespace holba
