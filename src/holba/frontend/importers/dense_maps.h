// SPDX-License-Identifier: BSD-3-Clause
// Depth and normals of every pixel, as networks and stereo give them, and the plane normals of
// labelled regions in them.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Covers the whole image, whose size may differ.
struct DepthMap {
  int width = 0;
  int height = 0;
  // Row by row; 0 or less, or not finite: unknown. Along the optical axis (z), or along the ray.
  std::vector<float> depth;
  bool along_ray = false;
};

struct NormalMap {
  int width = 0;
  int height = 0;
  // Row by row, camera frame (x right, y down, z forward), any length; zero or not finite: unknown.
  // The side is free.
  std::vector<Eigen::Vector3f> normals_in_cam;
};

struct RegionNormalOptions {
  // Pixels this close to the region's rim are left out: networks and stereo blur depth there. Of an
  // image whose long side is 800 px.
  double margin_px = 4.0;
  // Least share of the region's normals within max_deviation_deg of the mean: else it is no plane,
  // or the map is wrong there.
  double min_share = 0.6;
  double max_deviation_deg = 20.0;
  // Normals needed for a mean.
  int min_num_normals = 20;
  // Floor of the spread: the errors of a network's normals in one region are alike.
  double min_sigma_deg = 2.0;
  // Side of the windows in which depths are fitted by planes, of 800 px: wide enough to average the
  // steps of quantised depths.
  double window_px = 12.0;
  void Describe(OptionTable* table) const;
};

// For each region of a plane: the geometric median of its normals, towards the camera. sigma_deg:
// their spread about it, for one direction of tilt (median angle / 1.1774). `dropped` counts the
// regions without one, by reason.
std::map<uint16_t, RegionNormal> NormalsOfRegions(const LabelMap& labels, const NormalMap& normals,
                                                  const Camera& camera,
                                                  const RegionNormalOptions& options,
                                                  std::map<std::string, size_t>* dropped);
// The same from depths: planes fitted to small windows of each region.
std::map<uint16_t, RegionNormal> NormalsOfRegions(const LabelMap& labels, const DepthMap& depths,
                                                  const Camera& camera,
                                                  const RegionNormalOptions& options,
                                                  std::map<std::string, size_t>* dropped);

}  // namespace holba
