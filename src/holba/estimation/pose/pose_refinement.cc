// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/pose/pose_refinement.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <optional>

#include "holba/geometry/manifold.h"

namespace holba {
namespace {

using Eigen::Vector2d;

constexpr int kMaxUnknowns = 6 + kMaxCameraParams;
using Normal = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMaxUnknowns,
                             kMaxUnknowns>;
using Step = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxUnknowns, 1>;

// Which unknowns there are: the pose's six, the logarithm of a factor of all focal lengths, lens
// parameters.
class Unknowns {
 public:
  Unknowns(const CameraModel& model, const FreeIntrinsics& free) : model_{model}, free_{free} {
    if (model.focal_idxs.empty()) free_.focal_length = false;
    size_ = 6 + (free_.focal_length ? 1 : 0) +
            (free_.extra_params ? static_cast<int>(model.extra_idxs.size()) : 0);
  }

  int size() const { return size_; }

  // Adds J' J and J' e times `weight`.
  void Add(const SightingJacobian& jacobian, const double* params, const Vector2d& error,
           double weight, Normal* H, Step* g) const {
    Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor, 2, kMaxUnknowns> J(2, size_);
    J.leftCols<6>() = jacobian.pose;
    for (int row = 0; row < 2; ++row) {
      const double* const by_params = jacobian.params + row * model_.num_params;
      int column = 6;
      if (free_.focal_length) {
        double by_factor = 0.0;
        for (int idx : model_.focal_idxs) by_factor += by_params[idx] * params[idx];
        J(row, column++) = by_factor;
      }
      if (!free_.extra_params) continue;
      for (int idx : model_.extra_idxs) J(row, column++) = by_params[idx];
    }
    H->noalias() += weight * J.transpose() * J;
    g->noalias() += weight * J.transpose() * error;
  }

  // What is known of the intrinsics before. Returns the cost, half of the squared deviations.
  double AddPriors(const PoseUnknowns& at, const PoseUnknowns& start, Normal* H, Step* g) const {
    double cost = 0.0;
    int row = 6;
    const auto add = [&](double deviation, double sigma) {
      if (sigma > 0.0) {
        const double information = 1.0 / (sigma * sigma);
        (*H)(row, row) += information;
        (*g)[row] += information * deviation;
        cost += 0.5 * information * deviation * deviation;
      }
      ++row;
    };
    if (free_.focal_length) {
      const int idx = model_.focal_idxs[0];
      add(std::log(at.params[idx] / start.params[idx]), free_.focal_length_sigma);
    }
    if (free_.extra_params) {
      for (int idx : model_.extra_idxs)
        add(at.params[idx] - start.params[idx], free_.extra_param_sigma);
    }
    return cost;
  }

  PoseUnknowns Moved(const PoseUnknowns& at, const Step& step) const {
    PoseUnknowns moved = at;
    moved.cam_from_world.rotation =
        (ExpRotation(step.head<3>()) * at.cam_from_world.rotation).normalized();
    moved.cam_from_world.translation += step.segment<3>(3);
    int row = 6;
    if (free_.focal_length) {
      // No step changes the focal length by more than a factor of 2.
      const double factor = std::exp(std::clamp(step[row++], -0.7, 0.7));
      for (int idx : model_.focal_idxs) moved.params[idx] *= factor;
    }
    if (free_.extra_params) {
      for (int idx : model_.extra_idxs) moved.params[idx] += step[row++];
    }
    return moved;
  }

