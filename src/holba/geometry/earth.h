// SPDX-License-Identifier: BSD-3-Clause
// Places on the WGS84 ellipsoid in metres.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "holba/geometry/angle.h"

namespace holba {

// Earth-centred, Earth-fixed, of latitude and longitude in degrees and the height in metres.
inline Eigen::Vector3d EarthCentred(const Eigen::Vector3d& latitude_longitude_altitude) {
  constexpr double kSemiMajor = 6378137.0, kFlattening = 1.0 / 298.257223563;
  const double squared_eccentricity = kFlattening * (2.0 - kFlattening);
  const double latitude = DegToRad(latitude_longitude_altitude.x());
  const double longitude = DegToRad(latitude_longitude_altitude.y());
  const double height = latitude_longitude_altitude.z();
  const double sine = std::sin(latitude), cosine = std::cos(latitude);
  const double radius = kSemiMajor / std::sqrt(1.0 - squared_eccentricity * sine * sine);
  return {(radius + height) * cosine * std::cos(longitude),
          (radius + height) * cosine * std::sin(longitude),
          (radius * (1.0 - squared_eccentricity) + height) * sine};
}

// Rows: east, north and up at a place, in the Earth's axes.
inline Eigen::Matrix3d EastNorthUp(const Eigen::Vector3d& latitude_longitude_altitude) {
  const double latitude = DegToRad(latitude_longitude_altitude.x());
  const double longitude = DegToRad(latitude_longitude_altitude.y());
  Eigen::Matrix3d axes;
  axes << -std::sin(longitude), std::cos(longitude), 0.0,  //
      -std::sin(latitude) * std::cos(longitude), -std::sin(latitude) * std::sin(longitude),
      std::cos(latitude),  //
      std::cos(latitude) * std::cos(longitude), std::cos(latitude) * std::sin(longitude),
      std::sin(latitude);
  return axes;
}

}  // namespace holba
