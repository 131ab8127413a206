// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/association_gate.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <unordered_map>
#include <vector>

#include "holba/base/check.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/bundle/coherent_scatter.h"
#include "holba/bundle/flat_index.h"
#include "holba/geometry/angle.h"
#include "holba/residual/group_line_3d.h"
#include "holba/robust/group_fit.h"

namespace holba {
namespace {

// Lines of one vanishing point are parallel up to this, as its weight of 5e3 on the cost says (1 /
// sqrt(5e3)).
constexpr double kParallelSigmaRad = DegToRad(0.81);
// A surface through fewer members, or through a smaller share of them, is chance.
constexpr size_t kMinMembers = 5;
constexpr size_t kMinLinesOfDirection = 3;
constexpr double kMinShare = 0.25;
// The scatter of a group's members starts from that of so many that have their noise alone: few
// members scatter by chance.
constexpr double kPriorMembers = 10.0;
constexpr int kMaxHalvings = 6;
// Where neighbours are off the group together; a plane that is two is worth nothing.
constexpr int kMaxCoherentHalvings = 12;
// Of the deviation of lines from parallel: to 0.025 degrees, which straight edges have.
constexpr int kMaxDoublings = 5;
constexpr int kMaxSamples = 200;
constexpr double kSampleConfidence = 0.999;
// A line has four unknowns: so many of its offsets from a group are independent at most.
constexpr int kMaxDegreesOfFreedom = 4;

struct PointEstimate {
  Eigen::Vector3d X;
  Eigen::Matrix3d covariance;
};

struct LineEstimate {
  Eigen::Vector3d direction, anchor;
  Eigen::Matrix<double, 3, 2> basis;  // tangent coordinates 0, 1: direction; 2, 3: anchor
  Eigen::Matrix4d covariance;
  double start, end;  // of the seen part, along the direction from the anchor

  PlueckerLine Pluecker() const { return PlueckerLine::FromPointDirection(anchor, direction); }
};

// Of the features that take part. One whose residuals are all absent has none.
template <typename Estimate>
class Estimates {
 public:
  std::optional<Estimate>& Add(uint64_t id) {
    HOLBA_CHECK(index_.Add(id).second);
    return values_.emplace_back();
  }
  bool TakesPart(uint64_t id) const { return index_.contains(id); }
  const Estimate* Find(uint64_t id) const {
    const uint32_t idx = index_.Find(id);
    return idx == FlatIndex::kNone || !values_[idx] ? nullptr : &*values_[idx];
  }

