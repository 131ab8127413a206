// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/join_models.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <vector>

#include "holba/geometry/angle.h"
#include "holba/robust/median.h"

namespace holba {
namespace {

constexpr size_t kMinAgreeing = 3;
constexpr double kMinShare = 0.75;
constexpr double kMaxRotationDeg = 2.0;
constexpr double kMaxDistanceRatio = 0.05;

struct SharedCamera {
  Eigen::Quaterniond a_from_b;  // rotation between the worlds, by this image alone
  Eigen::Vector3d in_a, in_b;   // centres
};

}  // namespace

std::optional<ModelAlignment> AlignModels(const Reconstruction& a, const Reconstruction& b) {
  std::vector<SharedCamera> shared;
  for (const auto& [id, image] : a.images) {
    const Image* other = b.images.Find(id);
    if (other == nullptr) continue;
    shared.push_back({image.cam_from_world.rotation.normalized().conjugate() *
                          other->cam_from_world.rotation.normalized(),
                      image.cam_from_world.OriginInA(), other->cam_from_world.OriginInA()});
  }
  if (shared.size() < kMinAgreeing) return std::nullopt;
  std::optional<ModelAlignment> best;
  // Each pair of images gives a similarity: the rotation of the first, the scale of their
  // baselines.
  for (const SharedCamera& first : shared) {
    std::vector<double> scales, distances;
    for (const SharedCamera& second : shared) {
      const double in_a = (first.in_a - second.in_a).norm(),
                   in_b = (first.in_b - second.in_b).norm();
      if (in_a > 0.0 && in_b > 0.0) {
        scales.push_back(in_a / in_b);
        distances.push_back(in_a);
      }
    }
    if (scales.empty()) continue;
    ModelAlignment alignment;
    alignment.num_shared = shared.size();
    alignment.a_from_b.scale = Median(std::move(scales));
    alignment.a_from_b.rotation = first.a_from_b;
    alignment.a_from_b.translation =
        first.in_a - alignment.a_from_b.scale * (first.a_from_b * first.in_b);
    const double max_distance = kMaxDistanceRatio * Median(std::move(distances));
    for (const SharedCamera& camera : shared) {
      alignment.num_agreeing +=
          RadToDeg(camera.a_from_b.angularDistance(first.a_from_b)) < kMaxRotationDeg &&
          (alignment.a_from_b * camera.in_b - camera.in_a).norm() < max_distance;
    }
    if (!best || alignment.num_agreeing > best->num_agreeing) best = alignment;
  }
  if (!best || best->num_agreeing < kMinAgreeing ||
      static_cast<double>(best->num_agreeing) < kMinShare * static_cast<double>(shared.size()))
    return std::nullopt;
  return best;
}

std::optional<size_t> JoinModel(const Reconstruction& other, MapperState* state) {
  const auto alignment = AlignModels(state->model(), other);
  if (!alignment) return std::nullopt;
  std::vector<frame_t> frames;
  for (const auto& [id, frame] : other.frames) {
    if (state->model().unregistered_frames.contains(id)) frames.push_back(id);
  }
  const size_t before = state->model().images.size();
  for (const frame_t id : frames)
    state->RegisterFrame(id, alignment->a_from_b.TransformPose(other.frames.at(id).rig_from_world));
  return state->model().images.size() - before;
}

}  // namespace holba
