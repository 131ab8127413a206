// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/photo_set.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/random.h"
#include "holba/base/threads.h"
#include "holba/group/known_types.h"
#include "holba/synthetic/photo_pairs.h"
#include "holba/synthetic/photo_structure.h"
#include "holba/synthetic/random_streams.h"
#include "holba/synthetic/synthetic_model.h"

namespace holba {
namespace {

// Independent streams, so that an option of one does not change what the others draw.
enum class PhotoStream : uint64_t { kSightings = 601, kKeypoints, kSegments, kPriors };
Random StreamOfView(uint64_t seed, PhotoStream stream, size_t view) {
  return Random(SeedOfStream(seed, stream) ^ (0x9e3779b97f4a7c15ULL * (view + 1)));
}

constexpr uint32_t kNone = kInvalidId32;

void Check(const PhotoSetOptions& options) {
  if (options.sightings.min_size_px >= options.sightings.max_size_px) {
    throw InputError(
        "--Database.min_size_px: expected a size below --Database.max_size_px, found a larger one");
  }
  if (options.sightings.max_track_length < options.sightings.mean_track_length) {
    throw InputError(
        "--Database.max_track_length: expected at least --Database.mean_track_length, found less");
  }
}

size_t NumInTracks(const SceneViews& sightings) {
  size_t count = 0;
  for (const auto& track : sightings.points) count += track.size() >= 2 ? track.size() : 0;
  return count;
}

// With as many points that the images have the wanted number of keypoints: the number grows
// linearly with the density, but for the corners of windows, which are always there.
PhotoScene MakeDenseScene(const PhotoSetOptions& options) {
  const auto count = [&](double density) {
    PhotoScene scene = MakePhotoScene(options.scene, options.num_images, density, options.seed);
    scene.content.structure.segments.clear();
    return static_cast<double>(
        NumInTracks(See(scene, options.sightings,
                        SeedOfStream(options.seed, PhotoStream::kSightings), options.num_threads)));
  };
  constexpr double kLow = 0.2, kHigh = 0.5, kLeast = 0.02;
  const double wanted = options.points_per_image * (1.0 - options.clutter) * options.num_images;
  const double low = count(kLow), high = count(kHigh);
  if (!(high > low)) {
    throw InputError(
        "--Database.max_view_angle_deg and --Database.detection_rate: expected values with which "
        "features are found in several images, found none; use larger ones");
  }
  const double density = kLow + (wanted - low) * (kHigh - kLow) / (high - low);
  return MakePhotoScene(options.scene, options.num_images, std::max(density, kLeast), options.seed);
}

// A pixel of ideal pixels. Empty: it has none.
std::optional<Eigen::Vector2d> PixelOfIdeal(const Camera& camera, const Eigen::Vector2d& ideal) {
  const IdealCalibration k = camera.model->ideal_calibration(camera.params.data());
  const Eigen::Vector3d ray((ideal.x() - k.cx) / k.fx, (ideal.y() - k.cy) / k.fy, 1.0);
  Eigen::Vector2d pixel;
  if (!camera.model->project(camera.params.data(), ray, &pixel)) return std::nullopt;
  return pixel;
}

// Detectors lose up to a tenth of a segment at each end. The whole where that has no pixels.
LineSegment2d Shortened(const Camera& camera, const LineSegment2d& whole, Random* random) {
  const double at_start = random->Uniform(0.0, 0.1), at_end = 1.0 - random->Uniform(0.0, 0.1);
  const auto start = IdealPixel(*camera.model, camera.params.data(), whole.start);
  const auto end = IdealPixel(*camera.model, camera.params.data(), whole.end);
  if (!start || !end) return whole;
  const auto new_start = PixelOfIdeal(camera, *start + at_start * (*end - *start));
  const auto new_end = PixelOfIdeal(camera, *start + at_end * (*end - *start));
  if (!new_start || !new_end) return whole;
  return {*new_start, *new_end};
}

template <typename Item>
void Shuffle(Random* random, std::vector<Item>* items) {
  for (size_t i = items->size(); i > 1; --i) std::swap((*items)[i - 1], (*items)[random->Index(i)]);
}

class PhotoSetMaker {
 public:
  explicit PhotoSetMaker(const PhotoSetOptions& options)
      : options_(options), scene_(MakeDenseScene(options)) {}

  PhotoSet Make() {
    const SceneViews sightings =
        See(scene_, options_.sightings, SeedOfStream(options_.seed, PhotoStream::kSightings),
            options_.num_threads);
    set_.images.resize(scene_.cam_from_world.size());
    AddKeypoints(sightings);
    AddSegments(sightings);
    AddStructure();
    set_.pairs = MakePairs(options_, scene_, found_, set_.images);
    AddPriors();
    MakeTruth();
    return std::move(set_);
  }

