// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/wireframe/point_on_line.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "holba/estimation/points/point_triangulation.h"

namespace holba {
namespace {

using Across = Eigen::Matrix<double, 3, 2>;
Across BasisAcross(const Eigen::Vector3d& direction) {
  Across basis;
  basis.col(0) = direction.unitOrthogonal();
  basis.col(1) = direction.cross(basis.col(0)).normalized();
  return basis;
}

// Of the line's place across its direction, at its point `anchor`, for ends of segments with one
// pixel standard deviation across the segment. Unknowns: the shift at the anchor and the shift
// per length along the line; each end of a segment measures their sum at its place, in the image
// across the segment.
std::optional<Eigen::Matrix2d> LineCovariance(const Reconstruction& model, const ViewMap& views,
                                              const Line3D& line, const Eigen::Vector3d& anchor,
                                              const Across& across) {
  const Eigen::Vector3d& d = line.line.direction;
  Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
  for (const LineObservation& observation : line.track) {
    const IdealView& view = views.at(observation.image_id);
    const auto segment = view.ToIdeal(
        model.images.at(observation.image_id).lines2D.at(observation.line2D_idx).segment);
    const auto l = view.Project(line.line);
    if (!segment || !l) continue;
    for (const Eigen::Vector2d& end : {segment->start, segment->end}) {
      // The point of the line nearest to the ray of the end.
      const Eigen::Vector3d ray = view.Ray(end), from = view.centre() - anchor;
      const double cosine = d.dot(ray), determinant = 1.0 - cosine * cosine;
      if (!(determinant > 1e-12)) continue;
      const double s = (d.dot(from) - cosine * ray.dot(from)) / determinant;
      const Eigen::Vector3d X = anchor + s * d;
      if (!(view.Depth(X) > 0.0)) continue;
      const Eigen::RowVector2d at_anchor =
          l->head<2>().transpose() * ProjectionJacobian(view, X) * across;
      Eigen::RowVector4d J;
      J << at_anchor, s * at_anchor;
      A += J.transpose() * J;
    }
  }
  // Scaled to a unit diagonal: shifts and slopes have different units.
  const Eigen::Vector4d scale = A.diagonal().cwiseSqrt();
  if (!(scale.minCoeff() > 0.0)) return std::nullopt;
  const Eigen::Matrix4d scaled =
      scale.cwiseInverse().asDiagonal() * A * scale.cwiseInverse().asDiagonal();
  // A line in one plane with all cameras may turn freely in it: its standard deviation is then set
  // to 1e4 of those of a single observation.
  const Eigen::LDLT<Eigen::Matrix4d> ldlt(scaled + 1e-8 * Eigen::Matrix4d::Identity());
  const Eigen::Matrix4d inverse = ldlt.solve(Eigen::Matrix4d::Identity());
  const Eigen::Vector2d unit = scale.head<2>().cwiseInverse();
  return Eigen::Matrix2d(unit.asDiagonal() * inverse.topLeftCorner<2, 2>() * unit.asDiagonal());
}

}  // namespace

PointOnLine TestPointOnLine(const Reconstruction& model, const ViewMap& views,
                            const PointOnLineOptions& options, const Eigen::Vector3d& X,
                            const std::optional<Eigen::Matrix3d>& covariance_1px,
                            double pixels_per_length, const Line3D& line) {
  const Eigen::Vector3d nearest = line.line.ClosestPoint(X);
  const Eigen::Vector3d gap = X - nearest;
  const double gap_gsd = gap.norm() * pixels_per_length;
  if (gap_gsd <= options.max_gap_gsd) return PointOnLine::kNear;
  if (gap_gsd > options.max_uncertain_gap_gsd || !covariance_1px) return PointOnLine::kApart;
  const Across across = BasisAcross(line.line.direction);
  const auto of_line = LineCovariance(model, views, line, nearest, across);
  if (!of_line) return PointOnLine::kApart;
  const Eigen::Matrix2d covariance = options.sigma_px * options.sigma_px *
                                     (across.transpose() * *covariance_1px * across + *of_line);
  const Eigen::Vector2d at = across.transpose() * gap;
  constexpr double kChiSquare99 = 9.21;  // two degrees of freedom
  return at.dot(covariance.ldlt().solve(at)) < kChiSquare99 ? PointOnLine::kAllowed
                                                            : PointOnLine::kApart;
}

}  // namespace holba