 private:
  FlatIndex index_;
  std::vector<std::optional<Estimate>> values_;
};

// Information (J^T W J) of every feature block with the cameras held, robust weights included.
template <int N>
void AddInformation(const Problem& problem, const std::string& term, double sigma,
                    std::unordered_map<BlockId, Eigen::Matrix<double, N, N>>* information) {
  const ParameterReader reader = problem.Reader();
  for (const auto& batch : problem.batches()) {
    if (batch->term() != term) continue;
    double residual[kMaxResidualDim], jacobian[kMaxResidualDim * kMaxTangent];
    bool present = false;
    ResidualPanel panel;
    panel.residuals = residual;
    panel.jacobians[0] = jacobian;
    panel.present = &present;
    for (size_t i = 0; i < batch->size(); ++i) {
      batch->Evaluate(i, i + 1, reader, panel);
      if (!present) continue;
      double s = 0.0, rho[3];
      for (int k = 0; k < batch->dim(); ++k) s += residual[k] * residual[k];
      batch->loss.Evaluate(s, rho);
      const Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, N, Eigen::RowMajor>> J(
          jacobian, batch->dim(), N);
      auto [it, fresh] = information->try_emplace(batch->block(i, 0));
      if (fresh) it->second.setZero();
      it->second += (rho[1] / (sigma * sigma)) * J.transpose() * J;
    }
  }
}

template <int N>
Eigen::Matrix<double, N, N> InverseOf(Eigen::Matrix<double, N, N> information) {
  // A direction without information gets a large variance instead of none.
  information.diagonal().array() += 1e-12 * information.trace() + 1e-300;
  return information.ldlt().solve(Eigen::Matrix<double, N, N>::Identity());
}

// Noise of one observed coordinate, px: the residuals' own deviation is smaller, for the features
// were fitted to them.
double NoisePx(const Problem& problem, const std::string& term, double per_residual,
               double unknowns) {
  double coordinates = 0.0;
  for (const auto& batch : problem.batches()) {
    if (batch->term() == term) coordinates += per_residual * static_cast<double>(batch->size());
  }
  const double redundancy = std::max(coordinates - unknowns, 0.1 * coordinates);
  return std::max(RobustSigma(problem, term), 1e-6) *
         std::sqrt(coordinates / std::max(redundancy, 1.0));
}

// Mean square of those values of a normal distribution of this variance that pass a test for
// variance 1.
double MeanSquareOfPassed(double variance, double confidence) {
  const double bound = std::sqrt(ChiSquareQuantile(confidence, 1) / variance);
  const double density = std::exp(-0.5 * bound * bound) / std::sqrt(2.0 * std::numbers::pi);
  return variance * (1.0 - 2.0 * bound * density / std::erf(bound / std::numbers::sqrt2));
}

class Tester {
 public:
  Tester(const Reconstruction& model, const BundleProblem& features, bool cameras_know_structure,
         double confidence)
      : model_(model), cameras_know_structure_(cameras_know_structure), confidence_(confidence) {
    for (int dof = 1; dof <= kMaxDegreesOfFreedom; ++dof) {
      max_chi_square_[dof] = ChiSquareQuantile(confidence, dof);
    }
    const Problem& problem = features.problem;
    std::unordered_map<BlockId, Eigen::Matrix3d> point_information;
    std::unordered_map<BlockId, Eigen::Matrix4d> line_information;
    const size_t num_of_structure = features.num_points_of_structure;
    AddInformation<3>(
        problem, "point",
        NoisePx(problem, "point", 2, 3.0 * (features.points.size() - num_of_structure)),
        &point_information);
    AddInformation<3>(problem, "structure_point",
                      NoisePx(problem, "structure_point", 2, 3.0 * num_of_structure),
                      &point_information);
    AddInformation<4>(problem, "line", NoisePx(problem, "line", 2, 4.0 * features.lines.size()),
                      &line_information);
    for (const auto& [id, block] : features.points) {
      std::optional<PointEstimate>& estimate = points_.Add(id);
      const auto it = point_information.find(block);
      if (it == point_information.end()) continue;
      estimate = {Eigen::Map<const Eigen::Vector3d>(problem.values(block)),
                  InverseOf<3>(it->second)};
    }
    for (const auto& [id, block] : features.lines) {
      std::optional<LineEstimate>& estimate = lines_.Add(id);
      const auto it = line_information.find(block);
      if (it == line_information.end()) continue;
      LineEstimate line;
      line.direction = Eigen::Map<const Eigen::Vector3d>(problem.values(block));
      line.anchor = Eigen::Map<const Eigen::Vector3d>(problem.values(block) + 3);
      line.basis = TangentBasis(line.direction);
      line.covariance = InverseOf<4>(it->second);
      const Line3D& line3D = model.lines3D.at(id);
      line.start = line.direction.dot(line3D.start - line.anchor);
      line.end = line.direction.dot(line3D.end - line.anchor);
      estimate = line;
    }
  }

  AssociationReport Run(const BundleSelection& selection) {
    for (const SelectedGroup& group : selection.groups) TestGroup(group);
    AssociationCount& edges = report_.counts["wireframe edges"];
    for (const WireframeEdge& edge : selection.wireframe) {
      // What takes no part (a single image sees it) is not tested either.
      if (!points_.TakesPart(edge.point3D_id) || !lines_.TakesPart(edge.line3D_id)) continue;
      ++edges.tested;
      if (EdgeChiSquare(edge) < max_chi_square_[2]) continue;
      ++edges.rejected;
      report_.filter.edges.emplace(edge.point3D_id, edge.line3D_id);
    }
    return std::move(report_);
  }