 private:
  const Camera& CameraOf(size_t view) const { return scene_.cameras[scene_.camera_of_view[view]]; }
  Eigen::Vector2d RandomPixel(const Camera& camera, Random* random) const {
    const double x = random->Uniform(0.0, static_cast<double>(camera.width));
    return {x, random->Uniform(0.0, static_cast<double>(camera.height))};
  }
  // So many features of nothing go with `count` of something.
  size_t NumClutter(size_t count) const {
    return static_cast<size_t>(
        std::round(options_.clutter / (1.0 - options_.clutter) * static_cast<double>(count)));
  }

  void AddKeypoints(const SceneViews& sightings) {
    struct Entry {
      uint32_t feature;
      Eigen::Vector2d pixel;
    };
    std::vector<std::vector<Entry>> of_view(set_.images.size());
    for (size_t i = 0; i < sightings.points.size(); ++i) {
      for (const SeenPixel& s : sightings.points[i])
        of_view[s.view].push_back({static_cast<uint32_t>(i), s.pixel});
    }
    found_.points.resize(sightings.points.size());
    for (size_t view = 0; view < of_view.size(); ++view) {
      Random random = StreamOfView(options_.seed, PhotoStream::kKeypoints, view);
      std::vector<Entry>& entries = of_view[view];
      for (Entry& entry : entries) {
        const double dx = random.Normal(options_.point_noise_px);
        entry.pixel += Eigen::Vector2d(dx, random.Normal(options_.point_noise_px));
      }
      for (size_t left = NumClutter(entries.size()); left > 0; --left)
        entries.push_back({kNone, RandomPixel(CameraOf(view), &random)});
      Shuffle(&random, &entries);
      Keypoints& keypoints = set_.images[view].keypoints;
      for (const Entry& entry : entries) {
        if (entry.feature != kNone) {
          found_.points[entry.feature].push_back(
              {static_cast<uint32_t>(view), static_cast<uint32_t>(keypoints.size())});
        }
        keypoints.data.push_back(static_cast<float>(entry.pixel.x()));
        keypoints.data.push_back(static_cast<float>(entry.pixel.y()));
      }
    }
  }

  void AddSegments(const SceneViews& sightings) {
    struct Entry {
      uint32_t feature;
      LineSegment2d segment;
    };
    std::vector<std::vector<Entry>> of_view(set_.images.size());
    for (size_t i = 0; i < sightings.lines.size(); ++i) {
      for (const SeenSegment& s : sightings.lines[i])
        of_view[s.view].push_back({static_cast<uint32_t>(i), s.segment});
    }
    found_.lines.resize(sightings.lines.size());
    for (size_t view = 0; view < of_view.size(); ++view) {
      Random random = StreamOfView(options_.seed, PhotoStream::kSegments, view);
      std::vector<Entry>& entries = of_view[view];
      for (Entry& entry : entries) {
        entry.segment = Shortened(CameraOf(view), entry.segment, &random);
        const Eigen::Vector2d across = entry.segment.Line().head<2>();
        entry.segment.start += random.Normal(options_.segment_noise_px) * across;
        entry.segment.end += random.Normal(options_.segment_noise_px) * across;
      }
      for (size_t left = NumClutter(entries.size()); left > 0; --left) {
        const Eigen::Vector2d start = RandomPixel(CameraOf(view), &random);
        const double angle = random.Uniform(0.0, 6.28), length = random.Uniform(15.0, 100.0);
        entries.push_back(
            {kNone, {start, start + length * Eigen::Vector2d(std::cos(angle), std::sin(angle))}});
      }
      Shuffle(&random, &entries);
      for (const Entry& entry : entries) {
        std::vector<LineSegment2d>& segments = set_.images[view].segments;
        if (entry.feature != kNone) {
          found_.lines[entry.feature].push_back(
              {static_cast<uint32_t>(view), static_cast<uint32_t>(segments.size())});
        }
        segments.push_back(entry.segment);
      }
    }
  }

