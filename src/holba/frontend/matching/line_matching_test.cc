// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/line_matching.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <fstream>
#include <iostream>
#include <map>
#include <numbers>
#include <set>
#include <sstream>

#include "holba/base/data_testing.h"
#include "holba/base/random.h"
#include "holba/frontend/detectors/lbd_descriptor.h"
#include "holba/frontend/detectors/segment_refinement.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/scene/ideal_view.h"

namespace holba {
namespace {

using ::testing::ElementsAre;

const CameraModel* Pinhole() { return FindCameraModel("PINHOLE"); }

Camera TestCamera() { return {Pinhole(), 640, 480, {500, 500, 320, 240}}; }

// A descriptor with one main direction and a little of another.
void AddDescriptor(int main, float other, ImageFeatures* features) {
  Eigen::VectorXf d = Eigen::VectorXf::Zero(kSegmentDescriptorSize);
  d[main] = 1.0f;
  d[(main + 1) % kSegmentDescriptorSize] = other;
  d.normalize();
  features->segment_descriptors.insert(features->segment_descriptors.end(), d.data(),
                                       d.data() + d.size());
}

std::vector<std::pair<line2D_t, line2D_t>> Pairs(const std::vector<LineMatch>& matches) {
  std::vector<std::pair<line2D_t, line2D_t>> pairs;
  for (const LineMatch& match : matches) pairs.emplace_back(match.idx1, match.idx2);
  return pairs;
}

// Vertical segments in a row, all looking the same, in two images shifted by `shift`.
struct Row {
  ImageFeatures features1, features2;
  std::vector<SharedPoint> points;
};
Row MakeRow(int count, const Eigen::Vector2d& shift) {
  Row row;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d foot(60.0 + 50.0 * i, 200.0), top = foot - Eigen::Vector2d(0, 60);
    row.features1.segments.push_back({foot, top});
    row.features2.segments.push_back({foot + shift, top + shift});
    AddDescriptor(3, 0.1f, &row.features1);
    AddDescriptor(3, 0.1f, &row.features2);
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector2d p = foot + Eigen::Vector2d(6.0 + 3.0 * k, -20.0 * k);
      row.points.emplace_back(p, p + shift);
    }
  }
  return row;
}

TEST(LineMatching, PointsTellRepeatedSegmentsApart) {
  const Row row = MakeRow(8, {70.0, 5.0});
  const auto segments1 = MakeMatchable(row.features1, TestCamera());
  const auto segments2 = MakeMatchable(row.features2, TestCamera());
  // Without points all are alike: no nearest is nearer than the next.
  EXPECT_TRUE(
      MutualNearest(MatchSegments({}, segments1, segments2, {}, std::nullopt), 0.9).empty());
  const auto mutual =
      MutualNearest(MatchSegments({}, segments1, segments2, row.points, std::nullopt), 0.9);
  ASSERT_EQ(mutual.size(), 8u);
  for (const LineMatch& match : mutual) EXPECT_EQ(match.idx1, match.idx2);
}

TEST(LineMatching, TheNearestPointsTellWhereASegmentIsHoweverFarTheyAre) {
  Row row = MakeRow(8, {70.0, 5.0});
  // 70 pixels above the segments.
  for (auto& [p1, p2] : row.points) {
    p1.y() -= 130.0;
    p2.y() -= 130.0;
  }
  const auto segments1 = MakeMatchable(row.features1, TestCamera());
  const auto segments2 = MakeMatchable(row.features2, TestCamera());
  EXPECT_TRUE(MutualNearest(MatchSegments({}, segments1, segments2, row.points, std::nullopt), 0.9)
                  .empty());
  const LineMatchingOptions options{.num_near_points = 3};
  const auto mutual =
      MutualNearest(MatchSegments(options, segments1, segments2, row.points, std::nullopt), 0.9);
  ASSERT_EQ(mutual.size(), 8u);
  for (const LineMatch& match : mutual) EXPECT_EQ(match.idx1, match.idx2);
  // Fewer points than that change nothing.
  row.points.resize(2);
  EXPECT_EQ(Pairs(MatchSegments(options, segments1, segments2, row.points, std::nullopt)),
            Pairs(MatchSegments({}, segments1, segments2, row.points, std::nullopt)));
}

TEST(LineMatching, KeepsTheNearestOfEachSegmentOfBothImages) {
  const Row row = MakeRow(8, {0.0, 0.0});
  LineMatchingOptions options;
  options.num_matches = 1;
  // Same distances: the first one is each segment's nearest, from both sides.
  const auto matches = MatchSegments(options, MakeMatchable(row.features1, TestCamera()),
                                     MakeMatchable(row.features2, TestCamera()), {}, std::nullopt);
  std::set<line2D_t> of1, of2;
  for (const LineMatch& match : matches) {
    of1.insert(match.idx1);
    of2.insert(match.idx2);
  }
  EXPECT_EQ(of1.size(), 8u);
  EXPECT_EQ(of2.size(), 8u);
  EXPECT_EQ(matches.size(), 15u);
}

