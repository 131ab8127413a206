// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/point_graph.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/random.h"
#include "holba/geometry/angle.h"
#include "holba/synthetic/random_streams.h"
#include "holba/synthetic/synthetic_cameras.h"

namespace holba {
namespace {

// Independent streams, so that an option of one does not change what the others draw.
enum class GraphStream : uint64_t {
  kCameras = 101,
  kPoints,
  kPixels,
  kPoses,
  kStart,
  kFocalLengths
};

struct View {
  Rigid3d cam_from_world;
  Eigen::Vector3d centre;
  Camera camera;

  bool Sees(const Eigen::Vector3d& X, Eigen::Vector2d* pixel) const {
    constexpr double kMinDepth = 3.0;  // far enough for the start's noise
    const Eigen::Vector3d in_cam = cam_from_world * X;
    return in_cam.z() > kMinDepth && camera.model->project(camera.params.data(), in_cam, pixel) &&
           pixel->minCoeff() > 0 && pixel->maxCoeff() < kSyntheticImageSizePx;
  }
};

struct Seen {
  uint32_t image;
  Eigen::Vector2d pixel;
};

// A world with its views; draws points one by one.
class PointSource {
 public:
  virtual ~PointSource() = default;
  // Tries to make the k-th point. False: fewer than two views see it, or all in one direction.
  virtual bool Draw(size_t k, Random* random, Eigen::Vector3d* X, std::vector<Seen>* track) = 0;

  const std::vector<View>& views() const { return views_; }

 protected:
  void AddView(const Rigid3d& cam_from_world, const Camera& camera) {
    views_.push_back({cam_from_world, cam_from_world.OriginInA(), camera});
  }
  // As mappers ask of a new point: rays that differ by 1.5 degrees.
  bool HasParallax(const Eigen::Vector3d& X, const std::vector<Seen>& track) const {
    constexpr double kMinAngleRad = DegToRad(1.5);
    const Eigen::Vector3d first = (X - views_[track.front().image].centre).normalized();
    return std::any_of(track.begin(), track.end(), [&](const Seen& seen) {
      return first.cross((X - views_[seen.image].centre).normalized()).norm() > kMinAngleRad;
    });
  }

  std::vector<View> views_;
};

class Street final : public PointSource {
 public:
  Street(int num_images, const std::vector<Camera>& cameras, Random* random) {
    constexpr double kStep = 1.2, kBendLength = 300.0, kBend = 0.6;
    Eigen::Vector3d centre(0.0, 0.0, 1.7);
    for (int i = 0; i < num_images; ++i) {
      const double heading = kBend * std::sin(2.0 * std::numbers::pi * kStep * i / kBendLength);
      const Eigen::Vector3d ahead(std::cos(heading), std::sin(heading), 0.0);
      centre += kStep * ahead;
      const Eigen::Vector3d shake = NormalVector(0.05, random);
      const Eigen::Vector3d target = centre + 10.0 * ahead + NormalVector(0.3, random);
      AddView(LookAt(centre + shake, target, random->Uniform(-0.05, 0.05)),
              cameras[i % cameras.size()]);
      ahead_.push_back(ahead);
    }
  }

  bool Draw(size_t k, Random* random, Eigen::Vector3d* X, std::vector<Seen>* track) override {
    constexpr double kMeanFurther = 6.0, kMissing = 0.1;
    const size_t first = k % views_.size();
    const double side = random->Uniform() < 0.5 ? -1.0 : 1.0;
    const double across = random->Uniform(5.0, 12.0);
    const double along = random->Uniform(1.6 * across, 40.0);
    const Eigen::Vector3d& ahead = ahead_[first];
    *X = views_[first].centre + along * ahead +
         side * across * Eigen::Vector3d(-ahead.y(), ahead.x(), 0.0) +
         Eigen::Vector3d(0, 0, random->Uniform(-1.5, 8.0));
    // Geometrically distributed beyond 2, from the first view on until it leaves the image.
    const double u = 1.0 - random->Uniform();
    const size_t length = 2 + static_cast<size_t>(std::log(u) / std::log(1.0 - 1.0 / kMeanFurther));
    track->clear();
    for (size_t i = first; i < std::min(first + length, views_.size()); ++i) {
      Eigen::Vector2d pixel;
      if (!views_[i].Sees(*X, &pixel)) break;
      if (random->Uniform() < kMissing) continue;
      track->push_back({static_cast<uint32_t>(i), pixel});
    }
    return track->size() >= 2 && HasParallax(*X, *track);
  }

