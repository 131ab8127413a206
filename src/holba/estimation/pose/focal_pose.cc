// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/pose/focal_pose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "holba/base/check.h"
#include "holba/estimation/pose/p3p.h"

namespace holba {
namespace {

// Rungs of the ladder: from 0.2 to 5 in steps of a fifth. A pose moves smoothly between two of
// them.
constexpr int kNumRungs = 17;
constexpr size_t kMaxStarts = 4;
constexpr int kFitIterations = 8;
const ForEachKind<double> kPixels{1.0, 1.0, 1.0};

std::vector<double> WithFocalLengthRatio(const Camera& camera, double ratio) {
  std::vector<double> params = camera.params;
  const double factor = ratio / FocalLengthRatio(camera, params);
  for (int idx : camera.model->focal_idxs) params[idx] *= factor;
  return params;
}

}  // namespace

double FocalLengthRatio(const Camera& camera, std::span<const double> params) {
  double sum = 0.0;
  for (int idx : camera.model->focal_idxs) sum += params[idx];
  const double count = static_cast<double>(camera.model->focal_idxs.size());
  return sum / count / static_cast<double>(std::max<uint64_t>({camera.width, camera.height, 1}));
}

void SolveThree(const PoseEvidence& evidence, std::span<const double> params,
                const FewSightings& three, std::vector<Rigid3d>* poses) {
  HOLBA_CHECK(three.points.size() == 3);
  std::array<Eigen::Vector3d, 3> rays, points;
  for (size_t k = 0; k < 3; ++k) {
    const PointSighting& point = evidence.matches().points[three.points[k]];
    const auto ray = evidence.camera().model->unproject(params.data(), point.pixel);
    if (!ray) return;
    rays[k] = *ray;
    points[k] = point.X;
  }
  SolveP3P(rays, points, poses);
}

void SolveWithFocalLength(const PoseEvidence& evidence, const FewSightings& four,
                          const FocalLengthRange& range, std::vector<PoseUnknowns>* hypotheses) {
  const Camera& camera = evidence.camera();
  FewSightings three = four;
  const PointSighting& fourth = evidence.matches().points[three.points.back()];
  three.points.pop_back();

  struct Rung {
    double error2 = std::numeric_limits<double>::infinity();
    PoseUnknowns at;
  };
  std::array<Rung, kNumRungs> ladder;
  std::vector<Rigid3d> poses;
  for (int k = 0; k < kNumRungs; ++k) {
    const double step = static_cast<double>(k) / (kNumRungs - 1);
    const double ratio = range.min_ratio * std::pow(range.max_ratio / range.min_ratio, step);
    const std::vector<double> params = WithFocalLengthRatio(camera, ratio);
    poses.clear();
    SolveThree(evidence, params, three, &poses);
    for (const Rigid3d& pose : poses) {
      Eigen::Vector2d error;
      const PosedCamera view(camera.model, params.data(), pose);
      if (!ErrorOf(view, fourth, &error, nullptr)) continue;
      if (error.squaredNorm() < ladder[k].error2) ladder[k] = {error.squaredNorm(), {pose, params}};
    }
  }

  std::vector<const Rung*> starts;
  for (int k = 0; k < kNumRungs; ++k) {
    if (std::isinf(ladder[k].error2)) continue;
    const bool is_best = (k == 0 || ladder[k].error2 <= ladder[k - 1].error2) &&
                         (k + 1 == kNumRungs || ladder[k].error2 <= ladder[k + 1].error2);
    if (is_best) starts.push_back(&ladder[k]);
  }
  std::stable_sort(starts.begin(), starts.end(),
                   [](const Rung* a, const Rung* b) { return a->error2 < b->error2; });
  if (starts.size() > kMaxStarts) starts.resize(kMaxStarts);
  for (const Rung* start : starts) {
    PoseUnknowns at = start->at;
    if (FitFew(evidence, four, kPixels, true, kFitIterations, &at)) hypotheses->push_back(at);
  }
}

}  // namespace holba