 private:
  // Squared offset of a member from a group in standard deviations of the member. Infinite where
  // the projection is undefined.
  struct Offset {
    double chi_square = HUGE_VAL;
    int degrees_of_freedom = 1;
  };

  // Distance to the surface.
  static Offset OffsetOf(const GroupType& type, const double* g, const PointEstimate& point) {
    Eigen::Vector3d on_group;
    if (!type.project_point(g, point.X, &on_group)) return {};
    const Eigen::Vector3d offset = point.X - on_group;
    const double squared = offset.squaredNorm();
    if (squared == 0.0) return {0.0, 1};
    return {squared * squared / offset.dot(point.covariance * offset), 1};
  }

  static Offset OffsetOf(const GroupType& type, const double* g, const LineEstimate& line) {
    if (type.IsParallelism()) return OffsetFromDirection(type, g, line);
    if (type.project_point) return OffsetOfEnds(type, g, line);
    return OffsetFromProjectedLine(type, g, line);
  }

  // The two angles between a line and the direction of its vanishing point.
  static Offset OffsetFromDirection(const GroupType& type, const double* g,
                                    const LineEstimate& line,
                                    double parallel_sigma_rad = kParallelSigmaRad) {
    Eigen::Vector3d v;
    double unused[3 * kMaxGroupParams];
    type.direction(g, &v, unused);
    double angles[2];
    const Eigen::Vector3d towards = v.dot(line.direction) < 0 ? Eigen::Vector3d(-v) : v;
    UnitVector3::Minus(towards.data(), line.direction.data(), angles);
    Eigen::Matrix2d covariance = line.covariance.topLeftCorner<2, 2>();
    covariance.diagonal().array() += parallel_sigma_rad * parallel_sigma_rad;
    const Eigen::Vector2d e(angles[0], angles[1]);
    return {e.dot(covariance.ldlt().solve(e)), 2};
  }

  // The distances of both ends of a line to the surface.
  static Offset OffsetOfEnds(const GroupType& type, const double* g, const LineEstimate& line) {
    Eigen::Vector2d e;
    Eigen::Matrix<double, 2, 4> J;
    const double positions[2] = {line.start, line.end};
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector3d X = line.anchor + positions[k] * line.direction;
      Eigen::Vector3d on_group;
      if (!type.project_point(g, X, &on_group)) return {};
      const Eigen::Vector3d offset = X - on_group;
      e[k] = offset.norm();
      const Eigen::Vector3d normal =
          e[k] > 0 ? Eigen::Vector3d(offset / e[k]) : Eigen::Vector3d::Zero();
      if (k == 1 && J.row(0).tail<2>().dot(normal.transpose() * line.basis) < 0) e[k] = -e[k];
      const Eigen::RowVector2d along = (e[k] < 0 ? -1.0 : 1.0) * normal.transpose() * line.basis;
      J.row(k) << positions[k] * along, along;
    }
    if (e.isZero(0.0)) return {0.0, 2};
    Eigen::Matrix2d covariance = J * line.covariance * J.transpose();
    // Both ends may move together only (a line in the plane): keep the inverse finite.
    covariance.diagonal().array() += 1e-9 * covariance.trace() + 1e-300;
    return {e.dot(covariance.ldlt().solve(e)), 2};
  }

