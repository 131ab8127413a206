// SPDX-License-Identifier: BSD-3-Clause
// Members of groups after the features have moved: parameters estimated anew, members that do not
// fit dropped, groups without enough support removed (the paper's appendix "Incremental Mapping").
#pragma once

#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/estimation/groups/group_estimation.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct MemberOptions {
  GroupFitOptions fit;  // its limits are also the farthest that any member may be
  // A member farther than this many median absolute distances from the group is dropped; 3 are 2
  // standard deviations of normal noise.
  double max_mads = 3.0;
  // Members nearer than this stay whatever the median is, so that repeated calls do not wear a good
  // group down.
  double keep_px = 1.0;
  double keep_deg = 0.5;  // lines of a vanishing point
  int min_inliers = 3;
  double min_inlier_ratio = 0.5;
  int num_threads = -1;

  void Describe(OptionTable* table) const;
};

struct MemberReport {
  size_t groups = 0, points = 0, lines = 0;  // kept
  // By type and reason: "PLANE point: beyond the limit", "SPHERE group: few inliers", ...
  std::map<std::string, size_t> dropped;
};

// Which features belong to a group of given parameters.
struct MemberTest {
  double limit = 0.0;           // px or degrees
  std::vector<bool> is_inlier;  // points, then lines
  size_t num_inliers = 0;
};
MemberTest TestMembers(const GroupType& type, const std::vector<double>& residuals,
                       const MemberOptions& options);

// Reason why a group with these numbers of inliers is not kept; null: it is kept. Beside the
// bounds of the options, a surface of more than three unknowns needs more features than determine
// it: as many as determine it always fit.
const char* FaultOfSupport(const GroupType& type, size_t num_points, size_t num_lines,
                           size_t num_members, const MemberOptions& options);

// For every group: estimates its parameters by FitGroup (starting from the present ones), tests its
// members, and refits the parameters to those that stay. Drops features that the model no longer
// has.
MemberReport UpdateMembers(const MemberOptions& options, Reconstruction* model);

}  // namespace holba
