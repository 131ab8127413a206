// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/photo_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "holba/base/error.h"
#include "holba/geometry/angle.h"
#include "holba/group/known_types.h"
#include "holba/scene/ideal_view.h"

namespace holba {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

PhotoSetOptions SmallSet(PhotoSceneKind scene) {
  PhotoSetOptions options;
  options.scene = scene;
  options.num_images = 60;
  options.points_per_image = 400;
  options.seed = 3;
  return options;
}

// One of each kind, made once.
const PhotoSet& SetOf(PhotoSceneKind scene) {
  static std::map<PhotoSceneKind, PhotoSet> sets;
  const auto found = sets.find(scene);
  if (found != sets.end()) return found->second;
  return sets.emplace(scene, MakePhotoSet(SmallSet(scene))).first->second;
}

class EveryPhotoScene : public ::testing::TestWithParam<PhotoSceneKind> {};
INSTANTIATE_TEST_SUITE_P(Scenes, EveryPhotoScene,
                         ::testing::Values(PhotoSceneKind::kSphere, PhotoSceneKind::kStreet,
                                           PhotoSceneKind::kCollection),
                         [](const auto& info) -> std::string {
                           return info.param == PhotoSceneKind::kSphere   ? "Sphere"
                                  : info.param == PhotoSceneKind::kStreet ? "Street"
                                                                          : "Collection";
                         });

// Mean square over its expectation is within 5 standard deviations of 1 for normal values.
void ExpectNormal(const std::vector<double>& values, double sigma) {
  double sum = 0.0, squares = 0.0;
  for (const double x : values) {
    sum += x;
    squares += x * x;
  }
  const double n = static_cast<double>(values.size());
  ASSERT_GT(n, 1000);
  EXPECT_NEAR(squares / n / (sigma * sigma), 1.0, 5.0 * std::sqrt(2.0 / n));
  EXPECT_NEAR(sum / n / sigma, 0.0, 5.0 / std::sqrt(n));
}

point3D_t PointOf(const PhotoSet& set, image_t id, uint32_t idx) {
  return set.truth.images.at(id).points2D[idx].point3D_id;
}
line3D_t LineOf(const PhotoSet& set, image_t id, uint32_t idx) {
  return set.truth.images.at(id).lines2D[idx].line3D_id;
}

// Of the second keypoint from the epipolar line of the first, ideal pixels of the second image.
double EpipolarErrorPx(const PhotoSet& set, const PhotoSetPair& pair,
                       const std::array<point2D_t, 2>& match) {
  const IdealView view1(set.truth, pair.image_id1), view2(set.truth, pair.image_id2);
  const Eigen::Matrix3d E =
      CrossMatrix<double>(pair.cam2_from_cam1.translation) * pair.cam2_from_cam1.RotationMatrix();
  const auto x1 = view1.ToIdeal(set.images[pair.image_id1 - 1].keypoints.Position(match[0]));
  const auto x2 = view2.ToIdeal(set.images[pair.image_id2 - 1].keypoints.Position(match[1]));
  const Eigen::Vector3d line =
      view2.InverseK().transpose() * E * view1.InverseK() * x1->homogeneous();
  return std::abs(line.dot(x2->homogeneous())) / line.head<2>().norm();
}

size_t NumWrong(const std::vector<bool>& flags) {
  return static_cast<size_t>(std::count(flags.begin(), flags.end(), true));
}

TEST_P(EveryPhotoScene, TruthIsConsistentAndHasStructureOfEveryKind) {
  const Reconstruction& model = SetOf(GetParam()).truth;
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  EXPECT_EQ(model.images.size(), 60u);
  EXPECT_GT(model.points3D.size(), 1000u);
  EXPECT_GT(model.lines3D.size(), 100u);
  EXPECT_GT(model.wireframe.size(), 200u);
  size_t num_planes = 0, num_vps = 0;
  for (const auto& [id, group] : model.groups3D) {
    num_planes += IsPlane(*group.type);
    num_vps += IsVanishingPoint(*group.type);
  }
  EXPECT_GT(num_planes, 10u);
  EXPECT_EQ(num_vps, 3u);
  EXPECT_GT(model.relations.size(), num_planes);
}

TEST_P(EveryPhotoScene, ImagesHaveTheNumberOfKeypointsAskedFor) {
  size_t count = 0;
  for (const PhotoSetImage& image : SetOf(GetParam()).images) count += image.keypoints.size();
  EXPECT_NEAR(static_cast<double>(count) / 60.0, 400.0, 40.0);
}

TEST_P(EveryPhotoScene, KeypointsHaveTheNoiseAskedFor) {
  const Reconstruction& model = SetOf(GetParam()).truth;
  std::vector<double> errors;
  for (const auto& [id, point] : model.points3D) {
    for (const PointObservation& o : point.track) {
      const Image& image = model.images.at(o.image_id);
      const Camera& camera = model.cameras.at(image.camera_id);
      Eigen::Vector2d pixel;
      ASSERT_TRUE(
          camera.model->project(camera.params.data(), image.cam_from_world * point.xyz, &pixel));
      errors.push_back(pixel.x() - image.points2D[o.point2D_idx].xy.x());
      errors.push_back(pixel.y() - image.points2D[o.point2D_idx].xy.y());
    }
  }
  ExpectNormal(errors, PhotoSetOptions().point_noise_px);
}

TEST_P(EveryPhotoScene, EndsOfSegmentsHaveTheNoiseAskedForAcrossTheTrueLine) {
  if (GetParam() != PhotoSceneKind::kSphere) return;  // pixels of the others are distorted
  const Reconstruction& model = SetOf(GetParam()).truth;
  std::vector<double> errors;
  for (const auto& [id, line] : model.lines3D) {
    for (const LineObservation& o : line.track) {
      const IdealView view(model, o.image_id);
      const Eigen::Vector3d l = *view.Project(line.line);
      const LineSegment2d& segment = model.images.at(o.image_id).lines2D[o.line2D_idx].segment;
      errors.push_back(l.dot(segment.start.homogeneous()));
      errors.push_back(l.dot(segment.end.homogeneous()));
    }
  }
  ExpectNormal(errors, PhotoSetOptions().segment_noise_px);
}

TEST_P(EveryPhotoScene, SegmentsOfOneLineRunInOneDirection) {
  const Reconstruction& model = SetOf(GetParam()).truth;
  for (const auto& [id, line] : model.lines3D) {
    for (const LineObservation& o : line.track) {
      const Image& image = model.images.at(o.image_id);
      const Camera& camera = model.cameras.at(image.camera_id);
      const LineSegment2d& segment = image.lines2D[o.line2D_idx].segment;
      // A point of the line that is in the image, and one a little further along it.
      const Eigen::Vector3d middle = 0.5 * (line.start + line.end);
      const Eigen::Vector3d in_cam = image.cam_from_world * middle;
      const Eigen::Vector3d step = 0.01 * (image.cam_from_world.rotation * line.line.direction);
      Eigen::Vector2d a, b;
      if (in_cam.z() < 0.5 || !camera.model->project(camera.params.data(), in_cam, &a) ||
          !camera.model->project(camera.params.data(), in_cam + step, &b)) {
        continue;
      }
      EXPECT_GT((segment.end - segment.start).normalized().dot((b - a).normalized()), 0.5);
    }
  }
}

TEST_P(EveryPhotoScene, TracksAreAsLongAsAskedFor) {
  const VisibilityOptions options;
  const Reconstruction& model = SetOf(GetParam()).truth;
  double sum = 0.0;
  for (const auto& [id, point] : model.points3D) {
    EXPECT_GE(point.track.size(), 2u);
    EXPECT_LE(point.track.size(), static_cast<size_t>(options.max_track_length));
    sum += static_cast<double>(point.track.size());
  }
  // Where fewer views see a feature its track is shorter; those below two are left out.
  const double mean = sum / static_cast<double>(model.points3D.size());
  EXPECT_GT(mean, 0.4 * options.mean_track_length);
  EXPECT_LT(mean, 1.15 * options.mean_track_length);
}

TEST_P(EveryPhotoScene, MatchesAreRightButForTheShareThatIsSaidToBeWrong) {
  const PhotoSet& set = SetOf(GetParam());
  size_t num_right = 0, num_wrong = 0;
  for (const PhotoSetPair& pair : set.pairs) {
    ASSERT_FALSE(pair.is_wrong);
    ASSERT_TRUE(std::is_sorted(pair.matches.begin(), pair.matches.end()));
    ASSERT_EQ(pair.matches.size(), pair.is_wrong_match.size());
    EXPECT_GE(pair.matches.size(), 15u);
    for (size_t i = 0; i < pair.matches.size(); ++i) {
      const point3D_t point1 = PointOf(set, pair.image_id1, pair.matches[i][0]);
      const point3D_t point2 = PointOf(set, pair.image_id2, pair.matches[i][1]);
      const double error_px = EpipolarErrorPx(set, pair, pair.matches[i]);
      if (pair.is_wrong_match[i]) {
        EXPECT_TRUE(point1 != point2 || point1 == kNoId);
        EXPECT_LE(error_px, kWrongMatchMaxErrorPx);
      } else {
        EXPECT_NE(point1, kNoId);
        EXPECT_EQ(point1, point2);
      }
    }
    num_wrong += NumWrong(pair.is_wrong_match);
    num_right += pair.matches.size() - NumWrong(pair.is_wrong_match);
  }
  const double share = PhotoSetOptions().wrong_matches;
  EXPECT_NEAR(static_cast<double>(num_wrong), share / (1.0 - share) * num_right, 0.51);
  EXPECT_GT(num_wrong, 100u);
}

TEST_P(EveryPhotoScene, EveryKeypointIsInOneVerifiedMatchOfAPair) {
  for (const PhotoSetPair& pair : SetOf(GetParam()).pairs) {
    for (const PointMatches* matches : {&pair.matches, &pair.raw_matches}) {
      for (const int side : {0, 1}) {
        std::vector<uint32_t> idxs;
        for (const auto& match : *matches) idxs.push_back(match[side]);
        std::sort(idxs.begin(), idxs.end());
        EXPECT_EQ(std::adjacent_find(idxs.begin(), idxs.end()), idxs.end());
      }
    }
    EXPECT_TRUE(std::includes(pair.raw_matches.begin(), pair.raw_matches.end(),
                              pair.matches.begin(), pair.matches.end()));
  }
}

TEST_P(EveryPhotoScene, LineMatchesAreRightButForTheShareThatIsSaidToBeWrong) {
  const PhotoSet& set = SetOf(GetParam());
  size_t num_right = 0, num_wrong = 0;
  for (const PhotoSetPair& pair : set.pairs) {
    ASSERT_EQ(pair.line_matches.size(), pair.is_wrong_line_match.size());
    for (size_t i = 0; i < pair.line_matches.size(); ++i) {
      const line3D_t line1 = LineOf(set, pair.image_id1, pair.line_matches[i].idx1);
      const line3D_t line2 = LineOf(set, pair.image_id2, pair.line_matches[i].idx2);
      EXPECT_EQ(pair.is_wrong_line_match[i], line1 != line2 || line1 == kNoId);
    }
    num_wrong += NumWrong(pair.is_wrong_line_match);
    num_right += pair.line_matches.size() - NumWrong(pair.is_wrong_line_match);
  }
  const double share = PhotoSetOptions().wrong_line_matches;
  EXPECT_NEAR(static_cast<double>(num_wrong), share / (1.0 - share) * num_right, 0.51);
}

TEST_P(EveryPhotoScene, VanishingPointsAreTheAxesThatTheirSegmentsAreParallelTo) {
  const PhotoSet& set = SetOf(GetParam());
  std::map<line3D_t, Eigen::Vector3d> direction;
  for (const auto& [id, line] : set.truth.lines3D) direction[id] = line.line.direction;
  std::vector<double> errors_deg;
  for (const auto& [id, image] : set.truth.images) {
    const PhotoSetImage& features = set.images[id - 1];
    ASSERT_EQ(features.vp_of_segment.size(), features.segments.size());
    std::vector<uint32_t> counts(features.vanishing_points.size());
    for (size_t i = 0; i < features.segments.size(); ++i) {
      const int32_t vp = features.vp_of_segment[i];
      if (vp < 0) continue;
      ++counts[vp];
      const line3D_t line = image.lines2D[i].line3D_id;
      if (line == kNoId) continue;
      const Eigen::Vector3d in_cam = image.cam_from_world.rotation * direction.at(line);
      const Eigen::Vector3d& found = features.vanishing_points[vp].direction_in_cam;
      EXPECT_NEAR(found.norm(), 1.0, 1e-9);
      errors_deg.push_back(
          RadToDeg(std::atan2(in_cam.cross(found).norm(), std::abs(in_cam.dot(found)))));
    }
    for (size_t v = 0; v < counts.size(); ++v)
      EXPECT_EQ(counts[v], features.vanishing_points[v].num_segments);
  }
  std::nth_element(errors_deg.begin(), errors_deg.begin() + errors_deg.size() / 2,
                   errors_deg.end());
  EXPECT_LT(errors_deg[errors_deg.size() / 2], 0.5);
}

TEST_P(EveryPhotoScene, KeypointsOfAPlaneHaveItsLabel) {
  const PhotoSet& set = SetOf(GetParam());
  std::map<point3D_t, group3D_t> plane_of;
  for (const auto& [id, group] : set.truth.groups3D) {
    if (!IsPlane(*group.type)) continue;
    for (const point3D_t point : group.point3D_ids) plane_of[point] = id;
  }
  size_t num_same = 0, num_all = 0;
  for (const auto& [id, image] : set.truth.images) {
    const LabelMap& map = set.images[id - 1].label_map;
    const Camera& camera = set.truth.cameras.at(image.camera_id);
    // Only planes with three keypoints are labelled.
    std::map<group3D_t, size_t> num_keypoints;
    for (const Point2D& point : image.points2D) {
      const auto plane = plane_of.find(point.point3D_id);
      if (point.point3D_id != kNoId && plane != plane_of.end()) ++num_keypoints[plane->second];
    }
    // The plane of each label is the one that most of its keypoints lie in.
    std::map<uint16_t, std::map<group3D_t, size_t>> planes;
    for (const Point2D& point : image.points2D) {
      const auto plane = plane_of.find(point.point3D_id);
      if (point.point3D_id == kNoId || plane == plane_of.end()) continue;
      if (num_keypoints[plane->second] < 3) continue;
      const int x = static_cast<int>(point.xy.x() / camera.width * map.width);
      const int y = static_cast<int>(point.xy.y() / camera.height * map.height);
      if (x < 0 || y < 0 || x >= map.width || y >= map.height) continue;
      ++planes[map.labels[static_cast<size_t>(y) * map.width + x]][plane->second];
      ++num_all;
    }
    for (const auto& [label, counts] : planes) {
      if (label == 0) continue;
      EXPECT_EQ(map.types.at(label), &PlaneType());
      size_t most = 0;
      for (const auto& [plane, count] : counts) most = std::max(most, count);
      num_same += most;
    }
  }
  EXPECT_GT(num_all, 1000u);
  EXPECT_GT(static_cast<double>(num_same), 0.9 * static_cast<double>(num_all));
}

TEST(PhotoSet, MissingMatchesAreTheShareAskedFor) {
  PhotoSetOptions options = SmallSet(PhotoSceneKind::kSphere);
  options.wrong_matches = options.wrong_line_matches = 0.0;
  options.missing_matches = 0.0;
  const PhotoSet whole = MakePhotoSet(options);
  options.missing_matches = 0.35;
  const PhotoSet part = MakePhotoSet(options);
  std::map<ImagePair, const PhotoSetPair*> whole_pairs;
  for (const PhotoSetPair& pair : whole.pairs)
    whole_pairs[{pair.image_id1, pair.image_id2}] = &pair;
  size_t num_whole = 0, num_part = 0;
  for (const PhotoSetPair& pair : part.pairs) {
    const auto found = whole_pairs.find({pair.image_id1, pair.image_id2});
    ASSERT_NE(found, whole_pairs.end());
    num_whole += found->second->matches.size();
    num_part += pair.matches.size();
    EXPECT_TRUE(std::includes(found->second->matches.begin(), found->second->matches.end(),
                              pair.matches.begin(), pair.matches.end()));
  }
  EXPECT_NEAR(static_cast<double>(num_part), 0.65 * static_cast<double>(num_whole), 0.51);
}

TEST_P(EveryPhotoScene, WrongPairsAreTheShareAskedForAndAgreeWithOneWrongPose) {
  PhotoSetOptions options = SmallSet(GetParam());
  options.num_images = 100;
  options.points_per_image = 600;
  options.wrong_pairs = 0.03;
  const PhotoSet set = MakePhotoSet(options);
  size_t num_wrong = 0;
  for (const PhotoSetPair& pair : set.pairs) {
    if (!pair.is_wrong) continue;
    ++num_wrong;
    EXPECT_GE(pair.matches.size(), 15u);
    const Rigid3d truth = set.truth.images.at(pair.image_id2).cam_from_world *
                          set.truth.images.at(pair.image_id1).cam_from_world.Inverse();
    EXPECT_GT((truth.translation - pair.cam2_from_cam1.translation).norm(), 0.1);
    std::vector<double> errors_px;
    for (const auto& match : pair.matches) {
      EXPECT_TRUE(PointOf(set, pair.image_id1, match[0]) == kNoId ||
                  PointOf(set, pair.image_id1, match[0]) != PointOf(set, pair.image_id2, match[1]));
      errors_px.push_back(EpipolarErrorPx(set, pair, match));
    }
    std::sort(errors_px.begin(), errors_px.end());
    // The noise of both ends, wherever the epipole is.
    EXPECT_LT(errors_px[errors_px.size() / 2], 2.0);
  }
  const double num_right = static_cast<double>(set.pairs.size() - num_wrong);
  EXPECT_NEAR(static_cast<double>(num_wrong), 0.03 / 0.97 * num_right, 0.51);
  EXPECT_GT(num_wrong, 5u);
}

TEST(PhotoSet, ImagesOfAStreetAreMatchedWithTheNextOnesAndWithLaterVisits) {
  const PhotoSet& set = SetOf(PhotoSceneKind::kStreet);
  size_t num_later = 0;
  for (const PhotoSetPair& pair : set.pairs) {
    const uint32_t apart = pair.image_id2 - pair.image_id1;
    EXPECT_TRUE(apart <= 10 || apart >= 50);
    num_later += apart >= 50;
  }
  EXPECT_GT(num_later, 3u);
}

TEST(PhotoSet, CamerasAreKnownAsFarAsTheOptionSays) {
  PhotoSetOptions options = SmallSet(PhotoSceneKind::kCollection);
  for (const FocalLengthPrior prior :
       {FocalLengthPrior::kExact, FocalLengthPrior::kExif, FocalLengthPrior::kUnknown}) {
    options.focal_length = prior;
    const PhotoSet set = MakePhotoSet(options);
    ASSERT_EQ(set.cameras.size(), 60u);
    std::vector<double> errors;
    for (size_t k = 0; k < set.cameras.size(); ++k) {
      const Camera& truth = set.truth.cameras.at(static_cast<camera_t>(k + 1));
      const PhotoSetCamera& known = set.cameras[k];
      EXPECT_EQ(known.has_prior_focal_length, prior != FocalLengthPrior::kUnknown);
      if (prior == FocalLengthPrior::kExact) {
        EXPECT_EQ(known.camera.params, truth.params);
        continue;
      }
      EXPECT_EQ(known.camera.params[3], 0.0);
      if (prior == FocalLengthPrior::kUnknown) {
        EXPECT_EQ(known.camera.params[0], 1.2 * std::max(truth.width, truth.height));
      } else {
        errors.push_back(known.camera.params[0] / truth.params[0] - 1.0);
      }
    }
    double squares = 0.0;
    for (const double e : errors) squares += e * e;
    if (!errors.empty()) {
      EXPECT_NEAR(std::sqrt(squares / static_cast<double>(errors.size())), 0.03, 0.012);
    }
  }
}

bool AreEqual(const PhotoSet& a, const PhotoSet& b) {
  if (a.pairs.size() != b.pairs.size() || a.images.size() != b.images.size()) return false;
  for (size_t k = 0; k < a.pairs.size(); ++k) {
    if (a.pairs[k].raw_matches != b.pairs[k].raw_matches) return false;
    if (a.pairs[k].is_wrong_match != b.pairs[k].is_wrong_match) return false;
    if (a.pairs[k].line_matches.size() != b.pairs[k].line_matches.size()) return false;
  }
  for (size_t i = 0; i < a.images.size(); ++i) {
    if (a.images[i].keypoints.data != b.images[i].keypoints.data) return false;
    if (a.images[i].label_map.labels != b.images[i].label_map.labels) return false;
    if (a.images[i].vp_of_segment != b.images[i].vp_of_segment) return false;
  }
  return true;
}

TEST_P(EveryPhotoScene, IsTheSameForAnyNumberOfThreadsAndAnotherForAnotherSeed) {
  PhotoSetOptions options = SmallSet(GetParam());
  options.num_threads = 3;
  EXPECT_TRUE(AreEqual(MakePhotoSet(options), SetOf(GetParam())));
  options.seed = 4;
  EXPECT_FALSE(AreEqual(MakePhotoSet(options), SetOf(GetParam())));
}

TEST(PhotoSet, RefusesWhatTheSceneCannotGive) {
  PhotoSetOptions options = SmallSet(PhotoSceneKind::kStreet);
  options.wrong_pairs = 0.5;
  EXPECT_THAT([&] { MakePhotoSet(options); },
              ThrowsMessage<InputError>(HasSubstr("--Database.wrong_pairs: expected at most 0.")));
  options = SmallSet(PhotoSceneKind::kStreet);
  options.num_images = 49;
  EXPECT_THAT([&] { MakePhotoSet(options); }, ThrowsMessage<InputError>(HasSubstr("at least 50")));
}

}  // namespace
}  // namespace holba
