// SPDX-License-Identifier: BSD-3-Clause
// Degrees and radians: options, reports and files are in degrees, computations in radians.
#pragma once

#include <numbers>

namespace holba {

constexpr double DegToRad(double deg) { return deg * std::numbers::pi / 180.0; }
constexpr double RadToDeg(double rad) { return rad * 180.0 / std::numbers::pi; }

// The same as factors. A product with one rounds once where the functions round twice: the last bit
// may differ.
inline constexpr double kRadPerDeg = DegToRad(1.0);
inline constexpr double kDegPerRad = RadToDeg(1.0);

}  // namespace holba
