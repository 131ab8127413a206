// SPDX-License-Identifier: BSD-3-Clause
// Whether one record of the scene is valid by itself, whatever else the model holds. Readers ask as
// they parse, so that a fault is reported at its place in the file; FindInconsistency asks for
// every record. Each function returns the fault in words (without the record's id), or nothing.
#pragma once

#include <optional>
#include <string>

#include "holba/scene/reconstruction.h"

namespace holba {

using Fault = std::optional<std::string>;

// Finite, quaternion of norm 1 to 1e-3 (files round; a quaternion that is further off is a
// mistake).
Fault FindFault(const Rigid3d& pose);
// Known model, its number of parameters, all finite, focal lengths not 0.
Fault FindFault(const Camera& camera);
Fault FindFault(const Point3D& point);
// Finite, |d| = 1 to 1e-6, and d.m = 0 to 1e-6 of the line's distance from the origin.
Fault FindFault(const Line3D& line);
// Members: at least one, of kinds that the type takes, none twice.
Fault FindFault(const Group2D& group);
// Members of kinds that the type takes, none twice (there may be none: not yet), and parameters that the
// type takes as a group.
Fault FindFault(const Group3D& group);

// "camera 3", "IMU 4".
std::string ToString(const SensorId& sensor);
// "VP, PLANE, SPHERE": every group type there is.
std::string GroupTypeNames();

}  // namespace holba
