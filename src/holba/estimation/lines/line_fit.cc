// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/line_fit.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "holba/geometry/manifold.h"
#include "holba/geometry/symmetric_solve.h"

namespace holba {
namespace {

using Matrix24 = Eigen::Matrix<double, 2, 4>;

// Signed distances of both ends and their derivative in the tangent (direction 2, point 2).
bool Residual(const LineSupport& support, const AnchoredLine& line,
              const Eigen::Matrix<double, 3, 2>& basis, Eigen::Vector2d* r, Matrix24* J) {
  const Eigen::Vector3d u = line.point - support.centre;
  const Eigen::Vector3d l = support.line_from_moment * u.cross(line.direction);
  const double scale = l.head<2>().norm();
  if (!(scale > 1e-12 * u.norm() * support.focal)) return false;
  const Eigen::Vector2d normal = l.head<2>() / scale;
  const double offset = l.z() / scale;
  (*r)[0] = normal.dot(support.start) + offset;
  (*r)[1] = normal.dot(support.end) + offset;
  if (J == nullptr) return true;
  Eigen::Matrix<double, 3, 4> d_l;
  for (int k = 0; k < 2; ++k) {
    d_l.col(k) = support.line_from_moment * u.cross(basis.col(k));
    d_l.col(2 + k) = support.line_from_moment * basis.col(k).cross(line.direction);
  }
  for (int e = 0; e < 2; ++e) {
    const Eigen::Vector2d& x = e == 0 ? support.start : support.end;
    const Eigen::Vector3d d_r =
        Eigen::Vector3d(x.x() - (*r)[e] * normal.x(), x.y() - (*r)[e] * normal.y(), 1.0) / scale;
    J->row(e) = d_r.transpose() * d_l;
  }
  return true;
}

// Cost (half the robustified squares) and, if wanted, normal equations. NaN: undefined.
double Linearise(std::span<const LineSupport> supports, const LinePrior& prior, double cauchy_px,
                 double pixels_per_length, const AnchoredLine& line, Eigen::Matrix4d* H,
                 Eigen::Vector4d* g) {
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(line.direction);
  const double c2 = cauchy_px * cauchy_px;
  double cost = 0.0;
  if (H) {
    H->setZero();
    g->setZero();
  }
  Eigen::Vector2d r;
  Matrix24 J;
  for (const LineSupport& support : supports) {
    if (!Residual(support, line, basis, &r, H ? &J : nullptr))
      return std::numeric_limits<double>::quiet_NaN();
    const double s = r.squaredNorm();
    cost += 0.5 * c2 * std::log1p(s / c2);
    if (!H) continue;
    const double weight = 1.0 / (1.0 + s / c2);
    H->noalias() += weight * J.transpose() * J;
    g->noalias() += weight * J.transpose() * r;
  }
  if (prior.direction) {
    const Eigen::Vector3d residual =
        prior.direction_weight * line.direction.cross(*prior.direction);
    cost += 0.5 * residual.squaredNorm();
    if (H) {
      Eigen::Matrix<double, 3, 2> d;
      for (int k = 0; k < 2; ++k)
        d.col(k) = prior.direction_weight * basis.col(k).cross(*prior.direction);
      H->topLeftCorner<2, 2>() += d.transpose() * d;
      g->head<2>() += d.transpose() * residual;
    }
  }
  if (prior.plane) {
    const Eigen::Vector3d n = prior.plane->head<3>();
    const double weight = prior.plane_weight * pixels_per_length;
    const Eigen::RowVector2d across = n.transpose() * basis;
    for (double t : {prior.t_start, prior.t_end}) {
      const double residual = weight * (n.dot(line.At(t)) + (*prior.plane)[3]);
      cost += 0.5 * residual * residual;
      if (!H) continue;
      Eigen::RowVector4d row;
      row << weight * t * across, weight * across;
      *H += row.transpose() * row;
      *g += row.transpose() * residual;
    }
  }
  return cost;
}

// Of the supports that have the point in front; 0: none.
double MeanDepth(std::span<const LineSupport> supports, const Eigen::Vector3d& X) {
  double sum = 0.0;
  size_t count = 0;
  for (const LineSupport& support : supports) {
    const double depth = support.Depth(X);
    if (!(depth > 0.0)) continue;
    sum += depth;
    ++count;
  }
  return count > 0 ? sum / count : 0.0;
}

double MeanPixelsPerLength(std::span<const LineSupport> supports, const Eigen::Vector3d& X) {
  double sum = 0.0;
  int count = 0;
  for (const LineSupport& support : supports) {
    const double depth = support.Depth(X);
    if (!(depth > 0.0)) continue;
    sum += support.focal / depth;
    ++count;
  }
  return count > 0 ? sum / count : 0.0;
}

}  // namespace

LineSupport::LineSupport(const IdealView& view, const LineSegment2d& ideal, uint32_t view_idx)
    : ray_from_pixel(view.R().transpose() * view.InverseK()),
      centre(view.centre()),
      depth_axis(view.R().row(2)),
      focal(view.focal()),
      start(ideal.start),
      end(ideal.end),
      view(view_idx) {
  // Cofactors of K, as in FORMAT.md, for K upper triangular with unit last row.
  const Eigen::Matrix3d& K = view.K();
  const double fx = K(0, 0), fy = K(1, 1), cx = K(0, 2), cy = K(1, 2);
  Eigen::Matrix3d cofactors;
  cofactors << fy, 0, 0, 0, fx, 0, -fy * cx, -fx * cy, fx * fy;
  line_from_moment = cofactors * view.R();
}

std::optional<Eigen::Vector3d> LineSupport::Image(const AnchoredLine& line) const {
  const Eigen::Vector3d u = line.point - centre;
  const Eigen::Vector3d l = line_from_moment * u.cross(line.direction);
  const double scale = l.head<2>().norm();
  if (!(scale > 1e-12 * u.norm() * focal)) return std::nullopt;
  return Eigen::Vector3d(l / scale);
}

std::optional<double> LineSupport::ParameterNearRay(const AnchoredLine& line,
                                                    const Eigen::Vector2d& ideal) const {
  const Eigen::Vector3d v = (ray_from_pixel * ideal.homogeneous()).normalized();
  const Eigen::Vector3d w = line.point - centre;
  const double b = line.direction.dot(v);
  const double denominator = 1.0 - b * b;
  if (!(denominator > 1e-12)) return std::nullopt;
  return (b * v.dot(w) - line.direction.dot(w)) / denominator;
}

std::optional<std::pair<double, double>> LineSupport::Extent(const AnchoredLine& line) const {
  const std::optional<Eigen::Vector3d> image = Image(line);
  if (!image) return std::nullopt;
  const Eigen::Vector2d normal = image->head<2>();
  double t[2];
  for (int e = 0; e < 2; ++e) {
    const Eigen::Vector2d& x = e == 0 ? start : end;
    const Eigen::Vector2d foot = x - (normal.dot(x) + image->z()) * normal;
    const std::optional<double> parameter = ParameterNearRay(line, foot);
    if (!parameter || !(Depth(line.At(*parameter)) > 0.0)) return std::nullopt;
    t[e] = *parameter;
  }
  return std::pair(std::min(t[0], t[1]), std::max(t[0], t[1]));
}

bool FitLine(std::span<const LineSupport> supports, const LinePrior& prior, double cauchy_px,
             AnchoredLine* line) {
  if (supports.size() < 2) return false;
  const double pixels_per_length = MeanPixelsPerLength(supports, line->point);
  if (!(pixels_per_length > 0.0)) return false;
  constexpr int kMaxIterations = 20;
  constexpr double kFloor = 25.0;
  constexpr double kMinGain = 1e-6;
  Eigen::Matrix4d H;
  Eigen::Vector4d g;
  double cost = Linearise(supports, prior, cauchy_px, pixels_per_length, *line, &H, &g);
  if (!std::isfinite(cost)) return false;
  // Directions that the pixels hardly see stay about where they are: the step along a direction
  // whose standard deviation is above a tenth (of the depth, or radians) at half a pixel is damped,
  // or noise would carry the line away.
  const double per_length = 1.0 / MeanDepth(supports, line->point);
  const Eigen::Vector4d floor =
      kFloor * Eigen::Vector4d(1.0, 1.0, per_length * per_length, per_length * per_length);
  double lambda = 1e-4;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Eigen::Matrix4d damped = H;
    damped.diagonal() += lambda * H.diagonal() + floor;
    const Eigen::Vector4d step = -SolveSymmetric<4>(damped, g);
    if (!step.allFinite()) return false;
    AnchoredLine moved;
    double x[6], y[6];
    Eigen::Map<Eigen::Vector3d>{x} = line->direction;
    Eigen::Map<Eigen::Vector3d>{x + 3} = line->point;
    LineManifold::Plus(x, step.data(), y);
    moved.direction = Eigen::Map<Eigen::Vector3d>{y};
    moved.point = Eigen::Map<Eigen::Vector3d>{y + 3};
    Eigen::Matrix4d H_moved;
    Eigen::Vector4d g_moved;
    const double cost_moved =
        Linearise(supports, prior, cauchy_px, pixels_per_length, moved, &H_moved, &g_moved);
    if (cost_moved <= cost) {
      const double gain = cost - cost_moved;
      *line = moved;
      H = H_moved;
      g = g_moved;
      cost = cost_moved;
      lambda = std::max(lambda * 0.1, 1e-10);
      if (gain <= kMinGain * cost || cost < 1e-20) break;
    } else {
      lambda *= 10.0;
      if (lambda > 1e6) break;
    }
  }
  return true;
}