 private:
  std::vector<Eigen::Vector3d> ahead_;  // direction of the street at each view
};

class Landmark final : public PointSource {
 public:
  Landmark(int num_images, const std::vector<Camera>& cameras, Random* random)
      : width_(30.0 * std::sqrt(num_images / 50.0)) {
    struct Spot {
      Eigen::Vector3d centre;
      double popularity;
    };
    std::vector<Spot> spots;
    std::vector<double> popularity;
    const int num_spots = std::max(3, num_images / 20);
    for (int s = 0; s < num_spots; ++s) {
      const double x = random->Uniform(-0.5, 0.5) * width_;
      const double y = random->Uniform(-40.0, -15.0);
      spots.push_back({{x, y, 1.7}, PowerLaw(1.5, 20.0, random)});
      popularity.push_back(spots.back().popularity);
    }
    Accumulate(&popularity);
    for (int i = 0; i < num_images; ++i) {
      const Eigen::Vector3d& spot = spots[Pick(popularity, random)].centre;
      const Eigen::Vector3d centre(spot.x() + random->Normal(3.0),
                                   std::min(spot.y() + random->Normal(2.0), -12.0),
                                   spot.z() + random->Uniform(0.0, 1.0));
      const Eigen::Vector3d target(0.9 * spot.x() + random->Normal(5.0), 0.0,
                                   random->Uniform(5.0, 12.0));
      AddView(LookAt(centre, target, random->Uniform(-0.1, 0.1)), cameras[i % cameras.size()]);
      image_popularity_.push_back(PowerLaw(1.5, 20.0, random));
    }
    Accumulate(&image_popularity_);
    has_.assign(num_images, false);
  }

  bool Draw(size_t, Random* random, Eigen::Vector3d* X, std::vector<Seen>* track) override {
    *X << random->Uniform(-0.5, 0.5) * width_, random->Uniform(-2.0, 2.0),
        random->Uniform(0.0, 20.0);
    const size_t longest = std::max<size_t>(2, views_.size() / 2);
    const auto length =
        static_cast<size_t>(2.0 * PowerLaw(1.5, 0.5 * static_cast<double>(longest), random));
    track->clear();
    for (size_t tries = 0; tries < 20 * length && track->size() < length; ++tries) {
      const size_t i = Pick(image_popularity_, random);
      Eigen::Vector2d pixel;
      if (has_[i] || !views_[i].Sees(*X, &pixel)) continue;
      has_[i] = true;
      track->push_back({static_cast<uint32_t>(i), pixel});
    }
    for (const Seen& seen : *track) has_[seen.image] = false;
    std::sort(track->begin(), track->end(),
              [](const Seen& a, const Seen& b) { return a.image < b.image; });
    return track->size() >= 2 && HasParallax(*X, *track);
  }

 private:
  static void Accumulate(std::vector<double>* weights) {
    for (size_t i = 1; i < weights->size(); ++i) (*weights)[i] += (*weights)[i - 1];
  }
  static size_t Pick(const std::vector<double>& sums, Random* random) {
    const double at = random->Uniform(0.0, sums.back());
    const size_t i = std::upper_bound(sums.begin(), sums.end(), at) - sums.begin();
    return std::min(i, sums.size() - 1);
  }