  // Vanishing points and label maps, which need to know what each feature is.
  void AddStructure() {
    const SyntheticStructure& structure = scene_.content.structure;
    std::vector<int> plane_of_point(structure.points.size(), -1);
    std::vector<int> plane_of_line(structure.segments.size(), -1);
    for (size_t g = 0; g < structure.groups.size(); ++g) {
      const SyntheticGroup& group = structure.groups[g];
      if (!IsPlane(*group.type)) continue;
      for (const uint32_t p : group.points) plane_of_point[p] = static_cast<int>(g);
      for (const uint32_t l : group.lines) plane_of_line[l] = static_cast<int>(g);
    }
    std::vector<PlanesOfFeatures> planes(set_.images.size());
    std::vector<std::vector<int>> axes(set_.images.size());
    for (size_t view = 0; view < planes.size(); ++view) {
      planes[view].of_keypoints.assign(set_.images[view].keypoints.size(), -1);
      planes[view].of_segments.assign(set_.images[view].segments.size(), -1);
      axes[view].assign(set_.images[view].segments.size(), -1);
    }
    for (size_t i = 0; i < found_.points.size(); ++i) {
      for (const FoundFeature& f : found_.points[i])
        planes[f.view].of_keypoints[f.idx] = plane_of_point[i];
    }
    for (size_t i = 0; i < found_.lines.size(); ++i) {
      for (const FoundFeature& f : found_.lines[i]) {
        planes[f.view].of_segments[f.idx] = plane_of_line[i];
        axes[f.view][f.idx] = structure.axis_of_line[i];
      }
    }
    ParallelTasks(options_.num_threads, planes.size(), [&](size_t view) {
      PhotoSetImage& image = set_.images[view];
      FindVanishingPoints(CameraOf(view), axes[view], &image);
      image.label_map = LabelPlanes(scene_, static_cast<uint32_t>(view), planes[view], image);
    });
  }

  void AddPriors() {
    Random random = StreamOf(options_.seed, PhotoStream::kPriors);
    constexpr double kGuessedFocalFactor = 1.2;
    for (const Camera& truth : scene_.cameras) {
      PhotoSetCamera& known =
          set_.cameras.emplace_back(truth, options_.focal_length != FocalLengthPrior::kUnknown);
      if (options_.focal_length == FocalLengthPrior::kExact) continue;
      Camera& camera = known.camera;
      for (const int i : camera.model->extra_idxs) camera.params[i] = 0.0;
      const double error = 1.0 + random.Normal(options_.exif_error);
      for (const int i : camera.model->focal_idxs) {
        camera.params[i] =
            options_.focal_length == FocalLengthPrior::kExif
                ? std::max(0.1, error) * camera.params[i]
                : kGuessedFocalFactor * static_cast<double>(std::max(camera.width, camera.height));
      }
    }
  }

  // The scene's structure without what fewer than two images have, and the tracks of what is left.
  SyntheticStructure Found(FoundFeatures* tracks) const {
    const SyntheticStructure& all = scene_.content.structure;
    SyntheticStructure kept;
    const auto renumber = [](const std::vector<std::vector<FoundFeature>>& found,
                             std::vector<std::vector<FoundFeature>>* kept_tracks) {
      std::vector<uint32_t> new_idx(found.size(), kNone);
      for (size_t i = 0; i < found.size(); ++i) {
        if (found[i].size() < 2) continue;
        new_idx[i] = static_cast<uint32_t>(kept_tracks->size());
        kept_tracks->push_back(found[i]);
      }
      return new_idx;
    };
    const std::vector<uint32_t> new_point = renumber(found_.points, &tracks->points);
    const std::vector<uint32_t> new_line = renumber(found_.lines, &tracks->lines);
    for (size_t p = 0; p < new_point.size(); ++p) {
      if (new_point[p] != kNone) kept.points.push_back(all.points[p]);
    }
    std::vector<uint32_t> new_group(all.groups.size(), kNone);
    const auto is_kept = [](uint32_t idx) { return idx != kNone; };
    for (size_t g = 0; g < all.groups.size(); ++g) {
      SyntheticGroup group = all.groups[g];
      for (uint32_t& p : group.points) p = new_point[p];
      for (uint32_t& l : group.lines) l = new_line[l];
      std::erase(group.points, kNone);
      std::erase(group.lines, kNone);
      if (group.points.size() + group.lines.size() < 3) continue;
      new_group[g] = static_cast<uint32_t>(kept.groups.size());
      kept.groups.push_back(std::move(group));
    }
    for (size_t l = 0; l < new_line.size(); ++l) {
      if (!is_kept(new_line[l])) continue;
      kept.segments.push_back(all.segments[l]);
      kept.axis_of_line.push_back(all.axis_of_line[l]);
      kept.plane_of_line.push_back(all.plane_of_line[l]);
    }
    for (const SyntheticEdge& edge : all.edges) {
      if (is_kept(new_point[edge.point]) && is_kept(new_line[edge.line]))
        kept.edges.push_back({new_point[edge.point], new_line[edge.line]});
    }
    for (const SyntheticRelation& relation : all.relations) {
      const uint32_t a = new_group[relation.group1], b = new_group[relation.group2];
      if (is_kept(a) && is_kept(b)) kept.relations.push_back({a, b, relation.type});
    }
    return kept;
  }

