// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/match_points.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <ctime>
#include <list>
#include <optional>
#include <set>

#include "holba/base/error.h"
#include "holba/base/threads.h"
#include "holba/base/timer.h"
#include "holba/estimation/two_view/relative_pose.h"
#include "holba/frontend/matching/guided_matching.h"
#include "holba/frontend/matching/onnx_matching.h"
#include "holba/frontend/matching/repetition.h"
#include "holba/pipeline/pair_lists.h"
#include "holba/pipeline/settings.h"

namespace holba {
namespace {

struct MatchableImage {
  const DatabaseCamera* camera = nullptr;
  Keypoints keypoints;
  PackedDescriptors descriptors;
  Descriptors as_stored;  // for a model that matches; else empty
};

// Images as they are needed; those that were not used for the longest time leave.
class ImageCache {
 public:
  ImageCache(const MatchPointsOptions& options, const Database& database)
      : options_{options},
        database_{database},
        cameras_{database.ReadCameras()},
        images_{database.ReadImages()} {}

  // Null: the image has no features.
  const MatchableImage* Find(image_t id) const {
    const auto entry = entries_.find(id);
    return entry == entries_.end() || entry->second.descriptors.size() == 0 ? nullptr
                                                                            : &entry->second;
  }

  void Load(const std::set<image_t>& wanted) {
    for (image_t id : wanted) {
      order_.remove(id);
      order_.push_back(id);
      if (!entries_.contains(id)) entries_.emplace(id, Read(id));
    }
    const size_t limit =
        std::max(wanted.size(), static_cast<size_t>(options_.max_images_in_memory));
    while (order_.size() > limit) {
      entries_.erase(order_.front());
      order_.pop_front();
    }
  }

  const std::string& NameOf(image_t id) const { return images_.at(id).name; }

 private:
  MatchableImage Read(image_t id) const {
    MatchableImage image;
    image.camera = &cameras_.at(images_.at(id).camera_id);
    auto keypoints = database_.ReadKeypoints(id);
    auto descriptors = database_.ReadDescriptors(id);
    if (!keypoints || !descriptors) return image;
    if (descriptors->size() != 0 && descriptors->size() != keypoints->size()) {
      throw InputError(
          database_.path(),
          fmt::format("image {} ('{}'): expected a descriptor for each keypoint ({}), found {} of "
                      "them; make its features anew",
                      id, images_.at(id).name, keypoints->size(), descriptors->size()));
    }
    image.keypoints = std::move(*keypoints);
    image.descriptors =
        PackedDescriptors(*descriptors, static_cast<size_t>(options_.max_num_matches));
    if (!options_.onnx_matcher_path.empty()) image.as_stored = std::move(*descriptors);
    return image;
  }