double SquaredDistance(const LineSupport& support, const AnchoredLine& line) {
  const std::optional<Eigen::Vector3d> l = support.Image(line);
  if (!l) return std::numeric_limits<double>::infinity();
  const double a = l->dot(support.start.homogeneous()), b = l->dot(support.end.homogeneous());
  return a * a + b * b;
}

std::optional<double> RmsOfLine(std::span<const LineSupport> supports, const AnchoredLine& line) {
  if (supports.empty()) return std::nullopt;
  double sum = 0.0;
  for (const LineSupport& support : supports) sum += SquaredDistance(support, line);
  if (!std::isfinite(sum)) return std::nullopt;
  return std::sqrt(sum / (2.0 * supports.size()));
}

std::optional<std::pair<double, double>> ExtentOfLine(std::span<const LineSupport> supports,
                                                      const AnchoredLine& line) {
  struct OfView {
    uint32_t view;
    double low, high;
  };
  std::vector<OfView> extents;
  for (const LineSupport& support : supports) {
    const auto extent = support.Extent(line);
    if (!extent) continue;
    const auto same = std::find_if(extents.begin(), extents.end(),
                                   [&](const OfView& e) { return e.view == support.view; });
    if (same == extents.end()) {
      extents.push_back({support.view, extent->first, extent->second});
    } else {
      same->low = std::min(same->low, extent->first);
      same->high = std::max(same->high, extent->second);
    }
  }
  const size_t n = extents.size();
  if (n == 0) return std::nullopt;
  const size_t num_outliers = n >= 6 ? 2 : n >= 4 ? 1 : 0;
  std::vector<double> low, high;
  for (const OfView& e : extents) {
    low.push_back(e.low);
    high.push_back(e.high);
  }
  std::sort(low.begin(), low.end());
  std::sort(high.begin(), high.end(), std::greater<>());
  if (low[num_outliers] < high[num_outliers])
    return std::pair(low[num_outliers], high[num_outliers]);
  // In images that show separate pieces of the line, all pieces count.
  return std::pair(low[0], high[0]);
}

