// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/pose/minimal_poses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "holba/base/check.h"
#include "holba/estimation/pose/linear_pose.h"
#include "holba/estimation/pose/p3p.h"

namespace holba {
namespace {

// Rungs of the ladder: from 0.2 to 5 in steps of a fifth. A pose moves smoothly between two of
// them.
constexpr int kNumRungs = 17;
constexpr size_t kMaxStarts = 4;
constexpr int kFitIterations = 8;
constexpr int kNumHalvings = 30;
// Two directions whose angle changes by less over the whole ladder (its cosine) say nothing of the
// focal length.
constexpr double kMinCosineChange = 0.02;
// The angle of two directions was made equal, up to rounding.
constexpr double kEqualAngles = 1e-3;
const ForEachKind<double> kPixels{1.0, 1.0, 1.0};

std::vector<double> WithFocalLengthRatio(const Camera& camera, double ratio) {
  std::vector<double> params = camera.params;
  const double factor = ratio / FocalLengthRatio(camera, params);
  for (int idx : camera.model->focal_idxs) params[idx] *= factor;
  return params;
}

double RatioOfRung(const FocalLengthRange& range, double rung) {
  return range.min_ratio * std::pow(range.max_ratio / range.min_ratio, rung / (kNumRungs - 1));
}

struct Seen {
  std::vector<SeenPoint> points;
  std::vector<SeenLine> lines;
};

// Empty: one of them has no ray or no plane.
std::optional<Seen> See(const PoseEvidence& evidence, std::span<const double> params,
                        const FewSightings& few) {
  const CameraModel& model = *evidence.camera().model;
  Seen seen;
  for (uint32_t i : few.points) {
    const PointSighting& point = evidence.matches().points[i];
    const auto ray = model.unproject(params.data(), point.pixel);
    if (!ray) return std::nullopt;
    seen.points.push_back({*ray, point.X});
  }
  const IdealCalibration k = model.ideal_calibration(params.data());
  for (uint32_t i : few.lines) {
    const LineSighting& line = evidence.matches().lines[i];
    const auto start = IdealPixel(model, params.data(), line.segment.start);
    const auto end = IdealPixel(model, params.data(), line.segment.end);
    if (!start || !end) return std::nullopt;
    const auto ray = [&](const Eigen::Vector2d& x) {
      return Eigen::Vector3d((x.x() - k.cx) / k.fx, (x.y() - k.cy) / k.fy, 1.0);
    };
    const Eigen::Vector3d normal = ray(*start).cross(ray(*end));
    if (!(normal.norm() > 0.0)) return std::nullopt;
    seen.lines.push_back({normal.normalized(), line.line});
  }
  return seen;
}

}  // namespace

double FocalLengthRatio(const Camera& camera, std::span<const double> params) {
  double sum = 0.0;
  for (int idx : camera.model->focal_idxs) sum += params[idx];
  const double count = static_cast<double>(camera.model->focal_idxs.size());
  return sum / count / static_cast<double>(std::max<uint64_t>({camera.width, camera.height, 1}));
}

void SolveThree(const PoseEvidence& evidence, std::span<const double> params,
                const FewSightings& three, const Eigen::Quaterniond& turn,
                std::vector<Rigid3d>* poses) {
  HOLBA_CHECK(three.points.size() + three.lines.size() == 3);
  const auto seen = See(evidence, params, three);
  if (!seen) return;
  if (!seen->lines.empty()) return SolvePointsAndLines(seen->points, seen->lines, turn, poses);
  const std::vector<SeenPoint>& p = seen->points;
  SolveP3P({p[0].ray, p[1].ray, p[2].ray}, {p[0].X, p[1].X, p[2].X}, poses);
}

void SolveWithFocalLength(const PoseEvidence& evidence, const FewSightings& four,
                          const FocalLengthRange& range, const Eigen::Quaterniond& turn,
                          std::vector<PoseUnknowns>* hypotheses) {
  const Camera& camera = evidence.camera();
  const AbsolutePoseMatches& matches = evidence.matches();
  // The points that there are stay: three of them have the fastest solver.
  FewSightings three = four;
  const bool fourth_is_line = !four.lines.empty();
  (fourth_is_line ? three.lines : three.points).pop_back();
  const auto error_of_fourth = [&](const PosedCamera& view, Eigen::Vector2d* error) {
    return fourth_is_line ? ErrorOf(view, matches.lines[four.lines.back()], error, nullptr)
                          : ErrorOf(view, matches.points[four.points.back()], error, nullptr);
  };

  struct Rung {
    double error2 = std::numeric_limits<double>::infinity();
    PoseUnknowns at;
  };
  std::array<Rung, kNumRungs> ladder;
  std::vector<Rigid3d> poses;
  for (int k = 0; k < kNumRungs; ++k) {
    const std::vector<double> params = WithFocalLengthRatio(camera, RatioOfRung(range, k));
    poses.clear();
    SolveThree(evidence, params, three, turn, &poses);
    for (const Rigid3d& pose : poses) {
      Eigen::Vector2d error;
      const PosedCamera view(camera.model, params.data(), pose);
      if (!error_of_fourth(view, &error)) continue;
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

void SolveWithRotation(const PoseEvidence& evidence, std::span<const double> params,
                       const Eigen::Quaterniond& rotation, const FewSightings& few,
                       std::vector<PoseUnknowns>* hypotheses) {
  const auto seen = See(evidence, params, few);
  if (!seen) return;
  const auto translation = SolveTranslation(rotation, seen->points, seen->lines);
  if (!translation) return;
  hypotheses->push_back({{rotation, *translation}, {params.begin(), params.end()}});
}

void SolveDirectionsWithFocalLength(const PoseEvidence& evidence,
                                    const std::pair<uint32_t, uint32_t>& directions,
                                    const FewSightings& few, const FocalLengthRange& range,
                                    std::vector<PoseUnknowns>* hypotheses) {
  const Camera& camera = evidence.camera();
  const DirectionSighting& a = evidence.matches().directions[directions.first];
  const DirectionSighting& b = evidence.matches().directions[directions.second];
  const auto seen_at = [&](const std::vector<double>& params, const DirectionSighting& sighting) {
    return UnderCalibration(sighting.direction_in_cam, evidence.given_calibration(),
                            camera.model->ideal_calibration(params.data()));
  };
  const auto cosine_at = [&](double rung) {
    const std::vector<double> params = WithFocalLengthRatio(camera, RatioOfRung(range, rung));
    return seen_at(params, a).dot(seen_at(params, b));
  };
  std::array<double, kNumRungs> cosines;
  for (int k = 0; k < kNumRungs; ++k) cosines[k] = cosine_at(k);
  const auto [least, greatest] = std::minmax_element(cosines.begin(), cosines.end());
  if (!(*greatest - *least > kMinCosineChange)) return;
  const double in_world = a.direction_in_world.dot(b.direction_in_world);
  std::vector<Eigen::Quaterniond> rotations;
  // Without signs the angle may be the other one. At right angles both are the same.
  for (double wanted : {in_world, -in_world}) {
    for (int k = 0; k + 1 < kNumRungs; ++k) {
      if ((cosines[k] < wanted) == (cosines[k + 1] < wanted)) continue;
      double low = k, high = k + 1;
      for (int halving = 0; halving < kNumHalvings; ++halving) {
        const double middle = 0.5 * (low + high);
        ((cosine_at(middle) < wanted) == (cosines[k] < wanted) ? low : high) = middle;
      }
      const std::vector<double> params =
          WithFocalLengthRatio(camera, RatioOfRung(range, 0.5 * (low + high)));
      rotations.clear();
      SolveRotation(seen_at(params, a), seen_at(params, b), a.direction_in_world,
                    b.direction_in_world, kEqualAngles, &rotations);
      for (const Eigen::Quaterniond& rotation : rotations)
        SolveWithRotation(evidence, params, rotation, few, hypotheses);
    }
  }
}

}  // namespace holba
