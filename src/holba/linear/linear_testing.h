// SPDX-License-Identifier: BSD-3-Clause
// Block matrices for the tests of iterative solvers: random ones, and the normal equations of a
// small bundle adjustment with one shared camera and planes.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "holba/base/random.h"
#include "holba/linear/block_matrix.h"
#include "holba/linear/conjugate_gradients.h"

namespace holba {

// Pairs (a, b), a > b, are there where `coupled` says so.
inline BlockPattern MakePattern(const std::vector<int>& widths,
                                const std::function<bool(int a, int b)>& coupled) {
  BlockPattern pattern;
  pattern.widths = widths;
  pattern.row_start.push_back(0);
  for (int a = 0; a < static_cast<int>(widths.size()); ++a) {
    for (int b = 0; b <= a; ++b) {
      if (a == b || coupled(a, b)) pattern.column.push_back(b);
    }
    pattern.row_start.push_back(pattern.column.size());
  }
  pattern.Finish();
  return pattern;
}

// The blocks of a dense matrix that the pattern has; NaN in the padding, which nobody may use.
inline BlockMatrix FromDense(const BlockPattern& pattern, const Eigen::MatrixXd& dense) {
  BlockMatrix matrix(&pattern);
  for (int a = 0; a < pattern.num_nodes(); ++a) {
    const int padded = PaddedWidth(pattern.widths[a]);
    for (size_t k = pattern.row_start[a]; k < pattern.row_start[a + 1]; ++k) {
      const int b = pattern.column[k];
      for (int j = 0; j < pattern.widths[b]; ++j) {
        for (int i = 0; i < padded; ++i) {
          matrix.Block(k)[j * padded + i] =
              i < pattern.widths[a] ? dense(pattern.offset[a] + i, pattern.offset[b] + j)
                                    : std::numeric_limits<double>::quiet_NaN();
        }
      }
    }
  }
  return matrix;
}

// A random matrix of this pattern, positive definite with a condition of some thousands: a sum of
// squares over coupled pairs and a small multiple of the unit matrix.
inline Eigen::MatrixXd RandomSpd(const BlockPattern& pattern, Random* random) {
  Eigen::MatrixXd sum =
      1e-2 * Eigen::MatrixXd::Identity(pattern.num_unknowns, pattern.num_unknowns);
  for (int a = 0; a < pattern.num_nodes(); ++a) {
    for (size_t k = pattern.row_start[a]; k < pattern.row_start[a + 1]; ++k) {
      const int b = pattern.column[k];
      Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(2, pattern.num_unknowns);
      for (int i = 0; i < 2; ++i) {
        for (int j = 0; j < pattern.widths[a]; ++j)
          rows(i, pattern.offset[a] + j) = random->Normal();
        for (int j = 0; j < pattern.widths[b]; ++j)
          rows(i, pattern.offset[b] + j) = random->Normal();
      }
      sum += rows.transpose() * rows;
    }
  }
  return sum;
}

inline Eigen::VectorXd RandomVector(size_t size, Random* random) {
  Eigen::VectorXd x(size);
  for (double& value : x) value = random->Normal();
  return x;
}

class DenseOperator : public LinearOperator {
 public:
  explicit DenseOperator(Eigen::MatrixXd matrix) : matrix_(std::move(matrix)) {}
  void Apply(const double* x, double* y) override {
    const Eigen::Index n = matrix_.rows();
    Eigen::Map<Eigen::VectorXd>(y, n) = matrix_ * Eigen::Map<const Eigen::VectorXd>(x, n);
    ++num_products;
  }
  int num_products = 0;