std::optional<LineUncertainty> UncertaintyOfFit(std::span<const LineSupport> supports,
                                                const LinePrior& prior, double sigma_px,
                                                const AnchoredLine& given, double t_start,
                                                double t_end) {
  const double t_middle = 0.5 * (t_start + t_end);
  const AnchoredLine line{given.direction, given.At(t_middle)};
  LinePrior moved = prior;
  moved.t_start -= t_middle;
  moved.t_end -= t_middle;
  const double depth = MeanDepth(supports, line.point);
  if (!(depth > 0.0)) return std::nullopt;
  Eigen::Matrix4d H;
  Eigen::Vector4d g;
  // Plain squares: a loss far wider than any residual.
  const double cost =
      Linearise(supports, moved, 1e9, MeanPixelsPerLength(supports, line.point), line, &H, &g);
  if (!std::isfinite(cost)) return std::nullopt;
  // Lengths in depths, so that all four are of one order.
  const Eigen::Vector4d unit(1.0, 1.0, depth, depth);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(unit.asDiagonal() * H *
                                                             unit.asDiagonal());
  const double floor = std::max(eigen.eigenvalues()[3] * 1e-14, 1e-300);
  const Eigen::Vector4d inverse = eigen.eigenvalues().cwiseMax(floor).cwiseInverse();
  LineUncertainty result;
  result.line = line;
  const Eigen::Matrix4d scaled = sigma_px * sigma_px * eigen.eigenvectors() * inverse.asDiagonal() *
                                 eigen.eigenvectors().transpose();
  result.covariance = unit.asDiagonal() * scaled * unit.asDiagonal();
  const auto relative_sigma = [&](double t) {
    Eigen::Matrix<double, 2, 4> J;
    J << t * Eigen::Matrix2d::Identity(), Eigen::Matrix2d::Identity();
    const Eigen::Matrix2d across = J * result.covariance * J.transpose();
    const double trace = across.trace(), difference = across(0, 0) - across(1, 1);
    const double largest =
        0.5 * (trace + std::sqrt(difference * difference + 4.0 * across(0, 1) * across(0, 1)));
    const double at_end = MeanDepth(supports, line.At(t));
    return std::sqrt(std::max(largest, 0.0)) / (at_end > 0.0 ? at_end : depth);
  };
  result.relative_sigma_start = relative_sigma(t_start - t_middle);
  result.relative_sigma_end = relative_sigma(t_end - t_middle);
  return result;
}

}  // namespace holba