 private:
  const CameraModel& model_;
  FreeIntrinsics free_;
  int size_;
};

struct NormalEquations {
  Normal H;
  Step g;
  double gain = 0.0;
};

double InverseSquare(double x) { return 1.0 / (x * x); }

// Calls visit(error, jacobian, information) for every sighting that has an error.
template <typename Visit>
void ForEachSighting(const PoseEvidence& evidence, const PoseUnknowns& at,
                     const ForEachKind<double>& noise,
                     const ForEachKind<std::vector<uint8_t>>* counts, const Visit& visit) {
  const PosedCamera view(evidence.camera().model, at.params.data(), at.cam_from_world);
  const AbsolutePoseMatches& matches = evidence.matches();
  Vector2d error;
  SightingJacobian jacobian;
  const auto is_wanted = [](const std::vector<uint8_t>* flags, size_t i) {
    return flags == nullptr || (*flags)[i] != 0;
  };
  for (size_t i = 0; i < matches.points.size(); ++i) {
    if (!is_wanted(counts ? &counts->points : nullptr, i)) continue;
    if (ErrorOf(view, matches.points[i], &error, &jacobian))
      visit(error, jacobian, InverseSquare(noise.points));
  }
  for (size_t i = 0; i < matches.lines.size(); ++i) {
    if (!is_wanted(counts ? &counts->lines : nullptr, i)) continue;
    if (ErrorOf(view, matches.lines[i], &error, &jacobian))
      visit(error, jacobian, InverseSquare(noise.lines));
  }
  for (size_t i = 0; i < matches.directions.size(); ++i) {
    if (!is_wanted(counts ? &counts->directions : nullptr, i)) continue;
    if (ErrorOf(view, evidence.given_calibration(), matches.directions[i], &error, &jacobian))
      visit(error, jacobian, InverseSquare(noise.directions));
  }
}

// The gain less the cost of the priors, as much as errors of that cost take from it.
NormalEquations Evaluate(const PoseEvidence& evidence, const Unknowns& unknowns,
                         const PoseUnknowns& at, const PoseUnknowns& start,
                         const PoseRefinement& refinement) {
  NormalEquations result;
  result.H = Normal::Zero(unknowns.size(), unknowns.size());
  result.g = Step::Zero(unknowns.size());
  ForEachSighting(evidence, at, refinement.noise, nullptr,
                  [&](const Vector2d& error, const SightingJacobian& jacobian, double information) {
                    const double e2 = information * error.squaredNorm();
                    const double weight = refinement.gain.Weight(e2);
                    if (weight == 0.0) return;
                    result.gain += refinement.gain.Of(e2);
                    unknowns.Add(jacobian, at.params.data(), error, weight * information, &result.H,
                                 &result.g);
                  });
  const double cost = unknowns.AddPriors(at, start, &result.H, &result.g);
  result.gain -= 2.0 * refinement.gain.SlopeAtZero() * cost;
  return result;
}

bool SolveDamped(const NormalEquations& equations, double damping, Step* step) {
  Normal H = equations.H;
  H.diagonal() *= 1.0 + damping;
  H.diagonal().array() += 1e-14 * H.diagonal().maxCoeff();
  *step = H.ldlt().solve(-equations.g);
  return step->allFinite();
}

}  // namespace

RefinedPose RefinePose(const PoseEvidence& evidence, const PoseUnknowns& start,
                       const PoseRefinement& refinement) {
  const Unknowns unknowns(*evidence.camera().model, refinement.free);
  RefinedPose best{start, 0.0};
  NormalEquations equations = Evaluate(evidence, unknowns, start, start, refinement);
  double damping = 1e-4;
  for (int iteration = 0; iteration < refinement.max_iterations; ++iteration) {
    Step step;
    if (!SolveDamped(equations, damping, &step)) break;
    const PoseUnknowns trial = unknowns.Moved(best.at, step);
    NormalEquations at_trial = Evaluate(evidence, unknowns, trial, start, refinement);
    if (at_trial.gain > equations.gain) {
      // Gains are numbers of sightings: less than a thousandth of one decides nothing.
      const bool finished = at_trial.gain - equations.gain < 1e-3;
      best.at = trial;
      equations = std::move(at_trial);
      damping = std::max(damping * 0.1, 1e-12);
      if (finished) break;
    } else {
      damping *= 10.0;
      if (damping > 1e4) break;
    }
  }
  best.gain = equations.gain;
  return best;
}

std::optional<Matrix6d> PoseCovariance(const PoseEvidence& evidence, const PoseUnknowns& at,
                                       const ForEachKind<double>& noise, const FreeIntrinsics& free,
                                       const ForEachKind<std::vector<uint8_t>>& counts) {
  const Unknowns unknowns(*evidence.camera().model, free);
  NormalEquations equations;
  equations.H = Normal::Zero(unknowns.size(), unknowns.size());
  equations.g = Step::Zero(unknowns.size());
  ForEachSighting(evidence, at, noise, &counts,
                  [&](const Vector2d& error, const SightingJacobian& jacobian, double information) {
                    unknowns.Add(jacobian, at.params.data(), error, information, &equations.H,
                                 &equations.g);
                  });
  unknowns.AddPriors(at, at, &equations.H, &equations.g);
  // Rotations, lengths and intrinsics have different units: the condition is that of the unknowns
  // in units of their own certainty.
  Step scale = Step::Zero(unknowns.size());
  for (int k = 0; k < unknowns.size(); ++k) {
    if (!(equations.H(k, k) > 0.0)) return std::nullopt;
    scale[k] = 1.0 / std::sqrt(equations.H(k, k));
  }
  const Normal scaled = scale.asDiagonal() * equations.H * scale.asDiagonal();
  const Eigen::LDLT<Normal> factor(scaled);
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > 1e-12))
    return std::nullopt;
  const Normal inverse = factor.solve(Normal::Identity(unknowns.size(), unknowns.size()));
  const Normal covariance = scale.asDiagonal() * inverse * scale.asDiagonal();
  if (!covariance.allFinite()) return std::nullopt;
  const Matrix6d of_pose = covariance.topLeftCorner<6, 6>();
  return Matrix6d(0.5 * (of_pose + of_pose.transpose()));
}