  void MakeTruth() {
    Reconstruction& model = set_.truth;
    for (size_t k = 0; k < scene_.cameras.size(); ++k)
      model.cameras.Add(static_cast<camera_t>(k + 1), scene_.cameras[k]);
    for (size_t view = 0; view < set_.images.size(); ++view) {
      Image image;
      image.name = fmt::format("image{:06}.jpg", view + 1);
      image.camera_id = scene_.camera_of_view[view] + 1;
      image.cam_from_world = scene_.cam_from_world[view];
      const PhotoSetImage& features = set_.images[view];
      for (size_t k = 0; k < features.keypoints.size(); ++k)
        image.points2D.push_back({features.keypoints.Position(k), kNoId});
      for (const LineSegment2d& segment : features.segments)
        image.lines2D.push_back({segment, kNoId});
      model.images.Add(static_cast<image_t>(view + 1), std::move(image));
    }
    model.AddTrivialRigsAndFrames();
    FoundFeatures tracks;
    const SyntheticStructure structure = Found(&tracks);
    constexpr std::array<uint8_t, 3> kGrey{150, 150, 150};
    model.points3D.Reserve(structure.points.size());
    for (size_t p = 0; p < structure.points.size(); ++p) {
      Point3D point;
      point.xyz = structure.points[p];
      point.rgb = kGrey;
      for (const FoundFeature& f : tracks.points[p]) {
        point.track.push_back({f.view + 1, f.idx});
        model.images.at(f.view + 1).points2D[f.idx].point3D_id = SyntheticIdOf(p);
      }
      model.points3D.Add(SyntheticIdOf(p), std::move(point));
    }
    model.lines3D.Reserve(structure.segments.size());
    for (size_t l = 0; l < structure.segments.size(); ++l) {
      Line3D line = MakeSyntheticLine(structure.segments[l]);
      line.rgb = kGrey;
      for (const FoundFeature& f : tracks.lines[l]) {
        line.track.push_back({f.view + 1, f.idx});
        model.images.at(f.view + 1).lines2D[f.idx].line3D_id = SyntheticIdOf(l);
      }
      model.lines3D.Add(SyntheticIdOf(l), std::move(line));
    }
    AddAssociations(structure, &model);
  }

  const PhotoSetOptions& options_;
  const PhotoScene scene_;
  FoundFeatures found_;
  PhotoSet set_;
};

}  // namespace

void PhotoSetOptions::Describe(OptionTable* table) const {
  table->Section("Database");
  table
      ->Field("points_per_image", &points_per_image, AtLeast(50),
              "Keypoints of an image, in the mean.")
      .Basic();
  table->Field("clutter", &clutter, Between(0, 0.9),
               "Share of the keypoints and of the segments that belong to nothing.");
  table
      ->Field("point_noise_px", &point_noise_px, AtLeast(0),
              "Standard deviation of keypoints, per coordinate.")
      .Basic();
  table->Field("segment_noise_px", &segment_noise_px, AtLeast(0),
               "Standard deviation of the ends of segments, across these.");
  table
      ->Choice("focal_length", &focal_length,
               {{"exact", FocalLengthPrior::kExact},
                {"exif", FocalLengthPrior::kExif},
                {"unknown", FocalLengthPrior::kUnknown}},
               "What the database knows of cameras (all intrinsics; a focal length with an error, "
               "marked as known; a guess, 1.2 times the longer side).")
      .Basic();
  table->Field("exif_error", &exif_error, Between(0, 0.3),
               "Standard deviation of focal lengths from EXIF, share of the focal length.");
  table->Field("sequential_overlap", &sequential_overlap, AtLeast(1),
               "Images of a street are matched with so many that follow.");
  table->Field("max_pairs_per_image", &max_pairs_per_image, AtLeast(1),
               "Images that one is matched with because they share most features; of a street: "
               "images that see the place again later.");
  table->Field("min_num_matches", &min_num_matches, AtLeast(8), "Verified matches of a pair.");
  table->Field("max_match_angle_deg", &max_match_angle_deg, Between(1, 180),
               "Angle between the rays of two images up to which a feature is matched.");
  table->Field("max_match_scale", &max_match_scale, AtLeast(1.1),
               "Ratio of a feature's sizes in two images up to which it is matched.");
  table->Field("missing_matches", &missing_matches, Between(0, 0.9),
               "Share of the matches of points and of segments that are missing.");
  table
      ->Field("wrong_matches", &wrong_matches, Between(0, 0.5),
              "Share of the verified matches of points that are wrong: near the epipolar line.")
      .Basic();
  table->Field("wrong_pairs", &wrong_pairs, Between(0, 0.5),
               "Share of the verified pairs that are wrong: a part of the scene matched with its "
               "copy, all matches in agreement.");
  table->Field("wrong_line_matches", &wrong_line_matches, Between(0, 0.9),
               "Share of the matches of segments that are wrong.");
  table->Field("rejected_matches", &rejected_matches, Between(0, 0.8),
               "Share of the raw matches of points that verification removes.");
  sightings.Describe(table);
}

PhotoSet MakePhotoSet(const PhotoSetOptions& options) {
  Check(options);
  return PhotoSetMaker(options).Make();
}

}  // namespace holba
