// SPDX-License-Identifier: BSD-3-Clause
#include "apps/synthesize/photo_database.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "apps/temporary_folder_testing.h"
#include "holba/geometry/angle.h"
#include "holba/scene/ideal_view.h"

namespace holba {
namespace {

namespace fs = std::filesystem;

PhotoSetOptions SmallSet(PhotoSceneKind scene) {
  PhotoSetOptions options;
  options.scene = scene;
  options.num_images = 50;
  options.points_per_image = 300;
  return options;
}

using PhotoDatabase = TemporaryFolderTest;

Rigid3d TruthOf(const PhotoSet& set, const PhotoSetPair& pair) {
  return set.truth.images.at(pair.image_id2).cam_from_world *
         set.truth.images.at(pair.image_id1).cam_from_world.Inverse();
}

double RotationErrorDeg(const Rigid3d& a, const Rigid3d& b) {
  return RadToDeg(a.rotation.angularDistance(b.rotation));
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

// Squared Sampson distances of the matches, px^2 of the pixels that F is of.
std::vector<double> SampsonErrors(const PhotoSet& set, const PhotoSetPair& pair,
                                  const Eigen::Matrix3d& F) {
  std::vector<double> errors;
  for (size_t i = 0; i < pair.matches.size(); ++i) {
    if (pair.is_wrong_match[i]) continue;
    const auto [idx1, idx2] = pair.matches[i];
    const Eigen::Vector3d x1 =
        set.images[pair.image_id1 - 1].keypoints.Position(idx1).homogeneous();
    const Eigen::Vector3d x2 =
        set.images[pair.image_id2 - 1].keypoints.Position(idx2).homogeneous();
    const Eigen::Vector3d l2 = F * x1, l1 = F.transpose() * x2;
    const double c = x2.dot(l2);
    errors.push_back(c * c / (l1.head<2>().squaredNorm() + l2.head<2>().squaredNorm()));
  }
  return errors;
}

TEST_F(PhotoDatabase, TrueGeometriesFitTheirMatchesAsTheNoiseAllows) {
  PhotoSetOptions options = SmallSet(PhotoSceneKind::kSphere);
  for (const FocalLengthPrior prior : {FocalLengthPrior::kExact, FocalLengthPrior::kUnknown}) {
    SCOPED_TRACE(static_cast<int>(prior));
    options.focal_length = prior;
    const PhotoSet set = MakePhotoSet(options);
    double sum = 0.0, count = 0.0;
    for (const PhotoSetPair& pair : set.pairs) {
      const TwoViewGeometry geometry = GeometryOf(set, pair, GeometrySource::kTruth);
      EXPECT_EQ(geometry.inlier_matches, pair.matches);
      ASSERT_TRUE(geometry.F);
      EXPECT_EQ(geometry.E.has_value(), prior == FocalLengthPrior::kExact);
      EXPECT_EQ(geometry.cam2_from_cam1.has_value(), prior == FocalLengthPrior::kExact);
      // The fit has taken 5 or 7 of the degrees of freedom; wrong matches pull at it a little.
      for (const double squared_px : SampsonErrors(set, pair, *geometry.F)) sum += squared_px;
      count += static_cast<double>(pair.matches.size()) - 6.0;
    }
    EXPECT_NEAR(std::sqrt(sum / count), options.point_noise_px, 0.1 * options.point_noise_px);
  }
}

TEST_F(PhotoDatabase, TrueAndEstimatedGeometriesAreNearTheTruePose) {
  for (const PhotoSceneKind scene : {PhotoSceneKind::kSphere, PhotoSceneKind::kStreet}) {
    const PhotoSet set = MakePhotoSet(SmallSet(scene));
    std::vector<double> fitted_deg, estimated_deg, kept;
    for (size_t k = 0; k < set.pairs.size(); k += 5) {
      const PhotoSetPair& pair = set.pairs[k];
      const TwoViewGeometry fitted = GeometryOf(set, pair, GeometrySource::kTruth);
      const TwoViewGeometry estimated = GeometryOf(set, pair, GeometrySource::kEstimated);
      const Rigid3d truth = TruthOf(set, pair);
      ASSERT_TRUE(fitted.cam2_from_cam1);
      fitted_deg.push_back(RotationErrorDeg(*fitted.cam2_from_cam1, truth));
      if (!estimated.cam2_from_cam1) continue;
      estimated_deg.push_back(RotationErrorDeg(*estimated.cam2_from_cam1, truth));
      kept.push_back(static_cast<double>(estimated.inlier_matches.size()) /
                     static_cast<double>(pair.matches.size()));
    }
    EXPECT_LT(Median(fitted_deg), 0.5);
    EXPECT_LT(Median(estimated_deg), 0.5);
    EXPECT_GT(estimated_deg.size(), 0.9 * static_cast<double>(fitted_deg.size()));
    // What the set calls verified is what verification keeps.
    EXPECT_NEAR(Median(kept), 1.0, 0.05);
  }
}

TEST_F(PhotoDatabase, WrongPairsHaveTheWrongPoseTheirMatchesAgreeWith) {
  PhotoSetOptions options = SmallSet(PhotoSceneKind::kCollection);
  options.wrong_pairs = 0.05;
  const PhotoSet set = MakePhotoSet(options);
  std::vector<double> to_wrong_deg;
  for (const PhotoSetPair& pair : set.pairs) {
    if (!pair.is_wrong) continue;
    const TwoViewGeometry geometry = GeometryOf(set, pair, GeometrySource::kTruth);
    ASSERT_TRUE(geometry.cam2_from_cam1);
    to_wrong_deg.push_back(RotationErrorDeg(*geometry.cam2_from_cam1, pair.cam2_from_cam1));
  }
  ASSERT_GT(to_wrong_deg.size(), 3u);
  EXPECT_LT(Median(to_wrong_deg), 1.0);
}

TEST_F(PhotoDatabase, HoldsTheSetAndIsTheSameByteForByte) {
  const PhotoSet set = MakePhotoSet(SmallSet(PhotoSceneKind::kStreet));
  const auto write = [&](const fs::path& path, int num_threads) {
    {
      Database database(path);
      const PhotoDatabaseReport report =
          WritePhotoDatabase(set, GeometrySource::kTruth, num_threads, &database);
      EXPECT_EQ(report.num_pairs, set.pairs.size());
    }
    std::ifstream file(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  EXPECT_EQ(write(folder_ / "a.db", 1), write(folder_ / "b.db", 3));

  const Database database(folder_ / "a.db");
  const std::string settings(kSyntheticSettings);
  EXPECT_EQ(database.ReadCameras().size(), 1u);
  ASSERT_EQ(database.ReadImages().size(), 50u);
  for (const auto& [id, image] : set.truth.images) {
    const PhotoSetImage& features = set.images[id - 1];
    EXPECT_EQ(database.FindImage(image.name), id);
    EXPECT_EQ(database.ReadKeypoints(id)->data, features.keypoints.data);
    EXPECT_EQ(database.ReadSegmentSettings(id), settings);
    EXPECT_EQ(database.ReadSegments(id, settings)->size(), features.segments.size());
    EXPECT_EQ(database.ReadVanishingPoints(id, settings)->vp_of_segment, features.vp_of_segment);
    EXPECT_EQ(database.ReadLabelMap(id, settings)->labels, features.label_map.labels);
  }
  ASSERT_EQ(database.VerifiedPairs(1).size(), set.pairs.size());
  for (const PhotoSetPair& pair : set.pairs) {
    const image_t id1 = pair.image_id1, id2 = pair.image_id2;
    EXPECT_EQ(database.ReadMatches(id1, id2), pair.raw_matches);
    EXPECT_EQ(database.ReadTwoViewGeometry(id1, id2)->inlier_matches, pair.matches);
    EXPECT_EQ(database.ReadLineMatches(id1, id2, settings)->size(), pair.line_matches.size());
  }
}

}  // namespace
}  // namespace holba