  // Of a type that projects lines only: the moments of both ends about the projected line. The
  // projection leaves some movements of a line as they are, so that only as many combinations of
  // the six moments are independent as the rank of their covariance says. That is taken at the
  // projected line, where the moments are 0: elsewhere the curvature of the group adds to the rank.
  static Offset OffsetFromProjectedLine(const GroupType& type, const double* g,
                                        const LineEstimate& line) {
    const PlueckerLine pluecker = line.Pluecker();
    Vector6d world, on_group;
    world << pluecker.direction, pluecker.moment;
    if (!type.project_line(g, world, &on_group)) return {};
    PlueckerLine projected{on_group.head<3>(), on_group.tail<3>()};
    double length = projected.direction.norm();
    if (!(length > 0.0)) return {};
    if (projected.direction.dot(line.direction) < 0.0) length = -length;
    projected.direction /= length;
    projected.moment /= length;

    const GroupLine3dResidual residual{&type};
    const GroupLine3dResidual::Datum ends{{line.start, line.end}};
    double block[6];
    const double* const values[] = {block, g};
    Vector6d moments, moments_on_group;
    double* const none[] = {nullptr, nullptr};
    Eigen::Map<Vector6d>{block} << line.direction, line.anchor;
    if (!residual.Evaluate(ends, values, moments.data(), none)) return {};
    RowMajor<6, 4> J;
    double* const jacobians[] = {J.data(), nullptr};
    Eigen::Map<Vector6d>{block} << projected.direction, projected.ClosestPoint(line.anchor);
    if (!residual.Evaluate(ends, values, moments_on_group.data(), jacobians)) return {};
    Eigen::Matrix4d to_its_basis = Eigen::Matrix4d::Zero();
    to_its_basis.topLeftCorner<2, 2>() = TangentBasis(projected.direction).transpose() * line.basis;
    to_its_basis.bottomRightCorner<2, 2>() = to_its_basis.topLeftCorner<2, 2>();
    J = (J * to_its_basis).eval();
    if (moments.isZero(0.0)) return {0.0, 1};
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> covariance(
        J * line.covariance * J.transpose());
    const double least = 1e-9 * covariance.eigenvalues()[5];  // smaller ones are rounding
    Offset offset{0.0, 0};
    for (int k = 6 - kMaxDegreesOfFreedom; k < 6; ++k) {
      const double variance = covariance.eigenvalues()[k];
      if (!(variance > least)) continue;
      const double component = covariance.eigenvectors().col(k).dot(moments);
      offset.chi_square += component * component / variance;
      ++offset.degrees_of_freedom;
    }
    return offset.degrees_of_freedom > 0 ? offset : Offset{};
  }

  double EdgeChiSquare(const WireframeEdge& edge) const {
    const PointEstimate* point = points_.Find(edge.point3D_id);
    const LineEstimate* line = lines_.Find(edge.line3D_id);
    if (point == nullptr || line == nullptr) return HUGE_VAL;
    const LineEstimate& l = *line;
    const Eigen::Vector3d v = point->X - l.anchor;
    const Eigen::Vector2d offset = l.basis.transpose() * v;
    Eigen::Matrix<double, 2, 4> by_line;
    by_line << -l.direction.dot(v) * Eigen::Matrix2d::Identity(), -Eigen::Matrix2d::Identity();
    const Eigen::Matrix2d covariance = l.basis.transpose() * point->covariance * l.basis +
                                       by_line * l.covariance * by_line.transpose();
    return offset.dot(covariance.ldlt().solve(offset));
  }

  struct Members {
    std::vector<std::pair<point3D_t, const PointEstimate*>> points;
    std::vector<std::pair<line3D_t, const LineEstimate*>> lines;
    size_t size() const { return points.size() + lines.size(); }
  };

  // Of the bound, squared: below 1 it passes.
  double ShareOfBound(const Offset& offset) const {
    return offset.chi_square / max_chi_square_[offset.degrees_of_freedom];
  }

