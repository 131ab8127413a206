// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/association_gate.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <unordered_map>

#include "holba/base/check.h"
#include "holba/base/random.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/bundle_problem.h"

namespace holba {
namespace {

// Lines of one vanishing point are parallel up to this, as its weight of 5e3 on the cost says (1 /
// sqrt(5e3)).
constexpr double kParallelSigmaRad = 0.81 * std::numbers::pi / 180.0;
// A surface through fewer members, or through a smaller share of them, is chance.
constexpr size_t kMinMembers = 5;
constexpr size_t kMinLinesOfDirection = 3;
constexpr double kMinShare = 0.25;
// The scatter of a group's members starts from that of so many that have their noise alone: few
// members scatter by chance.
constexpr double kPriorMembers = 10.0;
constexpr int kMaxHalvings = 6;
constexpr int kMaxSamples = 200;
constexpr double kSampleConfidence = 0.999;

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
  Tester(const Reconstruction& model, const BundleProblem& features, double confidence)
      : model_(model),
        confidence_(confidence),
        max_chi_square1_(ChiSquareQuantile(confidence, 1)),
        max_chi_square2_(ChiSquareQuantile(confidence, 2)) {
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
      const auto it = point_information.find(block);
      if (it == point_information.end()) continue;
      points_[id] = {Eigen::Map<const Eigen::Vector3d>(problem.values(block)),
                     InverseOf<3>(it->second)};
    }
    for (const auto& [id, block] : features.lines) {
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
      lines_[id] = line;
    }
  }

  AssociationReport Run(const BundleSelection& selection) {
    for (const SelectedGroup& group : selection.groups) TestGroup(group);
    AssociationCount& edges = report_.counts["wireframe edges"];
    for (const WireframeEdge& edge : selection.wireframe) {
      ++edges.tested;
      if (EdgeChiSquare(edge) < max_chi_square2_) continue;
      ++edges.rejected;
      report_.filter.edges.emplace(edge.point3D_id, edge.line3D_id);
    }
    return std::move(report_);
  }

 private:
  // Squared distance to the surface in standard deviations, 1 dof. Infinite where the projection is
  // undefined.
  static double ChiSquare(const GroupType& type, const double* g, const PointEstimate& point) {
    Eigen::Vector3d on_group;
    if (!type.project_point(g, point.X, &on_group)) return HUGE_VAL;
    const Eigen::Vector3d offset = point.X - on_group;
    const double squared = offset.squaredNorm();
    if (squared == 0.0) return 0.0;
    return squared * squared / offset.dot(point.covariance * offset);
  }

