// SPDX-License-Identifier: BSD-3-Clause
// The contract of a group type and the list of them (names, codes and file parameters: FORMAT.md).
//
// A type is one header with a struct, and one line in the list of group_types.h (Vector3d and the
// like are Eigen's):
// clang-format off
//   static constexpr std::string_view kName;        // as in files: "SPHERE"
//   static constexpr int kTypeCode;                 // as in binary files
//   static constexpr std::string_view kFileParams;  // plain values of the file: "cx cy cz r"
//   static constexpr int kNumFileParams;
//   using Manifold = ...;                           // of the parameters in memory
//   // In memory; positive quantities as logarithms.
//   using Params = Matrix<double, Manifold::kAmbient, 1>;
//   static std::optional<Params> FromFile(const double* plain);    // empty: not a valid group
//   template <typename T> static void ToFile(const T* g, T* plain);
//   static std::string_view Requirement();          // "unit n, n.x + w = 0", for error messages
// At least one of these two; a type takes the features that it can project (or, for the vanishing
// point, align):
//   template <typename T>  // point of the surface for X; empty where it is undefined
//   static std::optional<Vector3<T>> ProjectPoint(const T* g, const Vector3<T>& X);
//   template <typename T>  // (d, m) of the projected line, any scale; empty where undefined
//   static std::optional<std::pair<Vector3<T>, Vector3<T>>> ProjectLine(
//       const T* g, const Vector3<T>& d, const Vector3<T>& m);
// with derivatives, row-major, d_group with respect to the kAmbient parameters in memory (right in
// tangent directions; dual numbers stand in for a type without these two):
//   static std::optional<Vector3d> ProjectPointWithJacobian(
//       const double* g, const Vector3d& X, double* d_point /*3x3*/, double* d_group /*3xA*/);
//   static std::optional<Vector6d> ProjectLineWithJacobian(
//       const double* g, const Vector3d& d, const Vector3d& m, double* d_line /*6x6*/,
//       double* d_group /*6xA*/);
// Optional: Direction (makes it eligible for relations; member lines of a type with Direction but
// no ProjectLine are parallel to it, residual d x v):
//   template <typename T> static Vector3<T> Direction(const T* g);    // unit
// Always:
//   static std::optional<Params> FitMinimal(std::span<const Vector3d> points,
//                                           std::span<const PlueckerLine> lines);
//   // Sizes of a minimal sample of either kind, 0: not from this kind.
//   static constexpr int kMinPoints, kMinLines;
//   template <typename T>
//   static GroupParams<T, Manifold> Transform(const Sim3d& new_from_old, const T* g);
//   static std::vector<Params> Examples();          // for the contract tests
//   // Triangles of its extent near the member points, for viewers.
//   static GroupMesh Mesh(const double* g, std::span<const Vector3d> member_points);
// clang-format on
// Capabilities are detected by the function being there, never by flags.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "holba/geometry/line.h"
#include "holba/geometry/manifold.h"
#include "holba/geometry/rigid3d.h"
#include "holba/geometry/types.h"

namespace holba {

inline constexpr int kMaxGroupParams = 16;

struct GroupMesh {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::array<uint32_t, 3>> triangles;
};

// A group type as data. Functions that a type lacks are null.
struct GroupType {
  int code;
  std::string_view name;
  std::string_view file_params;
  std::string_view requirement;
  int num_file_params;
  const ManifoldOps* manifold;
  int min_points, min_lines;
  // In-memory parameters (manifold->ambient values) from plain ones; false: not a valid group.
  bool (*from_file)(const double* plain, double* g);
  void (*to_file)(const double* g, double* plain);
  bool (*project_point)(const double* g, const Eigen::Vector3d& X, Eigen::Vector3d* projected);
  bool (*project_point_with_jacobian)(const double* g, const Eigen::Vector3d& X,
                                      Eigen::Vector3d* projected, double* d_point, double* d_group);
  bool (*project_line)(const double* g, const Vector6d& line, Vector6d* projected);
  bool (*project_line_with_jacobian)(const double* g, const Vector6d& line, Vector6d* projected,
                                     double* d_line, double* d_group);
  // Unit direction and its derivative, 3 x ambient row-major (null: not wanted).
  void (*direction)(const double* g, Eigen::Vector3d* direction, double* d_group);
  bool (*fit_minimal)(std::span<const Eigen::Vector3d> points, std::span<const PlueckerLine> lines,
                      double* g);
  void (*transform)(const Sim3d& new_from_old, const double* g, double* transformed);
  // d(plain parameters of the transformed group) / d(tangent of g), num_file_params x tangent,
  // row-major; exact however far the new origin is.
  void (*file_jacobian)(const Sim3d& new_from_old, const double* g, double* jacobian);
  GroupMesh (*mesh)(const double* g, std::span<const Eigen::Vector3d> member_points);

  bool TakesPoints() const { return project_point != nullptr; }
  bool TakesLines() const { return project_line != nullptr || IsParallelism(); }
  bool HasDirection() const { return direction != nullptr; }
  // Members are lines parallel to its direction (the vanishing point).
  bool IsParallelism() const { return direction != nullptr && !project_point && !project_line; }
};

// Null: unknown.
const GroupType* FindGroupType(int code);
const GroupType* FindGroupType(std::string_view name);
std::span<const GroupType* const> AllGroupTypes();

}  // namespace holba