TEST(LineMatching, LooksDirectionAndRotationDecide) {
  // Turned by a quarter as a whole: segments still match; one turned in itself does not.
  Row row = MakeRow(6, {0.0, 0.0});
  row.features1.segment_descriptors.clear();
  row.features2.segment_descriptors.clear();
  for (int i = 0; i < 6; ++i) {
    AddDescriptor(10 * i, 0.1f, &row.features1);
    AddDescriptor(10 * i, 0.2f, &row.features2);
  }
  const Eigen::Rotation2Dd turn(std::numbers::pi / 2);
  for (LineSegment2d& segment : row.features2.segments)
    segment = {turn * segment.start, turn * segment.end};
  for (SharedPoint& point : row.points) point.second = turn * point.second;
  std::swap(row.features2.segments[4].start, row.features2.segments[4].end);
  const auto matches =
      MatchSegments({}, MakeMatchable(row.features1, TestCamera()),
                    MakeMatchable(row.features2, TestCamera()), row.points, std::nullopt);
  EXPECT_THAT(Pairs(matches), ElementsAre(std::pair(0, 0), std::pair(1, 1), std::pair(2, 2),
                                          std::pair(3, 3), std::pair(5, 5)));
  LineMatchingOptions any_rotation;
  any_rotation.max_rotation_deg = 180.0;
  EXPECT_EQ(MatchSegments(any_rotation, MakeMatchable(row.features1, TestCamera()),
                          MakeMatchable(row.features2, TestCamera()), row.points, std::nullopt)
                .size(),
            6u);
}

// Two views of random segments, all looking the same.
TEST(LineMatching, EpipolarGeometryKeepsTheRightAndRefusesMostOthers) {
  Reconstruction model;
  model.cameras.Add(1, TestCamera());
  for (image_t id : {1u, 2u}) {
    Image image;
    image.name = std::to_string(id);
    image.camera_id = 1;
    image.cam_from_world.translation = Eigen::Vector3d(id == 1 ? 0.0 : -0.6, 0.1 * id, 0.05 * id);
    model.images.Add(id, image);
  }
  const IdealView view1(model, 1), view2(model, 2);
  Random random(3);
  ImageFeatures features1, features2;
  while (features1.segments.size() < 60) {
    const auto near = [&](const Eigen::Vector3d& p, double r) -> Eigen::Vector3d {
      return p +
             Eigen::Vector3d(random.Uniform(-r, r), random.Uniform(-r, r), random.Uniform(-r, r));
    };
    const Eigen::Vector3d a = near({0, 0, 5}, 1.5), b = near(a, 0.5);
    // The second image sees another part of each, a pixel off.
    const auto a1 = view1.Project(a), b1 = view1.Project(b);
    const auto a2 = view2.Project(a + 0.2 * (b - a)), b2 = view2.Project(a + 1.1 * (b - a));
    if ((*a1 - *b1).norm() < 15 || (*a2 - *b2).norm() < 15) continue;
    features1.segments.push_back({*a1, *b1});
    features2.segments.push_back({*a2 + Eigen::Vector2d(0.4, -0.3), *b2});
    AddDescriptor(3, 0.1f, &features1);
    AddDescriptor(3, 0.1f, &features2);
  }
  LineMatchingOptions options;
  options.num_matches = 60;
  const auto matches = MatchSegments(options, MakeMatchable(features1, model.cameras.at(1)),
                                     MakeMatchable(features2, model.cameras.at(1)), {},
                                     FundamentalMatrix(view1, view2));
  int num_right = 0;
  for (const LineMatch& match : matches) num_right += match.idx1 == match.idx2;
  EXPECT_EQ(num_right, 60);
  EXPECT_LT(matches.size(), 60u * 60u / 3u);
}

// Mean of what MutualNearest finds and of what is among the candidates, judged by the tracks of a
// holistic model: lines seen in four or more images.
struct Score {
  size_t num_pairs = 0, num_right = 0, num_wrong = 0, num_lines = 0, num_found = 0, num_listed = 0;
  double Precision() const { return static_cast<double>(num_right) / (num_right + num_wrong); }
  double Recall() const { return static_cast<double>(num_found) / num_lines; }
  double Listed() const { return static_cast<double>(num_listed) / num_lines; }
};

// The text of a holistic model, as far as needed here; the room knows no files of models.
struct StudyImage {
  std::string name;
  MatchableSegments segments;
  std::vector<line3D_t> line3D_ids;
  std::map<point3D_t, Eigen::Vector2d> points;
};
struct StudySet {
  Reconstruction model;  // camera and poses
  std::map<image_t, StudyImage> images;
};

std::vector<std::string> Records(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<std::string> records;
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with('#')) records.push_back(line);
  }
  return records;
}