  // The parameters that most members agree with, the given ones being one hypothesis. Stay where
  // nothing agrees with any.
  void Estimate(const GroupType& type, const Members& members, uint64_t seed, double* g) const {
    std::vector<Eigen::Vector3d> points;
    std::vector<PlueckerLine> lines;
    for (const auto& [id, point] : members.points) points.push_back(point->X);
    for (const auto& [id, line] : members.lines) lines.push_back(line->Pluecker());
    const auto residuals = [&](const double* trial, std::vector<double>* shares) {
      size_t i = 0;
      for (const auto& [id, point] : members.points) {
        (*shares)[i++] = std::sqrt(ShareOfBound(OffsetOf(type, trial, *point)));
      }
      for (const auto& [id, line] : members.lines) {
        (*shares)[i++] = std::sqrt(ShareOfBound(OffsetOf(type, trial, *line)));
      }
    };
    const auto fit = FitGroupRobustly(
        type, points, lines, residuals,
        {.confidence = kSampleConfidence, .max_samples = kMaxSamples, .seed = seed}, g);
    if (fit) std::copy_n(fit->g.data(), type.manifold->ambient, g);
  }

  // Lines of one vanishing point count as much as they are parallel: most are so to a tenth of what
  // the weight stands for. The greatest deviation that the lines which pass do not rule out (95 %).
  int HalvingsOfParallel(const GroupType& type, const double* g, const Members& members) const {
    double log_likelihoods[kMaxDoublings + 1], greatest = -HUGE_VAL;
    for (int k = 0; k <= kMaxDoublings; ++k) {
      const double sigma = std::ldexp(kParallelSigmaRad, -k);
      double sum = 0.0;
      for (const auto& [id, line] : members.lines) {
        if (!(ShareOfBound(OffsetFromDirection(type, g, *line, kParallelSigmaRad)) < 1.0)) continue;
        Eigen::Matrix2d covariance = line->covariance.topLeftCorner<2, 2>();
        covariance.diagonal().array() += sigma * sigma;
        sum -= 0.5 * (OffsetFromDirection(type, g, *line, sigma).chi_square +
                      std::log(covariance.determinant()));
      }
      log_likelihoods[k] = sum;
      greatest = std::max(greatest, sum);
    }
    int k = 0;
    while (log_likelihoods[k] < greatest - 0.5 * max_chi_square_parallel_) ++k;
    return -2 * k;
  }

  // Members of a surface that passed: of their mean square in standard deviations, and of what
  // neighbours have in common.
  int HalvingsOfScatter(const GroupType& type, double mean_square,
                        std::vector<MemberOffset>* offsets) const {
    const auto halvings = [](double factor, int most) {
      return std::min(most, static_cast<int>(std::lround(std::log2(std::max(factor, 1.0)))));
    };
    return std::max(
        halvings(VarianceOfPassed(mean_square, confidence_), kMaxHalvings),
        halvings(CoherentVariance(type.manifold->tangent, offsets), kMaxCoherentHalvings));
  }

