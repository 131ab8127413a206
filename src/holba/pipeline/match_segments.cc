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

#include "holba/base/threads.h"
#include "holba/base/timer.h"
#include "holba/estimation/two_view/relative_pose.h"
#include "holba/pipeline/settings.h"

namespace holba {
namespace {

// Pairs that are written at a time.
constexpr size_t kGroupSize = 64;

struct SegmentedImage {
  Camera camera;
  Keypoints keypoints;
  MatchableSegments segments;
};

// Empty: no segments, or none that are described.
std::optional<SegmentedImage> ReadImage(const Database& database, image_t id,
                                        const Camera& camera) {
  const auto settings = database.ReadSegmentSettings(id);
  if (!settings) return std::nullopt;
  ImageFeatures features;
  auto segments = database.ReadSegments(id, *settings);
  auto descriptors = database.ReadSegmentDescriptors(id, *settings);
  auto keypoints = database.ReadKeypoints(id);
  if (!segments || segments->empty() || !descriptors || !keypoints) return std::nullopt;
  features.segments = std::move(*segments);
  features.segment_descriptors = std::move(*descriptors);
  return SegmentedImage{camera, std::move(*keypoints), MakeMatchable(features, camera)};
}

struct PairTask {
  ImagePair pair;
  std::vector<SharedPoint> points;
  std::optional<Eigen::Matrix3d> F;  // of ideal pixels
  std::string settings;
  std::vector<LineMatch> matches;
};

// Of a pair whose relative pose is known and moves.
std::optional<Eigen::Matrix3d> FundamentalOf(const TwoViewGeometry& geometry, const Camera& camera1,
                                             const Camera& camera2) {
  if (!geometry.cam2_from_cam1 || geometry.cam2_from_cam1->translation.isZero(0.0))
    return std::nullopt;
  return CalibrationMatrix(camera2).inverse().transpose() *
         EssentialMatrix(*geometry.cam2_from_cam1) * CalibrationMatrix(camera1).inverse();
}

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
    if (auto read = ReadImage(*database, id, cameras.at(image.camera_id).camera))
      images.emplace(id, std::move(*read));
  }
  const std::vector<ImagePair> verified_list = database->VerifiedPairs(1);
  const std::set<ImagePair> verified(verified_list.begin(), verified_list.end());
  const std::string text = SettingsText("matching by points 1", options);

  for (size_t begin = 0; begin < pairs.size(); begin += kGroupSize) {
    std::vector<PairTask> tasks;
    for (size_t i = begin; i < std::min(begin + kGroupSize, pairs.size()); ++i) {
      const auto& [id1, id2] = pairs[i];
      const auto image1 = images.find(id1), image2 = images.find(id2);
      if (image1 == images.end() || image2 == images.end() || !verified.contains(pairs[i]))
        continue;
      ++report.num_pairs;
      PairTask task{.pair = pairs[i]};
      const auto geometry = database->ReadTwoViewGeometry(id1, id2);
      for (const auto& [idx1, idx2] : geometry->inlier_matches) {
        task.points.emplace_back(image1->second.keypoints.Position(idx1),
                                 image2->second.keypoints.Position(idx2));
      }
      static_assert(sizeof(SharedPoint) == 4 * sizeof(double));
      task.F = FundamentalOf(*geometry, image1->second.camera, image2->second.camera);
      task.settings =
          fmt::format("{} geometry={:016x} points={:016x} cameras={}, {}", text,
                      task.F ? HashBytes(task.F->data(), 9 * sizeof(double)) : kEmptyHash,
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
      PairTask& task = tasks[i];
      task.matches = MatchSegments(options, images.at(task.pair.first).segments,
                                   images.at(task.pair.second).segments, task.points, task.F);
    });
    if (tasks.empty()) continue;
    Database::Transaction transaction(database);
    for (const PairTask& task : tasks) {
      database->WriteLineMatches(task.pair.first, task.pair.second, task.settings, task.matches);
      Take(task.pair, task.matches, &report, found);
    }
    transaction.Commit();
  }
  report.seconds = timer.Seconds();
  return report;
}

}  // namespace holba
