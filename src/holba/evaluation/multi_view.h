// SPDX-License-Identifier: BSD-3-Clause
// ETH3D's multi-view protocol: a reconstructed cloud of points against laser scans, as its
// evaluation program measures (Schoeps et al., "A multi-view stereo benchmark with high-resolution
// images and multi-camera videos", CVPR 2017, and its README). For a tolerance t
//   completeness  a scanned point is complete if a reconstructed point is within t,
//   accuracy      a scanned point is the end of a beam of the scanner, whose radius grows with the
//                 distance from the scanner. Of the beams in which a reconstructed point lies
//                 (distance from the beam's axis at most the radius at the point's own distance
//                 from the scanner): it is accurate if the scanned point of one is within t, else
//                 inaccurate if it is in front of the scanned point of one (space that is known to
//                 be free), else nothing is known of it and it does not count,
//   F1            2 a c / (a + c).
// Both are means over voxels of the share of the points in each, over two grids of voxels of which
// one is shifted by half a voxel, so that dense places count no more than thin ones.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "holba/base/options.h"
#include "holba/geometry/rigid3d.h"

namespace holba {

struct MultiViewOptions {
  // Of the paper's Table 3, and of ETH3D.
  std::vector<double> tolerances_cm = {1, 2, 5, 10};
  double voxel_size_m = 0.01;
  // Of the scanner that ETH3D was scanned with (a Faro Focus X 330): half the diameter of 2.25 mm
  // at its exit, and its divergence.
  double beam_start_radius_mm = 1.125;
  double beam_divergence_halfangle_deg = 0.011;

  void Describe(OptionTable* table) const;
};

// One scan, or a cloud of unknown origin.
struct TruthScan {
  std::span<const Eigen::Vector3d> points;  // in the frame of the scan, metres
  Rigid3d world_from_scan;
  // Whether the scanner was at the scan's origin. Without, there is no free space: a point that is
  // farther than t from all scanned ones is inaccurate.
  bool has_scanner = false;
};

struct MultiViewErrors {
  // For each tolerance; 0 without points.
  std::vector<double> accuracy_percent, completeness_percent, f1_percent;
  // Reconstructed points that count, for each tolerance.
  std::vector<size_t> num_observed;
};

// `points`: the reconstruction in the world, metres.
MultiViewErrors MeasureMultiView(std::span<const Eigen::Vector3d> points,
                                 std::span<const TruthScan> scans, const MultiViewOptions& options,
                                 int num_threads);

}  // namespace holba