  void TestGroup(const SelectedGroup& selected) {
    const group3D_t id = selected.id;
    const Group3D& group = model_.groups3D.at(id);
    const GroupType& type = *group.type;
    Members members;
    for (point3D_t point_id : selected.point3D_ids) {
      const PointEstimate* point = points_.Find(point_id);
      if (point != nullptr) members.points.emplace_back(point_id, point);
    }
    for (line3D_t line_id : selected.line3D_ids) {
      const LineEstimate* line = lines_.Find(line_id);
      if (line != nullptr) members.lines.emplace_back(line_id, line);
    }
    double g[kMaxGroupParams];
    if (members.size() == 0 || !type.from_file(group.params.data(), g)) {
      report_.filter.groups.insert(id);
      return;
    }
    Estimate(type, members, id, g);

    size_t accepted = 0;
    double sum_squares = 0.0;  // of the accepted, for each of their degrees of freedom
    const std::string name(type.name);
    const auto test = [&](const Offset& offset, const char* kind) {
      AssociationCount& count = report_.counts[name + kind];
      ++count.tested;
      const bool passes = offset.chi_square < max_chi_square_[offset.degrees_of_freedom];
      if (passes) {
        ++accepted;
        sum_squares += offset.chi_square / offset.degrees_of_freedom;
      } else {
        ++count.rejected;
      }
      return passes;
    };
    std::vector<MemberOffset> offsets;  // of the accepted points
    for (const auto& [point_id, point] : members.points) {
      const Offset offset = OffsetOf(type, g, *point);
      if (!test(offset, " points")) {
        report_.filter.points.emplace(id, point_id);
      } else if (cameras_know_structure_) {
        Eigen::Vector3d on_group;
        type.project_point(g, point->X, &on_group);
        offsets.push_back(
            {point->X, std::sqrt(offset.chi_square) * (point->X - on_group).normalized()});
      }
    }
    for (const auto& [line_id, line] : members.lines) {
      if (!test(OffsetOf(type, g, *line), " lines")) report_.filter.lines.emplace(id, line_id);
    }
    const size_t least = type.IsParallelism() ? kMinLinesOfDirection : kMinMembers;
    if (accepted < least ||
        static_cast<double>(accepted) < kMinShare * static_cast<double>(members.size())) {
      report_.filter.groups.insert(id);
      ++report_.groups_dropped;
      return;
    }
    const double mean_square =
        (sum_squares + kPriorMembers * MeanSquareOfPassed(1.0, confidence_)) /
        (static_cast<double>(accepted) + kPriorMembers);
    const int halvings = type.IsParallelism() ? HalvingsOfParallel(type, g, members)
                                              : HalvingsOfScatter(type, mean_square, &offsets);
    if (halvings != 0) report_.filter.halvings[id] = halvings;
    std::vector<double>& params = report_.group_params[id];
    params.resize(type.num_file_params);
    type.to_file(g, params.data());
  }

  const Reconstruction& model_;
  const bool cameras_know_structure_;
  const double confidence_;
  double max_chi_square_[kMaxDegreesOfFreedom + 1] = {};  // by degrees of freedom
  const double max_chi_square_parallel_ = ChiSquareQuantile(0.95, 1);
  Estimates<PointEstimate> points_;
  Estimates<LineEstimate> lines_;
  AssociationReport report_;
};

}  // namespace

double ChiSquareQuantile(double probability, int degrees_of_freedom) {
  HOLBA_CHECK(degrees_of_freedom >= 1 && degrees_of_freedom <= kMaxDegreesOfFreedom);
  HOLBA_CHECK(probability > 0.0 && probability < 1.0);
  if (degrees_of_freedom == 2) return -2.0 * std::log1p(-probability);
  // The probability of more than x, from that of two degrees of freedom fewer (Abramowitz and
  // Stegun 26.4.8); it falls with x.
  const auto more_than = [degrees_of_freedom](double x) {
    switch (degrees_of_freedom) {
      case 1:
        return std::erfc(std::sqrt(0.5 * x));
      case 3:
        return std::erfc(std::sqrt(0.5 * x)) +
               std::sqrt(2.0 * x / std::numbers::pi) * std::exp(-0.5 * x);
      default:
        return (1.0 + 0.5 * x) * std::exp(-0.5 * x);
    }
  };
  double low = 0.0, high = 100.0;
  while (high - low > 1e-12 * high) {
    const double middle = 0.5 * (low + high);
    (more_than(middle) > 1.0 - probability ? low : high) = middle;
  }
  return high;
}

double VarianceOfPassed(double mean_square, double confidence) {
  double low = 1.0, high = 1e4;
  if (mean_square <= MeanSquareOfPassed(low, confidence)) return low;
  while (high - low > 1e-9 * high) {
    const double middle = std::sqrt(low * high);
    (MeanSquareOfPassed(middle, confidence) < mean_square ? low : high) = middle;
  }
  return high;
}

AssociationReport TestAssociations(const Reconstruction& model, const BundleSelection& selection,
                                   const BundleProblem& features, bool cameras_know_structure,
                                   double confidence) {
  return Tester(model, features, cameras_know_structure, confidence).Run(selection);
}

}  // namespace holba