bool FitFew(const PoseEvidence& evidence, const FewSightings& few, const ForEachKind<double>& noise,
            bool free_focal_length, int max_iterations, PoseUnknowns* at) {
  FreeIntrinsics free;
  free.focal_length = free_focal_length;
  const Unknowns unknowns(*evidence.camera().model, free);
  const AbsolutePoseMatches& matches = evidence.matches();
  // The cost, or a negative number where a sighting has no error.
  const auto evaluate = [&](const PoseUnknowns& u, NormalEquations* equations) {
    equations->H = Normal::Zero(unknowns.size(), unknowns.size());
    equations->g = Step::Zero(unknowns.size());
    const PosedCamera view(evidence.camera().model, u.params.data(), u.cam_from_world);
    double cost = 0.0;
    Vector2d error;
    SightingJacobian jacobian;
    const auto add = [&](bool exists, double information) {
      if (!exists) return false;
      cost += information * error.squaredNorm();
      unknowns.Add(jacobian, u.params.data(), error, information, &equations->H, &equations->g);
      return true;
    };
    for (uint32_t i : few.points) {
      if (!add(ErrorOf(view, matches.points[i], &error, &jacobian), InverseSquare(noise.points)))
        return -1.0;
    }
    for (uint32_t i : few.lines) {
      if (!add(ErrorOf(view, matches.lines[i], &error, &jacobian), InverseSquare(noise.lines)))
        return -1.0;
    }
    return std::isfinite(cost) ? cost : -1.0;
  };
  NormalEquations equations;
  double cost = evaluate(*at, &equations);
  if (cost < 0.0) return false;
  double damping = 1e-6;
  for (int iteration = 0; iteration < max_iterations && cost > 1e-12; ++iteration) {
    Step step;
    if (!SolveDamped(equations, damping, &step)) break;
    const PoseUnknowns trial = unknowns.Moved(*at, step);
    NormalEquations at_trial;
    const double trial_cost = evaluate(trial, &at_trial);
    if (trial_cost >= 0.0 && trial_cost < cost) {
      *at = trial;
      cost = trial_cost;
      equations = std::move(at_trial);
      damping *= 0.1;
    } else {
      damping = damping * 100.0;
      if (damping > 1.0) break;
    }
  }
  return true;
}

}  // namespace holba
