// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/alignment.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "holba/base/random.h"
#include "holba/scene/track_images.h"

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
  return ImagesOfTrack(point.track, [](const PointObservation&) { return true; }).IsOne();
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

namespace {

// How far off a position is that is left out, in medians of the errors.
constexpr double kFarOff = 10.0;
// Errors below this part of the scene's size are rounding.
constexpr double kRounding = 1e-9;
// Fewer positions than this do not tell which of them is wrong.
constexpr size_t kFewestForRobustness = 5;
constexpr size_t kStartsOfEachKind = 100;
constexpr size_t kBestStarts = 5;
constexpr size_t kMostJudged = 500;  // positions that starts are judged by
constexpr int kMaxSteps = 20;
// A spread below this many medians of the errors leaves the turn about a line to chance.
constexpr double kLeastSpread = 3.0;

// Positions in the model and in the truth; the first are the centres of images.
struct Positions {
  std::vector<Eigen::Vector3d> from, to;
  std::vector<Eigen::Quaterniond> rotations;  // truth_from_model as each image sees it

  Positions Of(const std::vector<size_t>& idxs) const {
    Positions some;
    for (const size_t i : idxs) {
      some.from.push_back(from[i]);
      some.to.push_back(to[i]);
      if (i < rotations.size()) some.rotations.push_back(rotations[i]);
    }
    return some;
  }
};

// Mean rotation of the images; scale and translation of all positions.
Sim3d FitByRotations(const Positions& positions, const Moments& m) {
  Sim3d sim;
  sim.rotation = MeanRotation(positions.rotations);
  if (m.var_from > 0 && m.var_to > 0) sim.scale = std::sqrt(m.var_to / m.var_from);
  sim.translation = m.mean_to - sim.scale * (sim.rotation * m.mean_from);
  return sim;
}

// `least_spread`: of the true positions across their main direction, so that they fix the rotation.
// Empty: nothing does.
std::optional<Sim3d> Fit(const Positions& positions, double least_spread = 0.0) {
  // Cameras in a row are on one line up to their noise, which must not decide the rotation.
  const Moments m = ComputeMoments(positions.from, positions.to);
  const Eigen::Vector3d d = Eigen::JacobiSVD<Eigen::Matrix3d>(m.covariance).singularValues();
  const bool is_wide = [&] {
    if (!(least_spread > 0)) return true;
    Eigen::Matrix3d of_truth = Eigen::Matrix3d::Zero();
    for (const Eigen::Vector3d& X : positions.to)
      of_truth += (X - m.mean_to) * (X - m.mean_to).transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(of_truth, Eigen::EigenvaluesOnly);
    const double n = static_cast<double>(positions.to.size());
    return std::sqrt(std::max(0.0, solver.eigenvalues()[1]) / n) > least_spread;
  }();
  if (positions.from.size() >= 3 && d[1] > 1e-8 * d[0] && is_wide) {
    if (const auto sim = EstimateSimilarity(positions.from, positions.to)) return sim;
  }
  if (positions.rotations.empty()) return std::nullopt;
  return FitByRotations(positions, m);
}

std::vector<double> Errors(const Sim3d& sim, const Positions& positions) {
  std::vector<double> errors;
  errors.reserve(positions.from.size());
  for (size_t i = 0; i < positions.from.size(); ++i)
    errors.push_back((sim * positions.from[i] - positions.to[i]).norm());
  return errors;
}

double MedianOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<size_t> IndicesBelow(const std::vector<double>& errors, double bound) {
  std::vector<size_t> idxs;
  for (size_t i = 0; i < errors.size(); ++i) {
    if (errors[i] <= bound) idxs.push_back(i);
  }
  return idxs;
}

// Similarities that a few positions agree with: three of them, or two images with the rotation of
// one.
std::vector<Sim3d> Starts(const Positions& positions) {
  std::vector<Sim3d> starts;
  Random random(1);
  const size_t num_images = positions.rotations.size();
  for (size_t trial = 0; trial < kStartsOfEachKind; ++trial) {
    std::vector<size_t> idxs;
    for (int k = 0; k < 3; ++k) idxs.push_back(random.Index(positions.from.size()));
    const Positions three = positions.Of(idxs);
    if (const auto sim = EstimateSimilarity(three.from, three.to)) starts.push_back(*sim);
    const std::vector<size_t> images{random.Index(num_images), random.Index(num_images)};
    const Positions two = positions.Of(images);
    if (images[0] != images[1])
      starts.push_back(FitByRotations(two, ComputeMoments(two.from, two.to)));
  }
  return starts;
}

// The fit whose median error is least, of those found. Empty: too few positions.
std::optional<Sim3d> LeastMedianFit(const Positions& positions, const Sim3d& least_squares) {
  const size_t n = positions.from.size();
  if (n < kFewestForRobustness) return std::nullopt;
  std::vector<size_t> judged;
  for (size_t k = 0; k < std::min(n, kMostJudged); ++k)
    judged.push_back(k * n / std::min(n, kMostJudged));
  const Positions some = positions.Of(judged);
  std::vector<std::pair<double, Sim3d>> starts;
  for (const Sim3d& sim : Starts(positions)) starts.emplace_back(MedianOf(Errors(sim, some)), sim);
  std::stable_sort(starts.begin(), starts.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  starts.resize(std::min(starts.size(), kBestStarts));
  starts.emplace_back(0.0, least_squares);

  Sim3d best = least_squares;
  double least = MedianOf(Errors(least_squares, positions));
  for (auto& [ignored, sim] : starts) {
    for (int step = 0; step < kMaxSteps; ++step) {
      const std::vector<double> errors = Errors(sim, positions);
      const double median = MedianOf(errors);
      if (median < least) {
        least = median;
        best = sim;
      } else if (step > 0) {
        break;
      }
      const auto next = Fit(positions.Of(IndicesBelow(errors, median)), kLeastSpread * median);
      if (!next) break;
      sim = *next;
    }
  }
  return best;
}

// The positions that are not far off, in ascending order.
std::vector<size_t> NotFarOff(const Sim3d& sim, const Positions& positions) {
  const std::vector<double> errors = Errors(sim, positions);
  std::vector<double> distances;
  for (const Eigen::Vector3d& X : positions.to) distances.push_back((X - positions.to[0]).norm());
  return IndicesBelow(errors,
                      std::max(kFarOff * MedianOf(errors), kRounding * MedianOf(distances)));
}

}  // namespace

std::optional<Alignment> AlignReconstructions(const Reconstruction& model,
                                              const Reconstruction& truth,
                                              const ImagePairing& pairing, AlignmentBasis basis) {
  Positions positions;
  std::vector<Eigen::Vector3d>&from = positions.from, &to = positions.to;
  for (const auto& [id, image] : truth.images) {
    const auto found = pairing.model_id_of_truth.find(id);
    if (found == pairing.model_id_of_truth.end()) continue;
    const Image& other = model.images.at(found->second);
    from.push_back(other.cam_from_world.OriginInA());
    to.push_back(image.cam_from_world.OriginInA());
    positions.rotations.push_back(image.cam_from_world.rotation.normalized().conjugate() *
                                  other.cam_from_world.rotation.normalized());
  }
  const size_t num_images = from.size();
  if (num_images == 0) return std::nullopt;
  if (basis != AlignmentBasis::kCentres && pairing.features_have_same_ids) {
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
  Alignment alignment;
  alignment.num_positions = from.size();
  alignment.truth_from_model = *Fit(positions);
  std::optional<Sim3d> robust = LeastMedianFit(positions, alignment.truth_from_model);
  if (!robust) return alignment;
  std::vector<size_t> used = NotFarOff(*robust, positions);
  // What is left out depends on the fit, the fit on what is left out.
  for (int step = 0; step < kMaxSteps && used.size() < from.size(); ++step) {
    const auto refined = Fit(positions.Of(used));
    if (!refined) return alignment;  // no image is left that has a rotation
    robust = refined;
    std::vector<size_t> again = NotFarOff(*robust, positions);
    if (again == used) break;
    used = std::move(again);
  }
  if (used.size() == from.size()) return alignment;
  alignment.truth_from_model = *robust;
  alignment.num_left_out = from.size() - used.size();
  return alignment;
}

std::optional<Sim3d> AlignReconstructions(const Reconstruction& model, const Reconstruction& truth,
                                          AlignmentBasis basis) {
  const auto alignment = AlignReconstructions(model, truth, PairImages(model, truth), basis);
  if (!alignment) return std::nullopt;
  return alignment->truth_from_model;
}

}  // namespace holba
