// SPDX-License-Identifier: BSD-3-Clause
// Robust start values of groups of any type from their noisy and in part wrong members.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "holba/base/random.h"
#include "holba/geometry/line.h"
#include "holba/group/group_type.h"

namespace holba {

// Plain parameters of the file. Types with ProjectPoint: RANSAC (MSAC scores) over minimal samples
// of points, then Levenberg-Marquardt on the inliers' distances to the surface. Types of
// parallelism: the direction near which most lines are, then the principal direction of these.
// max_error: of an inlier; a distance for points, the sine of the angle for lines. Empty: no sample
// gave a group.
std::optional<std::vector<double>> FitGroupRobustly(const GroupType& type,
                                                    std::span<const Eigen::Vector3d> points,
                                                    std::span<const PlueckerLine> lines,
                                                    double max_error, Random* random);

}  // namespace holba
