// SPDX-License-Identifier: BSD-3-Clause
// Which surface a ray meets first, by Embree, whose floats choose the surface; the distance comes
// from the surface's equation in doubles. The same for any number of threads.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>

#include "holba/render/surface.h"

namespace holba {

class RayCaster {
 public:
  // The surfaces must outlive it and stay as they are.
  explicit RayCaster(std::span<const Surface> surfaces);
  ~RayCaster();
  RayCaster(const RayCaster&) = delete;
  RayCaster& operator=(const RayCaster&) = delete;

  struct Hit {
    int surface = -1;
    double distance = 0.0;
    Eigen::Vector3d point;
    Eigen::Vector3d normal;    // outward
    bool from_outside = true;  // the ray came from where the normal points to
  };
  // The first surface farther than `near` along the unit `ray`. Empty: none.
  std::optional<Hit> Cast(const Eigen::Vector3d& from, const Eigen::Vector3d& ray,
                          double near = kNear) const;
  // Whether anything is between two points, kNear off both.
  bool IsBlocked(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const;
  // Whether anything is in this direction.
  bool IsCovered(const Eigen::Vector3d& from, const Eigen::Vector3d& ray) const;

  // A tenth of a millimetre: above the rounding of floats tens of metres from the origin, below
  // what is built.
  static constexpr double kNear = 1e-4;

 private:
  struct Embree;
  std::span<const Surface> surfaces_;
  std::unique_ptr<Embree> embree_;
};

}  // namespace holba