  // Of a line on a surface: the offsets of its two ends, 2 dof. Of a line of a vanishing point: its
  // two angles.
  static double ChiSquare(const GroupType& type, const double* g, const LineEstimate& line) {
    if (type.IsParallelism()) {
      Eigen::Vector3d v;
      double unused[3 * kMaxGroupParams];
      type.direction(g, &v, unused);
      double angles[2];
      const Eigen::Vector3d towards = v.dot(line.direction) < 0 ? Eigen::Vector3d(-v) : v;
      UnitVector3::Minus(towards.data(), line.direction.data(), angles);
      Eigen::Matrix2d covariance = line.covariance.topLeftCorner<2, 2>();
      covariance.diagonal().array() += kParallelSigmaRad * kParallelSigmaRad;
      const Eigen::Vector2d e(angles[0], angles[1]);
      return e.dot(covariance.ldlt().solve(e));
    }
    Eigen::Vector2d e;
    Eigen::Matrix<double, 2, 4> J;
    const double positions[2] = {line.start, line.end};
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector3d X = line.anchor + positions[k] * line.direction;
      Eigen::Vector3d on_group;
      if (!type.project_point(g, X, &on_group)) return HUGE_VAL;
      const Eigen::Vector3d offset = X - on_group;
      e[k] = offset.norm();
      const Eigen::Vector3d normal =
          e[k] > 0 ? Eigen::Vector3d(offset / e[k]) : Eigen::Vector3d::Zero();
      if (k == 1 && J.row(0).tail<2>().dot(normal.transpose() * line.basis) < 0) e[k] = -e[k];
      const Eigen::RowVector2d along = (e[k] < 0 ? -1.0 : 1.0) * normal.transpose() * line.basis;
      J.row(k) << positions[k] * along, along;
    }
    if (e.isZero(0.0)) return 0.0;
    Eigen::Matrix2d covariance = J * line.covariance * J.transpose();
    // Both ends may move together only (a line in the plane): keep the inverse finite.
    covariance.diagonal().array() += 1e-9 * covariance.trace() + 1e-300;
    return e.dot(covariance.ldlt().solve(e));
  }

  double EdgeChiSquare(const WireframeEdge& edge) const {
    const auto point = points_.find(edge.point3D_id);
    const auto line = lines_.find(edge.line3D_id);
    if (point == points_.end() || line == lines_.end()) return HUGE_VAL;
    const LineEstimate& l = line->second;
    const Eigen::Vector3d v = point->second.X - l.anchor;
    const Eigen::Vector2d offset = l.basis.transpose() * v;
    Eigen::Matrix<double, 2, 4> by_line;
    by_line << -l.direction.dot(v) * Eigen::Matrix2d::Identity(), -Eigen::Matrix2d::Identity();
    const Eigen::Matrix2d covariance = l.basis.transpose() * point->second.covariance * l.basis +
                                       by_line * l.covariance * by_line.transpose();
    return offset.dot(covariance.ldlt().solve(offset));
  }

  struct Members {
    std::vector<std::pair<point3D_t, const PointEstimate*>> points;
    std::vector<std::pair<line3D_t, const LineEstimate*>> lines;
    size_t size() const { return points.size() + lines.size(); }
  };

  // Sum of truncated chi-squares, each as a share of its bound: smaller is better, size() at worst.
  double Score(const GroupType& type, const double* g, const Members& members) const {
    double score = 0.0;
    for (const auto& [id, point] : members.points)
      score += std::min(1.0, ChiSquare(type, g, *point) / max_chi_square1_);
    for (const auto& [id, line] : members.lines)
      score += std::min(1.0, ChiSquare(type, g, *line) / max_chi_square2_);
    return score;
  }

  static bool Fit(const GroupType& type, const std::vector<const PointEstimate*>& points,
                  const std::vector<const LineEstimate*>& lines, double* g) {
    std::vector<Eigen::Vector3d> xs;
    std::vector<PlueckerLine> ls;
    for (const PointEstimate* p : points) xs.push_back(p->X);
    for (const LineEstimate* l : lines) ls.push_back(l->Pluecker());
    return type.fit_minimal(xs, ls, g);
  }

  // The best of the given parameters and of random minimal samples, then refitted to its inliers.
  void Estimate(const GroupType& type, const Members& members, Random* random, double* g) const {
    double best = Score(type, g, members);
    double trial[kMaxGroupParams];
    const auto consider = [&] {
      const double score = Score(type, trial, members);
      if (score >= best) return false;
      best = score;
      std::copy_n(trial, type.manifold->ambient, g);
      return true;
    };
    const bool by_points =
        type.min_points > 0 && members.points.size() >= static_cast<size_t>(type.min_points);
    const bool by_lines =
        type.min_lines > 0 && members.lines.size() >= static_cast<size_t>(type.min_lines);
    const int sample_size = by_points ? type.min_points : type.min_lines;
    double needed = (by_points || by_lines) ? kMaxSamples : 0;
    for (int sample = 0; sample < std::min<double>(needed, kMaxSamples); ++sample) {
      std::vector<const PointEstimate*> points;
      std::vector<const LineEstimate*> lines;
      for (int k = 0; k < sample_size; ++k) {
        if (by_points) {
          points.push_back(members.points[random->Index(members.points.size())].second);
        } else {
          lines.push_back(members.lines[random->Index(members.lines.size())].second);
        }
      }
      if (Fit(type, points, lines, trial)) consider();
      const double share = 1.0 - best / static_cast<double>(members.size());
      const double miss = 1.0 - std::pow(std::clamp(share, 1e-3, 1.0 - 1e-9), sample_size);
      needed = std::min<double>(kMaxSamples, std::log(1.0 - kSampleConfidence) / std::log(miss));
    }
    for (int refit = 0; refit < 3; ++refit) {
      std::vector<const PointEstimate*> points;
      std::vector<const LineEstimate*> lines;
      for (const auto& [id, point] : members.points) {
        if (ChiSquare(type, g, *point) < max_chi_square1_) points.push_back(point);
      }
      for (const auto& [id, line] : members.lines) {
        if (ChiSquare(type, g, *line) < max_chi_square2_) lines.push_back(line);
      }
      if (!Fit(type, points, lines, trial) || !consider()) break;
    }
  }

  void TestGroup(const SelectedGroup& selected) {
    const group3D_t id = selected.id;
    const Group3D& group = model_.groups3D.at(id);
    const GroupType& type = *group.type;
    Members members;
    for (point3D_t point_id : selected.point3D_ids) {
      const auto it = points_.find(point_id);
      if (it != points_.end()) members.points.emplace_back(point_id, &it->second);
    }
    for (line3D_t line_id : selected.line3D_ids) {
      const auto it = lines_.find(line_id);
      if (it != lines_.end()) members.lines.emplace_back(line_id, &it->second);
    }
    double g[kMaxGroupParams];
    if (members.size() == 0 || !type.from_file(group.params.data(), g)) {
      report_.filter.groups.insert(id);
      return;
    }
    Random random(id);
    Estimate(type, members, &random, g);

    size_t accepted = 0;
    double sum_squares = 0.0;  // of the accepted, for each of their degrees of freedom
    const std::string name(type.name);
    for (const auto& [point_id, point] : members.points) {
      AssociationCount& count = report_.counts[name + " points"];
      ++count.tested;
      const double chi_square = ChiSquare(type, g, *point);
      if (chi_square < max_chi_square1_) {
        ++accepted;
        sum_squares += chi_square;
      } else {
        ++count.rejected;
        report_.filter.points.emplace(id, point_id);
      }
    }
    for (const auto& [line_id, line] : members.lines) {
      AssociationCount& count = report_.counts[name + " lines"];
      ++count.tested;
      const double chi_square = ChiSquare(type, g, *line);
      if (chi_square < max_chi_square2_) {
        ++accepted;
        sum_squares += 0.5 * chi_square;
      } else {
        ++count.rejected;
        report_.filter.lines.emplace(id, line_id);
      }
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
    const double variance = VarianceOfPassed(mean_square, confidence_);
    const int halvings = std::min(kMaxHalvings, static_cast<int>(std::lround(std::log2(variance))));
    if (halvings > 0) report_.filter.halvings[id] = halvings;
    std::vector<double>& params = report_.group_params[id];
    params.resize(type.num_file_params);
    type.to_file(g, params.data());
  }

  const Reconstruction& model_;
  const double confidence_;
  const double max_chi_square1_, max_chi_square2_;
  std::unordered_map<point3D_t, PointEstimate> points_;
  std::unordered_map<line3D_t, LineEstimate> lines_;
  AssociationReport report_;
};

}  // namespace

double ChiSquareQuantile(double probability, int degrees_of_freedom) {
  HOLBA_CHECK(degrees_of_freedom == 1 || degrees_of_freedom == 2);
  HOLBA_CHECK(probability > 0.0 && probability < 1.0);
  if (degrees_of_freedom == 2) return -2.0 * std::log1p(-probability);
  // P(x) = 1 - erfc(sqrt(x / 2)), monotonic.
  double low = 0.0, high = 100.0;
  while (high - low > 1e-12 * high) {
    const double middle = 0.5 * (low + high);
    (std::erfc(std::sqrt(0.5 * middle)) > 1.0 - probability ? low : high) = middle;
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
                                   const BundleProblem& features, double confidence) {
  return Tester(model, features, confidence).Run(selection);
}

}  // namespace holba
