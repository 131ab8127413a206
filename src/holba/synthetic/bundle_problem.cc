// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/bundle_problem.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/random.h"
#include "holba/geometry/angle.h"
#include "holba/synthetic/group_start.h"
#include "holba/synthetic/random_streams.h"
#include "holba/synthetic/synthetic_associations.h"
#include "holba/synthetic/synthetic_cameras.h"
#include "holba/synthetic/synthetic_model.h"
#include "holba/synthetic/synthetic_structure.h"
#include "holba/synthetic/synthetic_tracks.h"

namespace holba {
namespace {

constexpr int kImagesOfPlane = 5;

// Independent streams, so that an option of one does not change what the others draw.
enum class BundleStream : uint64_t {
  kCameras = 1,
  kStructure,
  kTracks,
  kPixels,
  kPoses,
  kFeatures,
  kAssociations,
  kGroups,
  kPrimitives
};

void Check(const BundleProblemOptions& options) {
  if (options.num_images < 10) throw InputError("--num_images must be at least 10");
  if (options.rig_size < 1 || options.num_images % options.rig_size != 0) {
    throw InputError("--rig_size must divide --num_images");
  }
  if (options.layout == SceneLayout::kCorridor && options.num_images / options.rig_size < 30) {
    throw InputError("--num_images must give at least 30 frames in a corridor");
  }
  if (!(options.fraction_wrong_associations >= 0 && options.fraction_wrong_associations <= 0.9)) {
    throw InputError("--fraction_wrong_associations must be between 0 and 0.9");
  }
}

SyntheticStructure MakeStructure(const BundleProblemOptions& options, size_t num_frames) {
  Random random = StreamOf(options.seed, BundleStream::kStructure);
  Random primitive_random = StreamOf(options.seed, BundleStream::kPrimitives);
  const auto region_from = [&](Random* r) {
    if (options.layout == SceneLayout::kSphere) {
      return SyntheticRegion{Eigen::Vector3d::Zero(), Eigen::Vector3d::Constant(kCubeHalfExtent)};
    }
    // Along the corridor each region is seen whole by at least 10 frames.
    constexpr double kHalfLength = 1.0;
    const double last = kCorridorSpacing * static_cast<double>(num_frames - 1);
    const double low = kCorridorMinDepth + 10 * kCorridorSpacing + kHalfLength;
    const double high = last + kCorridorMaxDepth - 10 * kCorridorSpacing - kHalfLength;
    return SyntheticRegion{Eigen::Vector3d(r->Uniform(low, high), 0, 0),
                           Eigen::Vector3d(kHalfLength, 2.0, 1.5), true};
  };
  SyntheticStructure structure;
  for (int k = 0; k < options.num_images / kImagesOfPlane; ++k) {
    AddPlaneWithSurroundings(region_from(&random), &random, &structure);
  }
  for (int k = 0; k < options.num_images % kImagesOfPlane; ++k) {
    AddFloatingFeatures(region_from(&random), &random, &structure);
  }
  if (options.vps) AddVanishingPoints(&structure);
  for (int k = 0; k < options.primitives; ++k) {
    for (const GroupType* type : PrimitiveTypes()) {
      AddPrimitive(*type, region_from(&primitive_random), &primitive_random, &structure);
    }
  }
  return structure;
}

// Cameras, rigs, frames and images without features.
Reconstruction MakeImages(const SyntheticCameras& cameras) {
  Reconstruction model;
  const size_t rig_size = cameras.sensor_from_rig.size();
  const auto sensor_id = [](size_t sensor) {
    return SensorId{SensorType::kCamera, static_cast<uint32_t>(sensor + 1)};
  };
  Rig rig;
  rig.ref_sensor = sensor_id(0);
  for (size_t s = 0; s < rig_size; ++s) {
    model.cameras.Add(static_cast<camera_t>(s + 1), cameras.camera);
    if (s > 0) rig.sensors.push_back({sensor_id(s), cameras.sensor_from_rig[s]});
  }
  model.rigs.Add(1, std::move(rig));
  model.has_rig_files = rig_size > 1;
  image_t image_id = 0;
  for (size_t f = 0; f < cameras.rig_from_world.size(); ++f) {
    const frame_t frame_id = static_cast<frame_t>(f + 1);
    Frame frame;
    frame.rig_id = 1;
    frame.rig_from_world = cameras.rig_from_world[f];
    for (size_t s = 0; s < rig_size; ++s) {
      frame.data.push_back({sensor_id(s), ++image_id});
      Image image;
      image.name = rig_size > 1 ? fmt::format("camera{}/image{:06}.png", s + 1, f + 1)
                                : fmt::format("image{:06}.png", f + 1);
      image.camera_id = static_cast<camera_t>(s + 1);
      image.frame_id = frame_id;
      image.cam_from_world = cameras.cam_from_world[image_id - 1];
      model.images.Add(image_id, std::move(image));
    }
    model.frames.Add(frame_id, std::move(frame));
  }
  return model;
}

image_t ImageIdOf(size_t k) { return static_cast<image_t>(k + 1); }

// Points and lines with their tracks and noisy observations.
void AddFeatures(const SyntheticStructure& structure, const SyntheticTracks& tracks,
                 const SyntheticCameras& cameras, double noise_px, Random* random,
                 Reconstruction* model) {
  const auto observe = [&](uint32_t image, const Eigen::Vector3d& X) {
    const auto pixel = cameras.Project(image, X);
    HOLBA_CHECK(pixel);
    const double dx = random->Normal(noise_px), dy = random->Normal(noise_px);
    return Eigen::Vector2d(pixel->x() + dx, pixel->y() + dy);
  };
  constexpr std::array<uint8_t, 3> kFloating{150, 150, 150}, kOnGroup{90, 140, 200};
  std::vector<bool> is_member(structure.points.size());
  for (const SyntheticGroup& group : structure.groups) {
    for (const uint32_t point : group.points) is_member[point] = true;
  }
  model->points3D.Reserve(structure.points.size());
  for (size_t p = 0; p < structure.points.size(); ++p) {
    Point3D point;
    point.xyz = structure.points[p];
    point.rgb = is_member[p] ? kOnGroup : kFloating;
    for (const uint32_t i : tracks.points[p]) {
      auto& points2D = model->images.at(ImageIdOf(i)).points2D;
      point.track.push_back({ImageIdOf(i), static_cast<point2D_t>(points2D.size())});
      points2D.push_back({observe(i, point.xyz), SyntheticIdOf(p)});
    }
    model->points3D.Add(SyntheticIdOf(p), std::move(point));
  }
  model->lines3D.Reserve(structure.segments.size());
  for (size_t l = 0; l < structure.segments.size(); ++l) {
    Line3D line = MakeSyntheticLine(structure.segments[l]);
    line.rgb = structure.plane_of_line[l] >= 0 ? kOnGroup : kFloating;
    for (const uint32_t i : tracks.lines[l]) {
      auto& lines2D = model->images.at(ImageIdOf(i)).lines2D;
      line.track.push_back({ImageIdOf(i), static_cast<line2D_t>(lines2D.size())});
      const Eigen::Vector2d start = observe(i, line.start);
      lines2D.push_back({{start, observe(i, line.end)}, SyntheticIdOf(l)});
    }
    model->lines3D.Add(SyntheticIdOf(l), std::move(line));
  }
}

void PerturbPoses(const BundleProblemOptions& options, Reconstruction* model) {
  Random random = StreamOf(options.seed, BundleStream::kPoses);
  const double rotation_noise_rad = DegToRad(options.rotation_noise_deg);
  std::vector<frame_t> frame_ids;
  for (const auto& [frame_id, frame] : model->frames) frame_ids.push_back(frame_id);
  for (const frame_t frame_id : frame_ids) {
    Rigid3d pose = model->frames.at(frame_id).rig_from_world;
    pose.rotation =
        (ExpRotation(NormalVector(rotation_noise_rad, &random)) * pose.rotation).normalized();
    pose.translation += NormalVector(options.translation_noise, &random);
    model->SetFramePose(frame_id, pose);
  }
}

// Groups as they would be found from the noisy features, never from the truth.
void FitGroups(const BundleProblemOptions& options, SyntheticStructure* structure) {
  Random random = StreamOf(options.seed, BundleStream::kGroups);
  const double max_distance = std::max(3.0 * options.feature_noise, 1e-6);
  constexpr double kMaxSine = 0.2;
  for (SyntheticGroup& group : structure->groups) {
    std::vector<Eigen::Vector3d> points;
    std::vector<PlueckerLine> lines;
    for (const uint32_t p : group.points) points.push_back(structure->points[p]);
    for (const uint32_t l : group.lines) {
      const Segment3d& segment = structure->segments[l];
      lines.push_back(PlueckerLine::FromPoints(segment[0], segment[1]));
      points.insert(points.end(), segment.begin(), segment.end());
    }
    const double max_error = group.type->IsParallelism() ? kMaxSine : max_distance;
    if (auto params = GroupStart(*group.type, points, lines, max_error, &random)) {
      group.params = std::move(*params);
      continue;
    }
    // Where noise leaves no valid minimal sample (a hyperboloid instead of an ellipsoid), the start
    // is the true group moved by as much as the features.
    Sim3d moved;
    moved.rotation = ExpRotation(NormalVector(0.1 * options.feature_noise, &random));
    moved.translation = NormalVector(options.feature_noise, &random);
    std::array<double, kMaxGroupParams> g{}, transformed{};
    HOLBA_CHECK(group.type->from_file(group.params.data(), g.data()));
    group.type->transform(moved, g.data(), transformed.data());
    group.type->to_file(transformed.data(), group.params.data());
  }
}

}  // namespace

void BundleProblemOptions::Describe(OptionTable* table) const {
  table->Field("seed", &seed, AnyValue(), "Same seed and options, same problem.");
  table->Field(
      "num_images", &num_images, Between(10, 100000),
      "Images N (10 N points, N lines, N/5 planes and 3 N wireframe edges come with them).");
  table->Choice("layout", &layout,
                {{"sphere", SceneLayout::kSphere}, {"corridor", SceneLayout::kCorridor}},
                "Where the cameras are (on a sphere around a cube, or in a row along a corridor).");
  table->Choice("visibility", &visibility,
                {{"random", Visibility::kRandom},
                 {"near", Visibility::kNear},
                 {"cluster", Visibility::kCluster}},
                "Which 4 to 8 cameras see a feature (any; ones next to each other along their "
                "walk; the nearest in space).");
  table->Field("observation_noise_px", &observation_noise_px, AtLeast(0),
               "Standard deviation of point and line end observations, per coordinate.");
  table
      ->Field("rotation_noise_deg", &rotation_noise_deg, AtLeast(0),
              "Standard deviation of the start's rotations, per axis.")
      .Advanced();
  table
      ->Field("translation_noise", &translation_noise, AtLeast(0),
              "Standard deviation of the start's translations, per coordinate.")
      .Advanced();
  table
      ->Field("feature_noise", &feature_noise, AtLeast(0),
              "Standard deviation of the start's 3D points and line ends, per coordinate.")
      .Advanced();
  table->Field("fraction_wrong_associations", &fraction_wrong_associations, Between(0, 0.9),
               "Share of wrong group members and wireframe edges.");
  table
      ->Choice("wrong_associations", &wrong_associations,
               {{"random", WrongAssociations::kRandom}, {"nearest", WrongAssociations::kNearest}},
               "Whether a wrong association is to any feature or to the nearest wrong one.")
      .Advanced();
  table->Field("vps", &vps, "Add vanishing points of the grid lines, and relations.");
  table->Field("primitives", &primitives, Between(0, 1000),
               "Spheres to add, and as many of every other type, with 60 points each.");
  table->Field("camera_model", &camera_model, "COLMAP's name of the camera model.").Advanced();
  table
      ->Field("rig_size", &rig_size, Between(1, 100),
              "Cameras in one rig with known sensor poses; 1: no rig.")
      .Advanced();
}

SyntheticProblem MakeBundleProblem(const BundleProblemOptions& options) {
  Check(options);
  Random camera_random = StreamOf(options.seed, BundleStream::kCameras);
  const Camera camera = MakeSyntheticCamera(options.camera_model);
  const auto make_cameras =
      options.layout == SceneLayout::kSphere ? &MakeCamerasOnSphere : &MakeCamerasInCorridor;
  const SyntheticCameras cameras =
      make_cameras(options.num_images, options.rig_size, camera, &camera_random);
  const SyntheticStructure structure = MakeStructure(options, cameras.rig_from_world.size());
  Random track_random = StreamOf(options.seed, BundleStream::kTracks);
  const SyntheticTracks tracks =
      MakeTracks(cameras, structure, options.layout, options.visibility, &track_random);

  SyntheticProblem problem;
  Random pixel_random = StreamOf(options.seed, BundleStream::kPixels);
  problem.truth = MakeImages(cameras);
  AddFeatures(structure, tracks, cameras, options.observation_noise_px, &pixel_random,
              &problem.truth);

  SyntheticStructure noisy = structure;
  Random feature_random = StreamOf(options.seed, BundleStream::kFeatures);
  for (Eigen::Vector3d& X : noisy.points) X += NormalVector(options.feature_noise, &feature_random);
  for (Segment3d& segment : noisy.segments) {
    for (Eigen::Vector3d& X : segment) X += NormalVector(options.feature_noise, &feature_random);
  }
  Random association_random = StreamOf(options.seed, BundleStream::kAssociations);
  ReplaceAssociations(options.fraction_wrong_associations, options.wrong_associations,
                      &association_random, &noisy);
  FitGroups(options, &noisy);

  problem.perturbed = problem.truth;
  PerturbPoses(options, &problem.perturbed);
  for (auto& [id, point] : problem.perturbed.points3D) point.xyz = noisy.points[id - 1];
  for (auto& [id, line] : problem.perturbed.lines3D) {
    Line3D moved = MakeSyntheticLine(noisy.segments[id - 1]);
    line.line = moved.line;
    line.start = moved.start;
    line.end = moved.end;
  }
  AddAssociations(structure, &problem.truth);
  AddAssociations(noisy, &problem.perturbed);
  return problem;
}

}  // namespace holba
