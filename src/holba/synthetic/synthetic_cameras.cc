// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/synthetic_cameras.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <sstream>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/geometry/manifold.h"

namespace holba {
namespace {

// Sensors on a small circle around the reference, all looking at the same point of its axis.
std::vector<Rigid3d> MakeSensors(int rig_size) {
  constexpr double kBaseline = 0.6;
  std::vector<Rigid3d> sensors(1);
  for (int s = 1; s < rig_size; ++s) {
    const double angle = 2.0 * std::numbers::pi * (s - 1) / (rig_size - 1);
    const Eigen::Vector3d centre(kBaseline * std::cos(angle), kBaseline * std::sin(angle), 0.0);
    const Eigen::Quaterniond toe_in = Eigen::Quaterniond::FromTwoVectors(
        Eigen::Vector3d(0, 0, kSphereRadius) - centre, Eigen::Vector3d::UnitZ());
    sensors.emplace_back(toe_in, -(toe_in * centre));
  }
  return sensors;
}

SyntheticCameras Assemble(const Camera& camera, int rig_size, std::vector<Rigid3d> frames) {
  SyntheticCameras cameras;
  cameras.camera = camera;
  cameras.sensor_from_rig = MakeSensors(rig_size);
  cameras.rig_from_world = std::move(frames);
  for (const Rigid3d& frame : cameras.rig_from_world) {
    for (const Rigid3d& sensor : cameras.sensor_from_rig) {
      cameras.cam_from_world.push_back(sensor * frame);
    }
  }
  return cameras;
}

}  // namespace

Rigid3d LookAt(const Eigen::Vector3d& centre, const Eigen::Vector3d& target, double roll_rad) {
  const Eigen::Vector3d z = (target - centre).normalized();
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(z);
  Eigen::Matrix3d R;
  R.row(0) = std::cos(roll_rad) * basis.col(0) + std::sin(roll_rad) * basis.col(1);
  R.row(2) = z;
  R.row(1) = z.cross(Eigen::Vector3d(R.row(0)));
  const Eigen::Quaterniond q = Eigen::Quaterniond(R).normalized();
  return {q, -(q * centre)};
}

Camera MakeSyntheticCamera(const std::string& model_name) {
  Camera camera;
  camera.model = FindCameraModel(model_name);
  if (camera.model == nullptr) {
    std::string known;
    for (const CameraModel* model : AllCameraModels()) {
      known += (known.empty() ? "" : ", ") + std::string(model->name);
    }
    throw InputError("--camera_model: unknown model '" + model_name + "'; use one of " + known);
  }
  camera.width = camera.height = kSyntheticImageSizePx;
  camera.params.assign(camera.model->num_params, 0.001);
  for (const int i : camera.model->focal_idxs) camera.params[i] = kSyntheticFocalLengthPx;
  for (const int i : camera.model->principal_point_idxs) {
    camera.params[i] = 0.5 * kSyntheticImageSizePx;
  }
  // Barrel distortion (negative k) keeps inside the image what a pinhole camera sees.
  const std::map<std::string, double> distortion = {{"k", -0.05},
                                                    {"k1", -0.05},
                                                    {"k2", 0.01},
                                                    {"p1", 0.001},
                                                    {"p2", -0.001},
                                                    {"omega", 0.5},
                                                    {"alpha", 0.5},
                                                    {"beta", 1.0},
                                                    {"w", kSyntheticImageSizePx},
                                                    {"h", kSyntheticImageSizePx}};
  std::istringstream names{std::string(camera.model->param_names)};
  std::string name;
  for (size_t i = 0; names >> name && i < camera.params.size(); ++i) {
    if (const auto it = distortion.find(name); it != distortion.end())
      camera.params[i] = it->second;
  }
  return camera;
}

std::optional<Eigen::Vector2d> SyntheticCameras::Project(size_t image,
                                                         const Eigen::Vector3d& X) const {
  Eigen::Vector2d pixel;
  const Eigen::Vector3d in_cam = cam_from_world[image] * X;
  if (in_cam.z() <= 0 || !camera.model->project(camera.params.data(), in_cam, &pixel)) {
    return std::nullopt;
  }
  const double size = kSyntheticImageSizePx;
  if (!(pixel.minCoeff() > 0) || !(pixel.maxCoeff() < size)) return std::nullopt;
  return pixel;
}

SyntheticCameras MakeCamerasOnSphere(int num_images, int rig_size, const Camera& camera,
                                     Random* random) {
  HOLBA_CHECK(rig_size > 0 && num_images % rig_size == 0);
  const int num_frames = num_images / rig_size;
  const double spacing = std::sqrt(4.0 * std::numbers::pi / num_frames);
  // The targets stay so near the centre that the cube's corners, at most 33 degrees off the axis,
  // remain inside the image, whose sides are at 35.5 degrees.
  constexpr double kTargetJitter = 0.1;
  std::vector<Rigid3d> frames;
  double longitude = 0.0;
  for (int i = 0; i < num_frames; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / num_frames;
    const double ring = std::sqrt(1.0 - z * z);
    // Generalised spiral (Saff and Kuijlaars 1997): steps along it are as long as the distance
    // between its turns.
    if (i > 0) longitude += std::min(0.5 * std::numbers::pi, 3.6 / (ring * std::sqrt(num_frames)));
    const Eigen::Vector3d on_sphere(ring * std::cos(longitude), ring * std::sin(longitude), z);
    const double jitter = 0.2 * spacing;
    const double du = random->Uniform(-jitter, jitter), dv = random->Uniform(-jitter, jitter);
    const Eigen::Vector3d direction =
        (on_sphere + TangentBasis(on_sphere) * Eigen::Vector2d(du, dv)).normalized();
    Eigen::Vector3d target;
    for (double& x : target) x = random->Uniform(-kTargetJitter, kTargetJitter);
    const double roll_rad = random->Uniform(0.0, 2.0 * std::numbers::pi);
    frames.push_back(LookAt(kSphereRadius * direction, target, roll_rad));
  }
  return Assemble(camera, rig_size, std::move(frames));
}

SyntheticCameras MakeCamerasInCorridor(int num_images, int rig_size, const Camera& camera,
                                       Random* random) {
  HOLBA_CHECK(rig_size > 0 && num_images % rig_size == 0);
  std::vector<Rigid3d> frames;
  for (int i = 0; i < num_images / rig_size; ++i) {
    Eigen::Vector3d centre(kCorridorSpacing * i, 0.0, 0.0), target(10.0, 0.0, 0.0);
    for (double& x : centre) x += random->Uniform(-0.1, 0.1);
    for (double& x : target) x += random->Uniform(-0.5, 0.5);
    const double roll_rad = random->Uniform(-0.05, 0.05);
    frames.push_back(LookAt(centre, centre + target, roll_rad));
  }
  return Assemble(camera, rig_size, std::move(frames));
}

std::vector<std::vector<uint32_t>> NearestCameras(std::span<const Rigid3d> cam_from_world,
                                                  size_t count) {
  const size_t n = cam_from_world.size();
  std::vector<Eigen::Vector3d> centres(n);
  for (size_t i = 0; i < n; ++i) centres[i] = cam_from_world[i].OriginInA();
  std::vector<uint32_t> by_z(n);
  std::iota(by_z.begin(), by_z.end(), 0);
  std::sort(by_z.begin(), by_z.end(), [&](uint32_t a, uint32_t b) {
    return std::pair(centres[a].z(), a) < std::pair(centres[b].z(), b);
  });
  std::vector<std::vector<uint32_t>> nearest(n);
  std::vector<std::pair<double, uint32_t>> found;  // sorted by (distance, camera)
  for (size_t k = 0; k < n; ++k) {
    const uint32_t self = by_z[k];
    found.clear();
    // Walks up and down in z until the difference in z alone is larger than the worst one kept.
    size_t low = k, high = k;
    while (low > 0 || high + 1 < n) {
      const double below = low > 0 ? centres[self].z() - centres[by_z[low - 1]].z() : INFINITY;
      const double above =
          high + 1 < n ? centres[by_z[high + 1]].z() - centres[self].z() : INFINITY;
      if (found.size() + 1 >= count &&
          (found.empty() || std::min(below, above) > found.back().first)) {
        break;
      }
      const uint32_t other = below <= above ? by_z[--low] : by_z[++high];
      const std::pair entry((centres[other] - centres[self]).norm(), other);
      found.insert(std::upper_bound(found.begin(), found.end(), entry), entry);
      if (found.size() + 1 > count) found.pop_back();
    }
    nearest[self].push_back(self);
    for (const auto& [distance, other] : found) nearest[self].push_back(other);
  }
  return nearest;
}

}  // namespace holba
