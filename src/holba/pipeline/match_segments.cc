// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/match_segments.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "holba/base/progress.h"
#include "holba/base/threads.h"
#include "holba/base/timer.h"
#include "holba/estimation/two_view/relative_pose.h"
#include "holba/pipeline/pair_lists.h"
#include "holba/pipeline/settings.h"

namespace holba {
namespace {

struct SegmentedImage {
  Camera camera;
  bool is_calibrated = false;  // its focal length is known
  Keypoints keypoints;
  MatchableSegments segments;
};

// Empty: no segments, or none that are described.
std::optional<SegmentedImage> ReadImage(const Database& database, image_t id,
                                        const DatabaseCamera& camera) {
  const auto settings = database.ReadSegmentSettings(id);
  if (!settings) return std::nullopt;
  ImageFeatures features;
  auto segments = database.ReadSegments(id, *settings);
  auto descriptors = database.ReadSegmentDescriptors(id, *settings);
  auto keypoints = database.ReadKeypoints(id);
  if (!segments || segments->empty() || !descriptors || !keypoints) return std::nullopt;
  features.segments = std::move(*segments);
  features.segment_descriptors = std::move(*descriptors);
  return SegmentedImage{camera.camera, camera.has_prior_focal_length, std::move(*keypoints),
                        MakeMatchable(features, camera.camera)};
}

// x2' F x1 = 0, of ideal pixels or of the pixels as they are.
struct Epipolar {
  std::optional<Eigen::Matrix3d> F;  // empty: not known, or the cameras do not move
  bool of_ideal_pixels = true;
};

Epipolar EpipolarOf(const TwoViewGeometry& geometry, const SegmentedImage& image1,
                    const SegmentedImage& image2) {
  const auto of_essential = [&](const Eigen::Matrix3d& E) {
    return Epipolar{CalibrationMatrix(image2.camera).inverse().transpose() * E *
                    CalibrationMatrix(image1.camera).inverse()};
  };
  if (geometry.cam2_from_cam1) {
    if (geometry.cam2_from_cam1->translation.isZero(0.0)) return {};
    return of_essential(EssentialMatrix(*geometry.cam2_from_cam1));
  }
  if (geometry.config != TwoViewConfig::kUncalibrated) return {};
  if (image1.is_calibrated && image2.is_calibrated)
    return geometry.E ? of_essential(*geometry.E) : Epipolar{};
  return {geometry.F, false};
}

// The same segments, their geometry that of the pixels as they are.
MatchableSegments OfPixelsAsTheyAre(MatchableSegments segments) {
  segments.ideal.assign(segments.segments.begin(), segments.segments.end());
  return segments;
}

struct SegmentPairTask {
  ImagePair pair;
  std::vector<SharedPoint> points;
  Epipolar epipolar;
  std::string settings;
  std::vector<LineMatch> matches;
};

void Take(const ImagePair& pair, const std::vector<LineMatch>& matches, MatchSegmentsReport* report,
          LineMatchMap* found) {
  report->num_matches += matches.size();
  std::vector<LineMatch> mutual = MutualNearest(matches, kMaxLineMatchRatio);
  report->num_mutual += mutual.size();
  if (found != nullptr && !mutual.empty()) (*found)[pair] = std::move(mutual);
}

}  // namespace

MatchSegmentsReport MatchSegmentsOfPairs(const LineMatchingOptions& options,
                                         const std::vector<ImagePair>& pairs, int num_threads,
                                         Database* database, LineMatchMap* found) {
  const Timer timer;
  MatchSegmentsReport report;
  const auto cameras = database->ReadCameras();
  std::map<image_t, SegmentedImage> images;
  for (const auto& [id, image] : database->ReadImages()) {
    if (auto read = ReadImage(*database, id, cameras.at(image.camera_id)))
      images.emplace(id, std::move(*read));
  }
  const std::vector<ImagePair> verified_list = database->VerifiedPairs(1);
  const std::set<ImagePair> verified(verified_list.begin(), verified_list.end());
  const std::string text = SettingsText("matching by points 2", options);

  Progress progress("Matching segments", "pairs", pairs.size());
  for (size_t begin = 0; begin < pairs.size(); begin += kPairsPerWrite) {
    progress.Update(begin);
    std::vector<SegmentPairTask> tasks;
    for (size_t i = begin; i < std::min(begin + kPairsPerWrite, pairs.size()); ++i) {
      const auto& [id1, id2] = pairs[i];
      const auto image1 = images.find(id1), image2 = images.find(id2);
      if (image1 == images.end() || image2 == images.end() || !verified.contains(pairs[i]))
        continue;
      ++report.num_pairs;
      SegmentPairTask task{.pair = pairs[i]};
      const auto geometry = database->ReadTwoViewGeometry(id1, id2);
      for (const auto& [idx1, idx2] : geometry->inlier_matches) {
        task.points.emplace_back(image1->second.keypoints.Position(idx1),
                                 image2->second.keypoints.Position(idx2));
      }
      static_assert(sizeof(SharedPoint) == 4 * sizeof(double));
      task.epipolar = EpipolarOf(*geometry, image1->second, image2->second);
      const auto& F = task.epipolar.F;
      task.settings =
          fmt::format("{} geometry={:016x} points={:016x} cameras={}, {}", text,
                      F ? HashBytes(F->data(), 9 * sizeof(double)) : kEmptyHash,
                      HashBytes(task.points.data(), task.points.size() * sizeof(SharedPoint)),
                      ToString(image1->second.camera), ToString(image2->second.camera));
      if (const auto stored = database->ReadLineMatches(id1, id2, task.settings)) {
        ++report.pairs_reused;
        Take(pairs[i], *stored, &report, found);
        continue;
      }
      tasks.push_back(std::move(task));
    }
    ParallelTasks(num_threads, tasks.size(), [&](size_t i) {
      SegmentPairTask& task = tasks[i];
      const MatchableSegments &segments1 = images.at(task.pair.first).segments,
                              &segments2 = images.at(task.pair.second).segments;
      task.matches =
          task.epipolar.of_ideal_pixels
              ? MatchSegments(options, segments1, segments2, task.points, task.epipolar.F)
              : MatchSegments(options, OfPixelsAsTheyAre(segments1), OfPixelsAsTheyAre(segments2),
                              task.points, task.epipolar.F);
    });
    if (tasks.empty()) continue;
    Database::Transaction transaction(database);
    for (const SegmentPairTask& task : tasks) {
      database->WriteLineMatches(task.pair.first, task.pair.second, task.settings, task.matches);
      Take(task.pair, task.matches, &report, found);
    }
    transaction.Commit();
  }
  report.seconds = timer.Seconds();
  return report;
}

}  // namespace holba
