// SPDX-License-Identifier: BSD-3-Clause
// Relations between groups: directions of vanishing points and normals of planes that are
// orthogonal or parallel as far as they are known.
#pragma once

#include <cstddef>
#include <map>
#include <string>

#include "holba/base/options.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct RelationOptions {
  // Beyond this two directions are not meant to be orthogonal or parallel, however badly they are
  // known: good planes agree with vanishing points within 1.7 degrees, bad ones miss by 15 and
  // more.
  double max_deviation_deg = 3.0;
  // Largest deviation in standard deviations of the angle.
  double max_sigmas = 3.0;
  // Standard deviations that add to those of the fits: of a vanishing point by poses, calibration
  // and craftsmanship; of a plane by the relief of what it stands for.
  double vp_sigma_deg = 0.3;
  double plane_sigma_deg = 0.7;

  void Describe(OptionTable* table) const;
};

struct RelationReport {
  // New ones: "VP-VP orthogonal", "PLANE-VP parallel", ...
  std::map<std::string, size_t> formed;
  size_t num_formed = 0;
  size_t num_known = 0;                   // were there before
  std::map<std::string, size_t> dropped;  // groups and pairs, by reason
};

// Adds relations to the model between all vanishing points and planes; a pair that has one already
// is left as it is. A vanishing point is orthogonal to a plane's normal if it lies in the plane.
RelationReport FormRelations(const RelationOptions& options, Reconstruction* model);

}  // namespace holba
