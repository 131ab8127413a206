// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/alignment.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <vector>

namespace holba {
namespace {

struct Moments {
  Eigen::Vector3d mean_from = Eigen::Vector3d::Zero(), mean_to = Eigen::Vector3d::Zero();
  double var_from = 0.0, var_to = 0.0;                   // sums of squares about the means
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // sum (to - mean)(from - mean)^T
};

Moments ComputeMoments(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to) {
  Moments m;
  for (size_t i = 0; i < from.size(); ++i) {
    m.mean_from += from[i];
    m.mean_to += to[i];
  }
  m.mean_from /= static_cast<double>(from.size());
  m.mean_to /= static_cast<double>(to.size());
  for (size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d a = from[i] - m.mean_from, b = to[i] - m.mean_to;
    m.covariance += b * a.transpose();
    m.var_from += a.squaredNorm();
    m.var_to += b.squaredNorm();
  }
  return m;
}

// The rotation nearest to the sum of the given ones in the chordal sense: the dominant eigenvector
// of sum q q^T (Markley et al. 2007).
Eigen::Quaterniond MeanRotation(std::span<const Eigen::Quaterniond> rotations) {
  Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
  for (const Eigen::Quaterniond& q : rotations) sum += q.coeffs() * q.coeffs().transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(sum);
  return Eigen::Quaterniond(Eigen::Vector4d(solver.eigenvectors().col(3))).normalized();
}

bool IsSeenOnce(const Point3D& point) {
  return !point.track.empty() &&
         std::all_of(point.track.begin(), point.track.end(), [&](const PointObservation& o) {
           return o.image_id == point.track.front().image_id;
         });
}

}  // namespace

std::optional<Sim3d> EstimateSimilarity(std::span<const Eigen::Vector3d> from,
                                        std::span<const Eigen::Vector3d> to) {
  if (from.size() != to.size() || from.size() < 3) return std::nullopt;
  const Moments m = ComputeMoments(from, to);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m.covariance,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d d = svd.singularValues();
  // A second singular value at rounding level: the points are on one line and turn freely about it.
  if (!(d[1] > 1e-12 * d[0])) return std::nullopt;
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) sign[2] = -1.0;
  const Eigen::Matrix3d R = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  Sim3d sim;
  sim.rotation = Eigen::Quaterniond(R).normalized();
  sim.scale = d.dot(sign) / m.var_from;
  if (!(sim.scale > 0)) return std::nullopt;
  sim.translation = m.mean_to - sim.scale * (sim.rotation * m.mean_from);
  return sim;
}

std::optional<Sim3d> AlignReconstructions(const Reconstruction& model, const Reconstruction& truth,
                                          AlignmentBasis basis) {
  std::vector<Eigen::Vector3d> from, to;
  std::vector<Eigen::Quaterniond> rotations;  // truth_from_model as each image sees it
  for (const auto& [id, image] : truth.images) {
    const Image* other = model.images.Find(id);
    if (other == nullptr) continue;
    from.push_back(other->cam_from_world.OriginInA());
    to.push_back(image.cam_from_world.OriginInA());
    rotations.push_back(image.cam_from_world.rotation.normalized().conjugate() *
                        other->cam_from_world.rotation.normalized());
  }
  const size_t num_images = from.size();
  if (num_images == 0) return std::nullopt;
  if (basis != AlignmentBasis::kCentres) {
    for (const auto& [id, point] : truth.points3D) {
      const Point3D* other = model.points3D.Find(id);
      // One that a single image sees has no depth.
      if (other == nullptr || IsSeenOnce(*other)) continue;
      from.push_back(other->xyz);
      to.push_back(point.xyz);
    }
    if (basis == AlignmentBasis::kAuto && from.size() < num_images + 3) {
      from.resize(num_images);
      to.resize(num_images);
    }
  }
  // Cameras in a row are on one line up to their noise, which must not decide the rotation.
  const Moments m = ComputeMoments(from, to);
  const Eigen::Vector3d d = Eigen::JacobiSVD<Eigen::Matrix3d>(m.covariance).singularValues();
  if (from.size() >= 3 && d[1] > 1e-8 * d[0]) {
    if (const auto sim = EstimateSimilarity(from, to)) return sim;
  }
  Sim3d sim;
  sim.rotation = MeanRotation(rotations);
  if (m.var_from > 0 && m.var_to > 0) sim.scale = std::sqrt(m.var_to / m.var_from);
  sim.translation = m.mean_to - sim.scale * (sim.rotation * m.mean_from);
  return sim;
}

}  // namespace holba
