// SPDX-License-Identifier: BSD-3-Clause
#include "holba/group/fit_box.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "holba/geometry/manifold.h"
#include "holba/group/fit.h"

namespace holba {
namespace {

using Offsets = Eigen::Matrix<double, 6, 1>;
using BoxManifold = Product<UnitQuaternion, Euclidean<6>>;

// Lines nearer to parallel with an edge than this bound the box (cosine, 8 degrees).
constexpr double kEdgeCosine = 0.99;
// Nearer than this they count as parallel with it (sine, 2 degrees).
constexpr double kParallelSine = 0.035;

// Features with centre 0 and root mean square distance 1 from it.
struct Features {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> line_points;  // nearest to the centre
  std::vector<Eigen::Vector3d> line_directions;
};

std::vector<size_t> SpreadIndices(size_t size, size_t max_num) {
  const size_t num = std::min(size, max_num);
  std::vector<size_t> indices(num);
  for (size_t i = 0; i < num; ++i) indices[i] = i * size / num;
  return indices;
}

Features Thin(const Features& features, size_t max_num) {
  Features thin;
  for (const size_t i : SpreadIndices(features.points.size(), max_num)) {
    thin.points.push_back(features.points[i]);
  }
  for (const size_t i : SpreadIndices(features.line_points.size(), max_num)) {
    thin.line_points.push_back(features.line_points[i]);
    thin.line_directions.push_back(features.line_directions[i]);
  }
  return thin;
}

// Offsets of the faces that bound the features in this rotation; empty: nothing bounds it.
std::optional<Offsets> BoundingOffsets(const Features& features, const Eigen::Matrix3d& R) {
  Eigen::Array3d low = Eigen::Array3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Array3d high = -low;
  const auto include = [&](const Eigen::Vector3d& X) {
    const Eigen::Array3d local = (R.transpose() * X).array();
    low = low.min(local);
    high = high.max(local);
  };
  for (const Eigen::Vector3d& X : features.points) include(X);
  for (size_t i = 0; i < features.line_points.size(); ++i) {
    const Eigen::Vector3d d = R.transpose() * features.line_directions[i];
    if (d.cwiseAbs().maxCoeff() > kEdgeCosine) include(features.line_points[i]);
  }
  if (!((high - low).minCoeff() > 1e-9)) return std::nullopt;
  Offsets offsets;
  for (int axis = 0; axis < 3; ++axis) {
    offsets[2 * axis] = -high[axis];
    offsets[2 * axis + 1] = low[axis];
  }
  return offsets;
}

// Signed distance of a local point to the plane of its nearest face.
std::pair<int, double> NearestFace(const Eigen::Vector3d& local, const Offsets& offsets) {
  std::pair<int, double> nearest{0, std::numeric_limits<double>::infinity()};
  for (int face = 0; face < 6; ++face) {
    const double along = face % 2 == 0 ? local[face / 2] : -local[face / 2];
    const double distance = along + offsets[face];
    if (std::abs(distance) < std::abs(nearest.second)) nearest = {face, distance};
  }
  return nearest;
}

// A line's residuals: distance and slope to the face where their squares are least, and its slope
// across the edge that it follows. Without the last, the twelve edges of a box fit every box turned
// about them.
struct LineFace {
  int face;
  double distance, slope;
  int edge_face;      // of the faces beside the edge; -1: the line follows no edge
  double edge_slope;  // kParallelSine where it follows none, a constant
  double Cost() const { return distance * distance + slope * slope + edge_slope * edge_slope; }
};
LineFace NearestFaceOfLine(const Eigen::Vector3d& local, const Eigen::Vector3d& local_direction,
                           const Offsets& offsets) {
  LineFace nearest{0, 0.0, 0.0, -1, kParallelSine};
  double least = std::numeric_limits<double>::infinity();
  for (int face = 0; face < 6; ++face) {
    const double sign = face % 2 == 0 ? 1.0 : -1.0;
    const double distance = sign * local[face / 2] + offsets[face];
    const double slope = sign * local_direction[face / 2];
    const double cost = distance * distance + slope * slope;
    if (cost < least) {
      least = cost;
      nearest.face = face;
      nearest.distance = distance;
      nearest.slope = slope;
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (axis == nearest.face / 2) continue;
    if (std::abs(local_direction[axis]) < std::abs(nearest.edge_slope)) {
      nearest.edge_face = 2 * axis;
      nearest.edge_slope = local_direction[axis];
    }
  }
  return nearest;
}

// Sum of squares of the features against the box that bounds them.
double BoundingCost(const Features& features, const Eigen::Matrix3d& R) {
  const std::optional<Offsets> offsets = BoundingOffsets(features, R);
  if (!offsets) return std::numeric_limits<double>::infinity();
  double cost = 0.0;
  for (const Eigen::Vector3d& X : features.points) {
    const double distance = NearestFace(R.transpose() * X, *offsets).second;
    cost += distance * distance;
  }
  for (size_t i = 0; i < features.line_points.size(); ++i) {
    const LineFace f = NearestFaceOfLine(R.transpose() * features.line_points[i],
                                         R.transpose() * features.line_directions[i], *offsets);
    cost += f.Cost();
  }
  return cost;
}

// Normals that may be a face's: all features lie on one side of the plane, many near it.
std::vector<Eigen::Vector3d> FaceNormals(const Features& features, size_t max_num) {
  constexpr double kMaxBeyond = 0.15, kNear = 0.1;  // of the root mean square extent
  struct Candidate {
    double score;
    Eigen::Vector3d normal;
  };
  std::vector<Candidate> candidates;
  const auto add = [&](const Eigen::Vector3d& normal, const Eigen::Vector3d& X) {
    double below = 0.0, above = 0.0, score = 0.0;
    const auto include = [&](const Eigen::Vector3d& Y) {
      const double distance = normal.dot(Y - X);
      below = std::max(below, -distance);
      above = std::max(above, distance);
      score += std::min(std::abs(distance), kNear);
    };
    for (const Eigen::Vector3d& Y : features.points) include(Y);
    if (features.points.empty()) {
      for (const Eigen::Vector3d& Y : features.line_points) include(Y);
    }
    for (const Eigen::Vector3d& d : features.line_directions) {
      score += std::min(std::abs(d.dot(normal)), kNear);
    }
    if (std::min(below, above) < kMaxBeyond) candidates.push_back({score, normal});
  };
  const auto add_spanned = [&](const Eigen::Vector3d& u, const Eigen::Vector3d& v,
                               const Eigen::Vector3d& X) {
    const Eigen::Vector3d normal = u.cross(v);
    const double norm = normal.norm();
    if (norm > 0.02 * u.norm() * v.norm() && norm > 1e-4) add(normal / norm, X);
  };
  const std::vector<Eigen::Vector3d>& P = features.points;
  for (size_t i = 0; i < P.size(); ++i) {
    for (size_t j = i + 1; j < P.size(); ++j) {
      for (size_t k = j + 1; k < P.size(); ++k) add_spanned(P[j] - P[i], P[k] - P[i], P[i]);
    }
  }
  for (size_t i = 0; i < features.line_points.size(); ++i) {
    const Eigen::Vector3d& X = features.line_points[i];
    for (size_t j = i + 1; j < features.line_points.size(); ++j) {
      add_spanned(features.line_directions[i], features.line_directions[j], X);
      add_spanned(features.line_directions[i], features.line_points[j] - X, X);
    }
    for (const Eigen::Vector3d& Y : P) add_spanned(features.line_directions[i], Y - X, X);
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.score < b.score; });
  std::vector<Eigen::Vector3d> normals;
  for (const Candidate& candidate : candidates) {
    if (normals.size() == max_num) break;
    const bool is_new = std::all_of(normals.begin(), normals.end(), [&](const auto& other) {
      return std::abs(other.dot(candidate.normal)) < 0.9998;  // 1.1 degrees
    });
    if (is_new) normals.push_back(candidate.normal);
  }
  return normals;
}

Eigen::Matrix3d Frame(const Eigen::Vector3d& first, const Eigen::Vector3d& about_second) {
  Eigen::Matrix3d R;
  R.col(0) = first;
  R.col(1) = (about_second - first * first.dot(about_second)).normalized();
  R.col(2) = R.col(0).cross(R.col(1));
  return R;
}

// Candidate rotations by ascending cost, each moved downhill by a pattern search.
std::vector<Eigen::Matrix3d> BestRotations(const Features& features, size_t max_num) {
  struct Candidate {
    double cost;
    Eigen::Matrix3d R;
  };
  std::vector<Candidate> candidates;
  const auto add = [&](const Eigen::Matrix3d& R) {
    candidates.push_back({BoundingCost(features, R), R});
  };
  for (const Eigen::Vector3d& normal : FaceNormals(features, /*max_num=*/40)) {
    constexpr int kNumAngles = 45;  // 2 degrees apart; a quarter turn gives the same box
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(normal);
    std::vector<Candidate> around;
    for (int i = 0; i < kNumAngles; ++i) {
      const double angle = 0.5 * std::numbers::pi * i / kNumAngles;
      const Eigen::Matrix3d R =
          Frame(normal, basis * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
      around.push_back({BoundingCost(features, R), R});
    }
    for (int i = 0; i < kNumAngles; ++i) {
      const double before = around[(i + kNumAngles - 1) % kNumAngles].cost;
      const double after = around[(i + 1) % kNumAngles].cost;
      if (around[i].cost <= before && around[i].cost <= after) candidates.push_back(around[i]);
    }
  }
  for (size_t i = 0; i < features.line_directions.size(); ++i) {
    for (size_t j = i + 1; j < features.line_directions.size(); ++j) {
      const Eigen::Vector3d &a = features.line_directions[i], &b = features.line_directions[j];
      if (std::abs(a.dot(b)) < 0.2) add(Frame(a, b));
    }
  }
  const auto better = [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; };
  std::stable_sort(candidates.begin(), candidates.end(), better);
  if (candidates.size() > 4 * max_num) candidates.resize(4 * max_num);
  for (Candidate& candidate : candidates) {
    if (!std::isfinite(candidate.cost)) continue;
    for (double step = 0.02; step > 2e-4;) {
      Candidate next = candidate;
      for (int axis = 0; axis < 3; ++axis) {
        for (const double sign : {1.0, -1.0}) {
          const Eigen::Matrix3d R =
              candidate.R * ExpRotation(sign * step * Eigen::Vector3d::Unit(axis)).matrix();
          const double cost = BoundingCost(features, R);
          if (cost < next.cost) next = {cost, R};
        }
      }
      if (next.cost < candidate.cost) {
        candidate = next;
      } else {
        step *= 0.5;
      }
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(), better);
  std::vector<Eigen::Matrix3d> rotations;
  for (const Candidate& candidate : candidates) {
    if (rotations.size() == max_num || !std::isfinite(candidate.cost)) break;
    rotations.push_back(candidate.R);
  }
  return rotations;
}

// Faces that at most one feature is nearest to are told by no feature but the one that ends there:
// puts them where the features end in the final rotation.
void EndOpenFaces(const Features& features, double* g) {
  const Eigen::Matrix3d R = Eigen::Quaterniond(g[3], g[0], g[1], g[2]).toRotationMatrix();
  Eigen::Map<Offsets> offsets(g + 4);
  const std::optional<Offsets> bounding = BoundingOffsets(features, R);
  if (!bounding) return;
  std::array<int, 6> num_features{};
  for (const Eigen::Vector3d& X : features.points) {
    ++num_features[NearestFace(R.transpose() * X, offsets).first];
  }
  for (size_t i = 0; i < features.line_points.size(); ++i) {
    const LineFace nearest =
        NearestFaceOfLine(R.transpose() * features.line_points[i],
                          R.transpose() * features.line_directions[i], offsets);
    num_features[nearest.face] += 2;
  }
  for (int face = 0; face < 6; ++face) {
    if (num_features[face] <= 1) offsets[face] = (*bounding)[face];
  }
}

// Least squares over rotation and offsets; every evaluation assigns the features anew.
std::optional<double> Refine(const Features& features, bool follow_edges, int max_iterations,
                             double* g) {
  using Square = Eigen::Matrix<double, 9, 9>;
  using Tangent = Eigen::Matrix<double, 9, 1>;
  const auto accumulate = [&features, follow_edges](const double* at, Square* H, Tangent* b) {
    const Eigen::Matrix3d R = Eigen::Quaterniond(at[3], at[0], at[1], at[2]).toRotationMatrix();
    const Eigen::Map<const Offsets> offsets(at + 4);
    H->setZero();
    b->setZero();
    std::optional<double> cost = 0.0;
    // Residual n.x + (has_offset) w of face: the normal turns by the rotation vector crossed with
    // it.
    const auto add = [&](int face, const Eigen::Vector3d& x, bool has_offset, double residual) {
      const Eigen::Vector3d n = (face % 2 == 0 ? 1.0 : -1.0) * R.col(face / 2);
      Tangent row = Tangent::Zero();
      row.head<3>() = n.cross(x);
      if (has_offset) row[3 + face] = 1.0;
      H->noalias() += row * row.transpose();
      *b += residual * row;
      *cost += residual * residual;
    };
    for (const Eigen::Vector3d& X : features.points) {
      const auto [face, distance] = NearestFace(R.transpose() * X, offsets);
      add(face, X, true, distance);
    }
    for (size_t i = 0; i < features.line_points.size(); ++i) {
      const Eigen::Vector3d &X = features.line_points[i], &d = features.line_directions[i];
      const LineFace f = NearestFaceOfLine(R.transpose() * X, R.transpose() * d, offsets);
      add(f.face, X, true, f.distance);
      add(f.face, d, false, f.slope);
      if (!follow_edges) continue;
      if (f.edge_face >= 0) {
        add(f.edge_face, d, false, f.edge_slope);
      } else {
        *cost += f.edge_slope * f.edge_slope;
      }
    }
    return cost;
  };
  return MinimizeSquares<BoxManifold>(accumulate, max_iterations, g);
}

}  // namespace

std::optional<Box> FitBox(std::span<const Eigen::Vector3d> points,
                          std::span<const PlueckerLine> lines) {
  constexpr size_t kMaxSample = 24, kMaxStarts = 6;
  if (points.size() + 2 * lines.size() < static_cast<size_t>(kMinBoxPoints)) return std::nullopt;
  const Eigen::Vector3d centre = CentreOf(points, lines);
  Features features;
  double sum = 0.0;
  for (const Eigen::Vector3d& X : points) {
    features.points.push_back(X - centre);
    sum += features.points.back().squaredNorm();
  }
  for (const PlueckerLine& line : lines) {
    features.line_points.push_back(line.ClosestPoint(centre) - centre);
    features.line_directions.push_back(line.direction.normalized());
    sum += features.line_points.back().squaredNorm();
  }
  const double scale = std::sqrt(sum / static_cast<double>(points.size() + lines.size()));
  if (!std::isfinite(scale) || scale <= 1e-14 * centre.norm() || scale == 0.0) return std::nullopt;
  for (Eigen::Vector3d& X : features.points) X /= scale;
  for (Eigen::Vector3d& X : features.line_points) X /= scale;

  const Features sample = Thin(features, kMaxSample);
  Eigen::Matrix<double, 10, 1> best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (const Eigen::Matrix3d& R : BestRotations(sample, kMaxStarts)) {
    const std::optional<Offsets> offsets = BoundingOffsets(features, R);
    if (!offsets) continue;
    Eigen::Matrix<double, 10, 1> g;
    g << Eigen::Quaterniond(R).normalized().coeffs(), *offsets;
    const std::optional<double> cost = Refine(features, /*follow_edges=*/true, 60, g.data());
    if (!cost || !(*cost < best_cost)) continue;
    // Thinner than this it is a plate whose faces cannot be told apart.
    if (!(std::max({g[4] + g[5], g[6] + g[7], g[8] + g[9]}) < -1e-6)) continue;
    best = g;
    best_cost = *cost;
  }
  if (!std::isfinite(best_cost)) return std::nullopt;
  if (!lines.empty()) {
    // Lines a little off an edge are not of it where the faces alone fit far better without that.
    Eigen::Matrix<double, 10, 1> free = best;
    const double cost = *Refine(features, /*follow_edges=*/false, 0, best.data());
    if (*Refine(features, /*follow_edges=*/false, 60, free.data()) < 0.25 * cost) best = free;
  }
  EndOpenFaces(features, best.data());
  Box box;
  box.rotation = Eigen::Quaterniond(best[3], best[0], best[1], best[2]);
  const Eigen::Matrix3d R = box.rotation.toRotationMatrix();
  for (int face = 0; face < 6; ++face) {
    const Eigen::Vector3d n = (face % 2 == 0 ? 1.0 : -1.0) * R.col(face / 2);
    box.offsets[face] = scale * best[4 + face] - n.dot(centre);
  }
  return box;
}

}  // namespace holba