  double width_;
  std::vector<double> image_popularity_;  // running sums
  std::vector<bool> has_;                 // by view, for the track in the making
};

std::vector<Camera> MakeCameras(const PointGraphOptions& options) {
  std::vector<Camera> cameras(options.camera_per_image ? options.num_images : 1,
                              MakeSyntheticCamera(options.camera_model));
  if (!options.camera_per_image) return cameras;
  Random random = StreamOf(options.seed, GraphStream::kFocalLengths);
  for (Camera& camera : cameras) {
    const double factor = std::exp(random.Normal(0.1));
    for (const int i : camera.model->focal_idxs) camera.params[i] *= factor;
  }
  return cameras;
}

Reconstruction Assemble(const PointGraphOptions& options, PointSource* source) {
  const std::vector<View>& views = source->views();
  const auto wanted =
      static_cast<size_t>(options.observations_per_image * static_cast<double>(options.num_images));
  Random point_random = StreamOf(options.seed, GraphStream::kPoints);
  Random pixel_random = StreamOf(options.seed, GraphStream::kPixels);
  std::vector<Image> images(views.size());
  std::vector<Point3D> points;
  std::vector<Seen> track;
  size_t num_observations = 0;
  for (size_t k = 0; num_observations < wanted; ++k) {
    HOLBA_CHECK_MSG(k < 100 * wanted, "the views see no points");
    Point3D point;
    if (!source->Draw(k, &point_random, &point.xyz, &track)) continue;
    point.rgb = {150, 150, 150};
    point.track.reserve(track.size());
    for (const Seen& seen : track) {
      std::vector<Point2D>& points2D = images[seen.image].points2D;
      point.track.push_back({seen.image + 1, static_cast<point2D_t>(points2D.size())});
      const double dx = pixel_random.Normal(options.observation_noise_px);
      const double dy = pixel_random.Normal(options.observation_noise_px);
      points2D.push_back({{seen.pixel.x() + dx, seen.pixel.y() + dy}, points.size() + 1});
    }
    num_observations += track.size();
    points.push_back(std::move(point));
  }
  Reconstruction model;
  for (size_t i = 0; i < views.size(); ++i) {
    const auto id = static_cast<image_t>(i + 1);
    const camera_t camera_id = options.camera_per_image ? id : 1;
    if (!model.cameras.contains(camera_id)) model.cameras.Add(camera_id, views[i].camera);
    images[i].name = fmt::format("image{:06}.png", id);
    images[i].camera_id = camera_id;
    images[i].cam_from_world = views[i].cam_from_world;
    model.images.Add(id, std::move(images[i]));
  }
  model.points3D.Reserve(points.size());
  for (size_t p = 0; p < points.size(); ++p) model.points3D.Add(p + 1, std::move(points[p]));
  model.AddTrivialRigsAndFrames();
  return model;
}

void Perturb(const PointGraphOptions& options, Reconstruction* model) {
  Random pose_random = StreamOf(options.seed, GraphStream::kPoses);
  Random start_random = StreamOf(options.seed, GraphStream::kStart);
  const double rotation_noise_rad = DegToRad(options.rotation_noise_deg);
  std::vector<frame_t> frame_ids;
  for (const auto& [frame_id, frame] : model->frames) frame_ids.push_back(frame_id);
  for (const frame_t frame_id : frame_ids) {
    const Rigid3d& pose = model->frames.at(frame_id).rig_from_world;
    const Eigen::Vector3d centre =
        pose.OriginInA() + NormalVector(options.centre_noise, &pose_random);
    const Eigen::Quaterniond q =
        (ExpRotation(NormalVector(rotation_noise_rad, &pose_random)) * pose.rotation).normalized();
    model->SetFramePose(frame_id, {q, -(q * centre)});
  }
  for (auto& [id, point] : model->points3D) {
    point.xyz += NormalVector(options.point_noise, &start_random);
  }
  if (!options.camera_per_image) return;
  for (auto& [id, camera] : model->cameras) {
    const double factor = std::exp(start_random.Normal(options.focal_length_noise));
    for (const int i : camera.model->focal_idxs) camera.params[i] *= factor;
  }
}

}  // namespace

SyntheticProblem MakePointGraph(const PointGraphOptions& options) {
  if (options.num_images < 4) throw InputError("--num_images must be at least 4");
  if (!(options.observations_per_image >= 20)) {
    throw InputError("--observations_per_image must be at least 20");
  }
  const std::vector<Camera> cameras = MakeCameras(options);
  Random camera_random = StreamOf(options.seed, GraphStream::kCameras);
  std::unique_ptr<PointSource> source;
  if (options.kind == PointGraphKind::kSequence) {
    source = std::make_unique<Street>(options.num_images, cameras, &camera_random);
  } else {
    source = std::make_unique<Landmark>(options.num_images, cameras, &camera_random);
  }
  SyntheticProblem problem;
  problem.truth = Assemble(options, source.get());
  problem.perturbed = problem.truth;
  Perturb(options, &problem.perturbed);
  return problem;
}

}  // namespace holba