 private:
  Eigen::MatrixXd matrix_;
};

// The preconditioner as a matrix, column by column.
inline Eigen::MatrixXd MatrixOf(Preconditioner* preconditioner, size_t size) {
  Eigen::MatrixXd matrix(size, size);
  for (size_t j = 0; j < size; ++j) {
    const Eigen::VectorXd unit = Eigen::VectorXd::Unit(size, j);
    preconditioner->Apply(unit.data(), matrix.col(j).data());
  }
  return matrix;
}

// Normal equations of points seen by poses on a sphere that look at its centre, through one camera
// (focal length, two radial distortion coefficients); a part of the points lies near planes, which
// are unknowns, too: residuals n.X + d. Points are eliminated: S = U - E. Damped as
// Levenberg-Marquardt does, by `damping` times the diagonal.
struct SmallBundle {
  static constexpr int kCameraWidth = 3, kPlaneWidth = 4;
  std::vector<int> widths;  // poses, then the camera, then planes
  Eigen::MatrixXd U, E;
  Eigen::VectorXd b;
};

inline SmallBundle MakeSmallBundle(int num_poses, int num_planes, int num_points, int min_views,
                                   int max_views, double damping, uint64_t seed) {
  constexpr int kPose = 6;
  using Eigen::Matrix;
  using Eigen::Vector2d;
  using Eigen::Vector3d;
  Random random(seed);
  SmallBundle bundle;
  bundle.widths.assign(num_poses, kPose);
  bundle.widths.push_back(SmallBundle::kCameraWidth);
  bundle.widths.insert(bundle.widths.end(), num_planes, SmallBundle::kPlaneWidth);
  const int camera = kPose * num_poses, planes = camera + SmallBundle::kCameraWidth;
  const int size = planes + SmallBundle::kPlaneWidth * num_planes;
  const auto unit_vector = [&] {
    return Vector3d(random.Normal(), random.Normal(), random.Normal()).normalized();
  };
  std::vector<Eigen::Matrix3d> rotations;
  for (int i = 0; i < num_poses; ++i) {
    Eigen::Matrix3d cam_from_world;
    const Vector3d forward = -unit_vector();
    cam_from_world.row(2) = forward;
    cam_from_world.row(0) = forward.cross(unit_vector()).normalized();
    cam_from_world.row(1) = forward.cross(Vector3d(cam_from_world.row(0)));
    rotations.push_back(cam_from_world);
  }
  std::vector<Vector3d> normals;
  for (int i = 0; i < num_planes; ++i) normals.push_back(unit_vector());

  const double focal_px = 1000.0, distance = 4.0, plane_weight = 300.0;
  bundle.U = Eigen::MatrixXd::Zero(size, size);
  bundle.E = Eigen::MatrixXd::Zero(size, size);
  bundle.b = Eigen::VectorXd::Zero(size);
  std::vector<int> order(num_poses);
  for (int i = 0; i < num_poses; ++i) order[i] = i;
  for (int point = 0; point < num_points; ++point) {
    Vector3d X = unit_vector() * random.Uniform();
    const int plane =
        num_planes > 0 && random.Uniform() < 0.5 ? static_cast<int>(random.Index(num_planes)) : -1;
    if (plane >= 0) X -= normals[plane] * (normals[plane].dot(X) - 0.3);
    const int num_views = min_views + static_cast<int>(random.Index(max_views - min_views + 1));
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(2 * num_views + 1, size);
    Eigen::MatrixXd J_point = Eigen::MatrixXd::Zero(2 * num_views + 1, 3);
    for (int view = 0; view < num_views; ++view) {
      std::swap(order[view], order[view + random.Index(num_poses - view)]);
      const int pose = order[view];
      const Vector3d in_cam = rotations[pose] * X + Vector3d(0.0, 0.0, distance);
      const Vector2d u = in_cam.head<2>() / in_cam.z();
      Matrix<double, 2, 3> d_in_cam;
      d_in_cam << 1.0, 0.0, -u.x(), 0.0, 1.0, -u.y();
      d_in_cam *= focal_px / in_cam.z();
      Eigen::Matrix3d cross;
      cross << 0.0, -in_cam.z(), in_cam.y(), in_cam.z(), 0.0, -in_cam.x(), -in_cam.y(), in_cam.x(),
          0.0;
      J.block<2, 3>(2 * view, kPose * pose) = -d_in_cam * cross;
      J.block<2, 3>(2 * view, kPose * pose + 3) = d_in_cam;
      const double r2 = u.squaredNorm();
      J.block<2, 1>(2 * view, camera) = u;
      J.block<2, 1>(2 * view, camera + 1) = focal_px * r2 * u;
      J.block<2, 1>(2 * view, camera + 2) = focal_px * r2 * r2 * u;
      J_point.block<2, 3>(2 * view, 0) = d_in_cam * rotations[pose];
    }
    if (plane >= 0) {
      J.block<1, 3>(2 * num_views, planes + SmallBundle::kPlaneWidth * plane) =
          plane_weight * X.transpose();
      J(2 * num_views, planes + SmallBundle::kPlaneWidth * plane + 3) = plane_weight;
      J_point.row(2 * num_views) = plane_weight * normals[plane];
    }
    const Eigen::VectorXd residuals = RandomVector(2 * num_views + 1, &random);
    Eigen::Matrix3d V = J_point.transpose() * J_point;
    V.diagonal() *= 1.0 + damping;
    const Eigen::MatrixXd W = J.transpose() * J_point;
    const Eigen::MatrixXd W_by_V = V.llt().solve(W.transpose());
    bundle.U += J.transpose() * J;
    bundle.E += W * W_by_V;
    bundle.b -= J.transpose() * residuals - W_by_V.transpose() * (J_point.transpose() * residuals);
  }
  bundle.U.diagonal() *= 1.0 + damping;
  return bundle;
}

}  // namespace holba
