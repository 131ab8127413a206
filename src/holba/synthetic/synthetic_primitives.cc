// SPDX-License-Identifier: BSD-3-Clause
// Primitives of synthetic scenes. Their shapes are drawn at about the size of the region
// (GroupType's Examples() are chosen to try the formulas, with sizes from 1e-6 to 1e5, and would
// not fit).
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <sstream>
#include <string>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/geometry/rigid3d.h"
#include "holba/group/known_types.h"
#include "holba/synthetic/synthetic_structure.h"

namespace holba {
namespace {

constexpr size_t kPointsOfPrimitive = 60;
// Points are kept inside a cube of this half-extent about the shape.
constexpr double kHalfExtent = 0.9;

// Plain parameters of a shape at the origin, by the names that files give them. Empty: a type with
// parameters of other names.
std::optional<std::vector<double>> DrawShape(const GroupType& type, Random* random) {
  static const std::map<std::string, double> kFixed = {
      {"cx", 0}, {"cy", 0}, {"cz", 0}, {"ax", 0}, {"ay", 0}, {"az", -0.6}, {"dx", 0}, {"dy", 0},
      {"dz", 1}, {"mx", 0}, {"my", 0}, {"mz", 0}, {"qw", 1}, {"qx", 0},    {"qy", 0}, {"qz", 0}};
  std::vector<double> params;
  std::istringstream names{std::string(type.file_params)};
  std::string name;
  while (names >> name) {
    if (const auto it = kFixed.find(name); it != kFixed.end()) {
      params.push_back(it->second);
    } else if (name == "r" || name.front() == 's') {
      params.push_back(random->Uniform(0.4, 0.8));
    } else if (name.front() == 'w') {
      params.push_back(-random->Uniform(0.4, 0.8));
    } else if (name == "alpha") {
      params.push_back(random->Uniform(0.3, 0.6));
    } else {
      return std::nullopt;
    }
  }
  HOLBA_CHECK(params.size() == static_cast<size_t>(type.num_file_params));
  return params;
}

// The faces of a cuboid are unbounded planes: whether X is on the box itself (R = identity).
bool IsInsideBox(const std::vector<double>& plain, const Eigen::Vector3d& X) {
  for (int i = 0; i < 3; ++i) {
    if (X[i] + plain[4 + 2 * i] > 1e-9 || -X[i] + plain[5 + 2 * i] > 1e-9) return false;
  }
  return true;
}

Eigen::Quaterniond RandomRotation(Random* random) {
  Eigen::Vector4d q;
  for (double& x : q) x = random->Normal();
  return Eigen::Quaterniond(q).normalized();
}

}  // namespace

std::vector<const GroupType*> PrimitiveTypes() {
  std::vector<const GroupType*> types;
  for (const GroupType* type : AllGroupTypes()) {
    Random random(0);
    if (type->TakesPoints() && !IsPlane(*type) && DrawShape(*type, &random)) types.push_back(type);
  }
  return types;
}

void AddPrimitive(const GroupType& type, const SyntheticRegion& region, Random* random,
                  SyntheticStructure* structure) {
  const auto shape = DrawShape(type, random);
  if (!shape) {
    throw InputError("--primitives: there is no example of " + std::string(type.name) +
                     " to make; use another type");
  }
  std::array<double, kMaxGroupParams> g{}, moved{};
  HOLBA_CHECK(type.from_file(shape->data(), g.data()));

  std::vector<Eigen::Vector3d> surface;
  for (int attempt = 0; surface.size() < kPointsOfPrimitive; ++attempt) {
    HOLBA_CHECK_MSG(attempt < 100000, "a primitive has too few points");
    Eigen::Vector3d X, projected;
    for (double& x : X) x = random->Uniform(-kHalfExtent, kHalfExtent);
    if (!type.project_point(g.data(), X, &projected)) continue;
    if (projected.cwiseAbs().maxCoeff() > kHalfExtent) continue;
    if (IsCuboid(type) && !IsInsideBox(*shape, projected)) continue;
    // All points behind a cone's apex fall on it: one is enough.
    const bool is_new = std::none_of(
        surface.begin(), surface.end(),
        [&](const Eigen::Vector3d& other) { return (other - projected).norm() < 1e-3; });
    if (is_new) surface.push_back(projected);
  }

  Sim3d place;
  place.scale = 0.5 * region.half_extent.minCoeff();
  place.rotation = RandomRotation(random);
  for (int i = 0; i < 3; ++i) {
    const double slack = region.half_extent[i] - std::sqrt(3.0) * kHalfExtent * place.scale;
    place.translation[i] = region.centre[i] + random->Uniform(-slack, slack);
  }
  type.transform(place, g.data(), moved.data());
  SyntheticGroup group{&type, std::vector<double>(type.num_file_params), {}, {}};
  type.to_file(moved.data(), group.params.data());
  for (const Eigen::Vector3d& X : surface) {
    group.points.push_back(static_cast<uint32_t>(structure->points.size()));
    structure->points.push_back(place * X);
  }
  structure->groups.push_back(std::move(group));
}

}  // namespace holba
