// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/foreign/limap_groups.h"

#include <Eigen/Geometry>
#include <cmath>
#include <string_view>

#include "holba/base/check.h"

namespace holba {
namespace {

struct LimapType {
  std::string_view name;  // ours
  size_t num_params, num_params_2d;
};
// By LIMAP's codes.
constexpr LimapType kTypes[] = {{"VP", 3, 3},       {"PLANE", 4, 3},      {"SPHERE", 4, 3},
                                {"CYLINDER", 7, 0}, {"ELLIPSOID", 10, 0}, {"CUBOID", 10, 0},
                                {"CONE", 7, 0}};

const LimapType& Of(const GroupType& type) {
  const int code = LimapCodeOf(type);
  HOLBA_CHECK(code >= 0);
  return kTypes[code];
}

// Quaternions: x y z w to w x y z and back.
std::vector<double> TurnedQuaternion(std::span<const double> p, bool from_limap) {
  std::vector<double> q(p.begin(), p.end());
  if (from_limap) {
    q[0] = p[3], q[1] = p[0], q[2] = p[1], q[3] = p[2];
  } else {
    q[0] = p[1], q[1] = p[2], q[2] = p[3], q[3] = p[0];
  }
  return q;
}

std::vector<double> CylinderFromLimap(std::span<const double> p) {
  const Eigen::Matrix3d axes =
      Eigen::Quaterniond(p[3], p[0], p[1], p[2]).normalized().toRotationMatrix();
  const Eigen::Vector3d d = axes.col(0), m = axes.col(1) * (p[5] / p[4]);
  return {d.x(), d.y(), d.z(), m.x(), m.y(), m.z(), std::exp(p[6])};
}

std::vector<double> CylinderToLimap(std::span<const double> p) {
  const Eigen::Vector3d d = Eigen::Vector3d(p[0], p[1], p[2]).normalized(), m(p[3], p[4], p[5]);
  const double distance = m.norm();
  Eigen::Matrix3d axes;
  axes.col(0) = d;
  axes.col(1) = distance > 0.0 ? Eigen::Vector3d((m - m.dot(d) * d).normalized())
                               : Eigen::Vector3d(d.unitOrthogonal());
  axes.col(2) = axes.col(0).cross(axes.col(1));
  const Eigen::Quaterniond q(axes);
  const double norm = std::hypot(1.0, distance);
  return {q.x(), q.y(), q.z(), q.w(), 1.0 / norm, distance / norm, std::log(p[6])};
}

std::vector<double> ConeFromLimap(std::span<const double> p,
                                  std::span<const Eigen::Vector3d> members) {
  const Eigen::Vector3d apex(p[0], p[1], p[2]), axis(p[3], p[4], p[5]);
  int ahead = 0;
  for (const Eigen::Vector3d& X : members) ahead += (X - apex).dot(axis) >= 0.0 ? 1 : -1;
  const double sign = ahead >= 0 ? 1.0 : -1.0;
  return {p[0], p[1], p[2], sign * p[3], sign * p[4], sign * p[5], std::atan(std::exp(p[6]))};
}

}  // namespace

const GroupType* GroupTypeOfLimap(int code) {
  if (code < 0 || code >= static_cast<int>(std::size(kTypes))) return nullptr;
  return FindGroupType(kTypes[code].name);
}

int LimapCodeOf(const GroupType& type) {
  for (int code = 0; code < static_cast<int>(std::size(kTypes)); ++code) {
    if (kTypes[code].name == type.name) return code;
  }
  return -1;
}

size_t NumLimapParams(const GroupType& type) { return Of(type).num_params; }
size_t NumLimapParams2D(const GroupType& type) { return Of(type).num_params_2d; }

std::optional<std::vector<double>> ParamsFromLimap(const GroupType& type,
                                                   std::span<const double> limap,
                                                   std::span<const Eigen::Vector3d> members) {
  HOLBA_CHECK(limap.size() == NumLimapParams(type));
  std::vector<double> plain(limap.begin(), limap.end());
  if (type.name == "SPHERE") {
    plain[3] = std::exp(limap[3]);
  } else if (type.name == "CYLINDER") {
    plain = CylinderFromLimap(limap);
  } else if (type.name == "ELLIPSOID") {
    plain = TurnedQuaternion(limap, /*from_limap=*/true);
    for (size_t i = 7; i < 10; ++i) plain[i] = std::exp(limap[i]);
  } else if (type.name == "CUBOID") {
    plain = TurnedQuaternion(limap, /*from_limap=*/true);
    for (size_t i = 4; i < 10; ++i) plain[i] = -limap[i];
  } else if (type.name == "CONE") {
    plain = ConeFromLimap(limap, members);
  }
  double g[kMaxGroupParams];
  if (!type.from_file(plain.data(), g)) return std::nullopt;
  return plain;
}

std::vector<double> ParamsToLimap(const GroupType& type, std::span<const double> plain) {
  std::vector<double> limap(plain.begin(), plain.end());
  if (type.name == "SPHERE") {
    limap[3] = std::log(plain[3]);
  } else if (type.name == "CYLINDER") {
    limap = CylinderToLimap(plain);
  } else if (type.name == "ELLIPSOID") {
    limap = TurnedQuaternion(plain, /*from_limap=*/false);
    for (size_t i = 7; i < 10; ++i) limap[i] = std::log(plain[i]);
  } else if (type.name == "CUBOID") {
    limap = TurnedQuaternion(plain, /*from_limap=*/false);
    for (size_t i = 4; i < 10; ++i) limap[i] = -plain[i];
  } else if (type.name == "CONE") {
    limap[6] = std::log(std::tan(plain[6]));
  }
  return limap;
}

}  // namespace holba