StudySet ReadStudy(const std::filesystem::path& folder) {
  StudySet set;
  const std::filesystem::path model_folder = folder / "holistic";
  {
    std::istringstream in(Records(model_folder / "cameras.txt").at(0));
    Camera camera;
    camera_t id;
    std::string model;
    in >> id >> model >> camera.width >> camera.height;
    camera.model = FindCameraModel(model);
    for (double param; in >> param;) camera.params.push_back(param);
    set.model.cameras.Add(id, camera);
  }
  // Points that the study made from segments would make it too easy.
  std::set<point3D_t> junctions;
  for (const std::string& record : Records(model_folder / "wireframe.txt"))
    junctions.insert(std::stoull(record));
  const auto images = Records(model_folder / "images.txt");
  for (size_t i = 0; i + 1 < images.size(); i += 2) {
    Image image;
    image_t id;
    std::istringstream in(images[i]);
    Eigen::Quaterniond& q = image.cam_from_world.rotation;
    Eigen::Vector3d& t = image.cam_from_world.translation;
    in >> id >> q.w() >> q.x() >> q.y() >> q.z() >> t.x() >> t.y() >> t.z() >> image.camera_id >>
        image.name;
    set.images[id].name = image.name;
    set.model.images.Add(id, image);
    std::istringstream points(images[i + 1]);
    double x, y;
    for (int64_t point_id; points >> x >> y >> point_id;) {
      if (point_id >= 0 && !junctions.contains(point_id)) set.images[id].points[point_id] = {x, y};
    }
  }
  for (const std::string& record : Records(model_folder / "lines2D.txt")) {
    std::istringstream in(record);
    image_t id;
    size_t count;
    in >> id >> count;
    StudyImage& image = set.images.at(id);
    ImageFeatures features;
    LineSegment2d s;
    for (int64_t line_id; in >> s.start.x() >> s.start.y() >> s.end.x() >> s.end.y() >> line_id;) {
      features.segments.push_back(s);
      image.line3D_ids.push_back(line_id < 0 ? kNoId : line_id);
    }
    EXPECT_EQ(features.segments.size(), count);
    const GradientImage gradients(ReadGreyImage(folder / "images" / image.name), 0.5);
    OrientSegments(gradients, &features.segments);
    features.segment_descriptors = DescribeSegments(gradients, features.segments);
    image.segments = MakeMatchable(features, set.model.cameras.begin()->second);
  }
  return set;
}

Score MatchStudy(const StudySet& set, size_t hop, bool with_geometry) {
  Score score;
  std::vector<image_t> ids;
  for (const auto& [id, image] : set.images) ids.push_back(id);
  for (size_t i = 0; i + hop < ids.size(); ++i) {
    const StudyImage& image1 = set.images.at(ids[i]);
    const StudyImage& image2 = set.images.at(ids[i + hop]);
    std::vector<SharedPoint> points;
    for (const auto& [id, position] : image1.points) {
      const auto other = image2.points.find(id);
      if (other != image2.points.end()) points.emplace_back(position, other->second);
    }
    std::optional<Eigen::Matrix3d> F;
    if (with_geometry) {
      F = FundamentalMatrix(IdealView(set.model, ids[i]), IdealView(set.model, ids[i + hop]));
    }
    const auto matches = MatchSegments({}, image1.segments, image2.segments, points, F);
    const std::set<line3D_t> lines1(image1.line3D_ids.begin(), image1.line3D_ids.end());
    std::set<line3D_t> both, found, listed;
    for (const line3D_t id : image2.line3D_ids) {
      if (id != kNoId && lines1.contains(id)) both.insert(id);
    }
    for (const LineMatch& match : matches) {
      const line3D_t id = image1.line3D_ids[match.idx1];
      if (id != kNoId && id == image2.line3D_ids[match.idx2]) listed.insert(id);
    }
    for (const LineMatch& match : MutualNearest(matches, 0.9)) {
      const line3D_t id1 = image1.line3D_ids[match.idx1], id2 = image2.line3D_ids[match.idx2];
      if (id1 == kNoId || id2 == kNoId) continue;
      (id1 == id2 ? score.num_right : score.num_wrong) += 1;
      if (id1 == id2) found.insert(id1);
    }
    ++score.num_pairs;
    score.num_lines += both.size();
    score.num_found += found.size();
    score.num_listed += listed.size();
  }
  return score;
}

TEST(LineMatching, FindsTheLinesOfAFacadeFromPointsAlone) {
  HOLBA_SKIP_WITHOUT_DATA();
  const StudySet set = ReadStudy(DataFolder() / "entry_p10");
  const Score next = MatchStudy(set, 1, false), fourth = MatchStudy(set, 4, false);
  EXPECT_EQ(next.num_pairs, 9u);
  EXPECT_GT(next.Precision(), 0.96);
  EXPECT_GT(next.Recall(), 0.85);
  EXPECT_GT(next.Listed(), 0.97);
  EXPECT_GT(fourth.Precision(), 0.87);
  EXPECT_GT(fourth.Recall(), 0.55);
  const Score with_geometry = MatchStudy(set, 4, true);
  EXPECT_GT(with_geometry.Recall(), fourth.Recall());
  EXPECT_GT(with_geometry.Listed(), 0.93);
  for (const auto& [name, score] :
       {std::pair("next", next), std::pair("fourth", fourth), std::pair("geometry", with_geometry)})
    std::cout << name << ": precision " << score.Precision() << " recall " << score.Recall()
              << " among the candidates " << score.Listed() << "\n";
}

}  // namespace
}  // namespace holba
