// SPDX-License-Identifier: BSD-3-Clause
// For tests of the law of origin and unit: what is the same of one scene at two places, in two
// units of length.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/QR>
#include <cmath>
#include <limits>

#include "holba/geometry/rigid3d.h"
#include "holba/geometry/types.h"
#include "holba/scene/reconstruction.h"
#include "holba/scene/uncertainty.h"

namespace holba {

struct Located {
  Reconstruction model;
  ModelUncertainty uncertainty;
};

// Of a camera's centre, in units of the model: C = -R^T t.
inline Eigen::Matrix3d CentreCovariance(const Rigid3d& pose, const Matrix6d& covariance) {
  const Eigen::Matrix3d R = pose.rotation.toRotationMatrix();
  Eigen::Matrix<double, 3, 6> J;
  J << -R.transpose() * CrossMatrix(pose.translation), -R.transpose();
  return J * covariance * J.transpose();
}

// `there` is `here` moved by there_from_here, which does not turn: poses, points, end points of
// lines to `tolerance` and 10 times of it (units of `here`), covariances to `relative`.
inline void ExpectTheSameElsewhere(const Sim3d& there_from_here, const Located& here,
                                   const Located& there, double tolerance, double relative) {
  const Sim3d here_from_there = there_from_here.Inverse();
  const double unit = there_from_here.scale, area = unit * unit;
  for (const auto& [id, frame] : here.model.frames) {
    const Rigid3d &p = frame.rig_from_world, &q = there.model.frames.at(id).rig_from_world;
    EXPECT_LT(p.rotation.angularDistance(q.rotation), tolerance);
    EXPECT_LT((p.OriginInA() - here_from_there * q.OriginInA()).norm(), tolerance);
  }
  const auto expect_near = [&](const Eigen::Vector3d& X, const Eigen::Vector3d& Y) {
    EXPECT_LT((X - here_from_there * Y).norm(), 10.0 * tolerance);
  };
  ASSERT_EQ(here.model.points3D.size(), there.model.points3D.size());
  for (const auto& [id, point] : here.model.points3D)
    expect_near(point.xyz, there.model.points3D.at(id).xyz);
  ASSERT_EQ(here.model.lines3D.size(), there.model.lines3D.size());
  for (const auto& [id, line] : here.model.lines3D) {
    expect_near(line.start, there.model.lines3D.at(id).start);
    expect_near(line.end, there.model.lines3D.at(id).end);
  }

  const ModelUncertainty &a = here.uncertainty, &b = there.uncertainty;
  // Coordinates that far from the origin are rounded, which moves residuals, and with them the
  // measured noise: of some 100 px for a unit of length here.
  const double offset = there_from_here.translation.norm() / unit;
  const double rounding_px = 4.0 * 100.0 * offset * std::numeric_limits<double>::epsilon();
  EXPECT_NEAR(b.sigma_px, a.sigma_px, relative * a.sigma_px + rounding_px);
  // The noise is a factor of all covariances; the rest is compared.
  const double factor = std::pow(a.sigma_px / b.sigma_px, 2);
  ASSERT_EQ(a.points.size(), b.points.size());
  for (const auto& [id, C] : a.points)
    EXPECT_LE((C - factor * b.points.at(id) / area).norm(), relative * C.norm()) << "point " << id;
  ASSERT_EQ(a.lines.size(), b.lines.size());
  for (const auto& [id, C] : a.lines) {
    const LineCovariance& D = b.lines.at(id);
    EXPECT_LE((C.start - factor * D.start / area).norm(), relative * C.start.norm())
        << "line " << id;
    EXPECT_LE((C.end - factor * D.end / area).norm(), relative * C.end.norm()) << "line " << id;
  }
  ASSERT_EQ(a.poses.size(), b.poses.size());
  // The covariance of t grows with the square of the offset; of the centre it is the small
  // difference of such numbers.
  for (const auto& [id, C] : a.poses) {
    const Matrix6d D = factor * b.poses.at(id);
    const Eigen::Matrix3d of_rotation = C.topLeftCorner<3, 3>();
    EXPECT_LE((of_rotation - D.topLeftCorner<3, 3>()).norm(), relative * of_rotation.norm());
    const Eigen::Matrix3d of_centre = CentreCovariance(here.model.frames.at(id).rig_from_world, C);
    const Eigen::Matrix3d there_too =
        CentreCovariance(there.model.frames.at(id).rig_from_world, D) / area;
    const double rounding = 4e-15 * offset * offset * of_rotation.norm();
    EXPECT_LE((of_centre - there_too).norm(), relative * of_centre.norm() + rounding)
        << "frame " << id;
  }
  // Of parameters in files, by the parameters that vary: those of here, moved there.
  ASSERT_EQ(a.groups.size(), b.groups.size());
  for (const auto& [id, C] : a.groups) {
    const Group3D& group = here.model.groups3D.at(id);
    const int rows = group.type->num_file_params, tangent = group.type->manifold->tangent;
    RowMajor<Eigen::Dynamic, Eigen::Dynamic> from(rows, tangent), to(rows, tangent);
    group.type->file_jacobian(Sim3d(), group.params.data(), from.data());
    group.type->file_jacobian(there_from_here, group.params.data(), to.data());
    const Eigen::MatrixXd J = to * from.completeOrthogonalDecomposition().pseudoInverse();
    const Eigen::MatrixXd expected = J * C * J.transpose(), found = factor * b.groups.at(id);
    const Eigen::VectorXd sigmas = expected.diagonal().cwiseMax(0.0).cwiseSqrt();
    const Eigen::MatrixXd excess =
        (expected - found).cwiseAbs() - relative * sigmas * sigmas.transpose();
    EXPECT_LE(excess.maxCoeff(), 1e-12 * expected.diagonal().maxCoeff())
        << group.type->name << " " << id;
  }
}

}  // namespace holba
