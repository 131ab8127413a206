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

// Plain parameters of the file by the robust fit (robust/group_fit.h). max_error: of an inlier; a
// distance for points, the sine of the angle for lines of types of parallelism. Empty: no sample
// gave a group.
std::optional<std::vector<double>> GroupStart(const GroupType& type,
                                              std::span<const Eigen::Vector3d> points,
                                              std::span<const PlueckerLine> lines, double max_error,
                                              Random* random);

}  // namespace holba