  const MatchPointsOptions& options_;
  const Database& database_;
  std::map<camera_t, DatabaseCamera> cameras_;
  std::map<image_t, DatabaseImage> images_;
  std::map<image_t, MatchableImage> entries_;
  std::list<image_t> order_;  // the one used last at the end
};

struct PointPairTask {
  ImagePair pair;
  bool has_matches = false;  // they were in the database
  PointMatches matches;
  TwoViewResult result;
  bool is_verified = false;  // was tried
  std::optional<PairRepetition> repetition;
  double match_seconds = 0.0, verify_seconds = 0.0;
};

double ThreadSeconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Of the described keypoints. The geometry of pairs that are not calibrated is of the pixels as
// they are.
std::vector<std::optional<Eigen::Vector2d>> Positions(const MatchableImage& image, bool ideal) {
  std::vector<std::optional<Eigen::Vector2d>> positions(image.descriptors.size());
  const Camera& camera = image.camera->camera;
  for (size_t i = 0; i < positions.size(); ++i) {
    positions[i] = image.keypoints.Position(i);
    if (ideal) positions[i] = IdealPixel(*camera.model, camera.params.data(), *positions[i]);
  }
  return positions;
}

bool AreCalibrated(const MatchableImage& image1, const MatchableImage& image2) {
  return image1.camera->has_prior_focal_length && image2.camera->has_prior_focal_length;
}

// Of ideal pixels if both are calibrated, else of the pixels as they are. Empty: no geometry, or
// several.
std::optional<GuidingGeometry> GuideOf(const MatchPointsOptions& options,
                                       const MatchableImage& image1, const MatchableImage& image2,
                                       const TwoViewGeometry& geometry) {
  GuidingGeometry guide;
  guide.max_error_px = options.geometry.max_error;
  switch (geometry.config) {
    case TwoViewConfig::kCalibrated:
      guide.F = CalibrationMatrix(image2.camera->camera).inverse().transpose() * *geometry.E *
                CalibrationMatrix(image1.camera->camera).inverse();
      break;
    case TwoViewConfig::kUncalibrated:
      guide.F = geometry.F;
      break;
    case TwoViewConfig::kPlanar:
    case TwoViewConfig::kPanoramic:
    case TwoViewConfig::kPlanarOrPanoramic:
      guide.H = geometry.H;
      break;
    default:
      return std::nullopt;
  }
  return guide;
}

void MatchAgainGuided(const MatchPointsOptions& options, const MatchableImage& image1,
                      const MatchableImage& image2, TwoViewGeometry* geometry) {
  const auto guide = GuideOf(options, image1, image2, *geometry);
  if (!guide) return;
  const bool ideal = AreCalibrated(image1, image2);
  PointMatches guided =
      MatchGuided(options.descriptors, *guide, image1.descriptors, Positions(image1, ideal),
                  image2.descriptors, Positions(image2, ideal))
          .matches;
  if (guided.size() < static_cast<size_t>(options.geometry.min_num_inliers)) return;
  geometry->inlier_matches = std::move(guided);
}

std::optional<PairRepetition> Repetition(const MatchPointsOptions& options,
                                         const MatchableImage& image1, const MatchableImage& image2,
                                         const Neighbours& neighbours,
                                         const TwoViewGeometry& geometry) {
  const auto guide = GuideOf(options, image1, image2, geometry);
  if (!guide || image1.descriptors.are_floats() != image2.descriptors.are_floats() ||
      image1.descriptors.length() != image2.descriptors.length())
    return std::nullopt;
  // Matches of another program may name points beyond those that take part.
  for (const auto& [idx1, idx2] : geometry.inlier_matches) {
    if (idx1 >= image1.descriptors.size() || idx2 >= image2.descriptors.size()) return std::nullopt;
  }
  const bool ideal = AreCalibrated(image1, image2);
  return MeasureRepetition(options.descriptors, *guide, neighbours, image1.descriptors,
                           Positions(image1, ideal), image2.descriptors, Positions(image2, ideal),
                           geometry.inlier_matches);
}

OnnxMatchEnd EndOf(const MatchableImage& image) {
  const Camera& camera = image.camera->camera;
  return {Eigen::Vector2d(static_cast<double>(camera.width), static_cast<double>(camera.height)),
          &image.keypoints, &image.as_stored};
}

// `matcher`: null: by descriptors.
void RunTask(const MatchPointsOptions& options, const OnnxMatcher* matcher,
             const ImageCache& images, PointPairTask* task) {
  const MatchableImage* image1 = images.Find(task->pair.first);
  const MatchableImage* image2 = images.Find(task->pair.second);
  const double begin = ThreadSeconds();
  bool best_first = false;
  const bool keep_repetition = options.keep_repetition && !options.skip_geometric_verification;
  Neighbours neighbours;
  const bool by_descriptors = !task->has_matches && matcher == nullptr;
  if ((by_descriptors || keep_repetition) && image1 != nullptr && image2 != nullptr)
    neighbours = FindNeighbours(image1->descriptors, image2->descriptors);
  if (!task->has_matches && image1 != nullptr && image2 != nullptr) {
    task->matches = matcher != nullptr
                        ? matcher
                              ->Match(EndOf(*image1), EndOf(*image2),
                                      static_cast<size_t>(options.max_num_matches))
                              .matches
                        : SelectMatches(options.descriptors, image1->descriptors.are_floats(),
                                        neighbours.of_first, neighbours.of_second)
                              .matches;
    best_first = true;
  }
  const double middle = ThreadSeconds();
  task->match_seconds = middle - begin;
  if (options.skip_geometric_verification) return;
  task->is_verified = true;
  if (image1 == nullptr || image2 == nullptr) {
    task->result.geometry.config = TwoViewConfig::kDegenerate;
    task->result.failure = TwoViewFailure::kFewMatches;
    return;
  }
  const uint64_t seed = (static_cast<uint64_t>(task->pair.first) << 32) | task->pair.second;
  task->result = EstimateTwoView(
      options.geometry,
      {&image1->camera->camera, image1->camera->has_prior_focal_length, &image1->keypoints},
      {&image2->camera->camera, image2->camera->has_prior_focal_length, &image2->keypoints},
      task->matches, best_first, seed);
  TwoViewGeometry& geometry = task->result.geometry;
  if (options.guided_matching) MatchAgainGuided(options, *image1, *image2, &geometry);
  std::sort(geometry.inlier_matches.begin(), geometry.inlier_matches.end());
  if (keep_repetition)
    task->repetition = Repetition(options, *image1, *image2, neighbours, geometry);
  task->verify_seconds = ThreadSeconds() - middle;
}

void Write(const MatchPointsOptions& options, const std::vector<PointPairTask>& tasks,
           Database* database) {
  Database::Transaction transaction(database);
  for (const PointPairTask& task : tasks) {
    const auto& [id1, id2] = task.pair;
    if (!task.has_matches) {
      // As COLMAP has them: in the order of the first image's keypoints.
      PointMatches ordered = task.matches;
      std::sort(ordered.begin(), ordered.end());
      database->WriteMatches(id1, id2, ordered);
    }
    if (!task.is_verified) continue;
    const TwoViewGeometry& geometry = task.result.geometry;
    database->WriteTwoViewGeometry(id1, id2, geometry);
    if (!task.repetition) continue;
    database->WritePairRepetition(id1, id2, RepetitionSettings(options.descriptors, geometry),
                                  *task.repetition);
  }
  transaction.Commit();
}

bool HasGeometry(TwoViewConfig config) {
  return config != TwoViewConfig::kUndefined && config != TwoViewConfig::kDegenerate &&
         config != TwoViewConfig::kWatermark;
}

void Count(const ImagePair& pair, size_t num_matches, const TwoViewGeometry& geometry,
           std::string_view failure, double median_angle_deg, MatchPointsReport* report) {
  report->num_matches += num_matches;
  if (!HasGeometry(geometry.config)) {
    ++report->dropped[std::string(failure)];
    return;
  }
  ++report->num_verified;
  ++report->num_of_config[std::string(NameOf(geometry.config))];
  report->num_inliers += geometry.inlier_matches.size();
  report->pairs.push_back({.pair = pair,
                           .num_matches = num_matches,
                           .num_inliers = geometry.inlier_matches.size(),
                           .config = geometry.config,
                           .median_angle_deg = median_angle_deg});
}

void CountTask(const PointPairTask& task, MatchPointsReport* report) {
  report->match_cpu_seconds += task.match_seconds;
  report->verify_cpu_seconds += task.verify_seconds;
  if (!task.is_verified) {
    report->num_matches += task.matches.size();
    return;
  }
  Count(task.pair, task.matches.size(), task.result.geometry, NameOf(task.result.failure),
        task.result.median_angle_deg, report);
}

void CountStored(const Database& database, const ImagePair& pair, MatchPointsReport* report) {
  ++report->pairs_reused;
  const auto matches = database.ReadMatches(pair.first, pair.second);
  const auto geometry = database.ReadTwoViewGeometry(pair.first, pair.second);
  if (!geometry) {
    report->num_matches += matches->size();
    return;
  }
  const std::string_view failure = geometry->config == TwoViewConfig::kWatermark
                                       ? NameOf(TwoViewFailure::kWatermark)
                                       : std::string_view("none when they were matched");
  Count(pair, matches->size(), *geometry, failure, 0.0, report);
}

}  // namespace

void MatchPointsOptions::Describe(OptionTable* table) const {
  table->Section("FeatureMatching");
  table->Field("num_threads", &num_threads, AtLeast(-1),
               "Number of threads; -1: one per hardware thread.");
  DescribeMatching(table);
}

void MatchPointsOptions::DescribeMatching(OptionTable* table) const {
  table->Section("FeatureMatching");
  table->Field("max_num_matches", &max_num_matches, AtLeast(1),
               "Features of an image that take part: the first ones.");
  table->Field("guided_matching", &guided_matching,
               "Whether verified pairs are matched once more, among the points that their geometry "
               "allows.");
  table->Field("skip_geometric_verification", &skip_geometric_verification,
               "Whether matches are left unverified.");
  table->Field("keep_repetition", &keep_repetition,
               "Whether the database keeps what each verified pair has several times (windows, "
               "stairs).");
  descriptors.Describe(table);
  geometry.Describe(table);
  table->Section("Onnx");
  table->Field("matcher_path", &onnx_matcher_path,
               "JSON file that describes an ONNX model of yours, which matches instead of the "
               "nearest descriptors.");
}

std::string RepetitionSettings(const DescriptorMatchOptions& options,
                               const TwoViewGeometry& geometry) {
  const PointMatches& inliers = geometry.inlier_matches;
  static_assert(sizeof(PointMatches::value_type) == 2 * sizeof(point2D_t));
  return fmt::format("{} inliers={:016x}", SettingsText("repetition 1", options),
                     HashBytes(inliers.data(), inliers.size() * sizeof(inliers[0])));
}

MatchPointsReport MatchPoints(const MatchPointsOptions& options,
                              const std::vector<ImagePair>& pairs, Database* database,
                              const std::function<void(size_t num_done)>& progress) {
  const Timer timer;
  MatchPointsReport report;
  report.num_pairs = pairs.size();
  const auto to_set = [](const std::vector<ImagePair>& list) {
    return std::set<ImagePair>(list.begin(), list.end());
  };
  const std::set<ImagePair> matched = to_set(database->MatchedPairs(0));
  const std::set<ImagePair> verified = to_set(database->VerifiedPairs(0));

  std::optional<OnnxMatcher> matcher;
  if (!options.onnx_matcher_path.empty()) matcher.emplace(options.onnx_matcher_path);
  ImageCache images(options, *database);
  std::set<image_t> seen, without_features;
  for (size_t begin = 0; begin < pairs.size(); begin += kPairsPerWrite) {
    std::vector<PointPairTask> tasks;
    std::set<image_t> wanted;
    for (size_t i = begin; i < std::min(begin + kPairsPerWrite, pairs.size()); ++i) {
      const bool has_matches = matched.contains(pairs[i]);
      if (has_matches && (options.skip_geometric_verification || verified.contains(pairs[i]))) {
        CountStored(*database, pairs[i], &report);
        continue;
      }
      PointPairTask task{.pair = pairs[i], .has_matches = has_matches};
      if (has_matches) task.matches = *database->ReadMatches(pairs[i].first, pairs[i].second);
      tasks.push_back(std::move(task));
      wanted.insert({pairs[i].first, pairs[i].second});
    }
    images.Load(wanted);
    for (image_t id : wanted) {
      if (images.Find(id) == nullptr) without_features.insert(id);
    }
    ParallelTasks(options.num_threads, tasks.size(), [&](size_t i) {
      RunTask(options, matcher ? &*matcher : nullptr, images, &tasks[i]);
    });
    if (!tasks.empty()) Write(options, tasks, database);
    for (const PointPairTask& task : tasks) CountTask(task, &report);
    progress(std::min(begin + kPairsPerWrite, pairs.size()));
  }
  for (image_t id : without_features) report.without_features.push_back(images.NameOf(id));
  report.seconds = timer.Seconds();
  return report;
}

}  // namespace holba
