// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/vp_detection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "holba/base/data_testing.h"
#include "holba/base/error.h"
#include "holba/estimation/groups/relations.h"
#include "holba/estimation/directions/vp_lines.h"
#include "holba/estimation/directions/vp_tracks.h"
#include "holba/io/model_io.h"
#include "holba/scene/ideal_view.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

class LabelledFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() /
              (std::string("holba_vp_detection_test_") + info->name());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void Write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
  }
  std::string Message() const {
    try {
      ReadLabelledSegments(folder_);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  std::filesystem::path folder_;
};

TEST_F(LabelledFiles, AreReadByName) {
  Write("b.txt", "K 700 710 320 240 640 480\nvp 0 0 2\nseg 1 2 3 4 0\n\nseg 5 6 7 8 -1\n");
  Write("a.txt", "K 1 1 0 0 2 2\n");
  Write("notes.md", "not one of them");
  const std::vector<LabelledSegments> images = ReadLabelledSegments(folder_);
  ASSERT_THAT(images, SizeIs(2));
  EXPECT_EQ(images[0].name, "a");
  EXPECT_EQ(images[1].K(1, 1), 710);
  EXPECT_EQ(images[1].K(1, 2), 240);
  EXPECT_THAT(images[1].directions, ElementsAre(Eigen::Vector3d(0, 0, 1)));
  EXPECT_THAT(images[1].labels, ElementsAre(0, -1));
  EXPECT_EQ(images[1].segments[1].end, Eigen::Vector2d(7, 8));
}

TEST_F(LabelledFiles, ThatAreMalformedAreRefusedWithTheirPlace) {
  EXPECT_THAT(Message(), HasSubstr("expected .txt files"));
  Write("a.txt", "K 700 700 320\n");
  EXPECT_THAT(Message(), HasSubstr("a.txt:1: expected K"));
  Write("a.txt", "K 700 700 320 240 640 480\nvp 0 0 0\n");
  EXPECT_THAT(Message(), HasSubstr("a.txt:2: expected vp"));
  Write("a.txt", "K 700 700 320 240 640 480\n\nseg 1 2 3\n");
  EXPECT_THAT(Message(), HasSubstr("a.txt:3: expected seg"));
  Write("a.txt", "segment 1\n");
  EXPECT_THAT(Message(), HasSubstr("found 'segment'"));
  Write("a.txt", "vp 0 0 1\n");
  EXPECT_THAT(Message(), HasSubstr("expected a line K"));
  Write("a.txt", "K 700 700 320 240 640 480\nvp 0 0 1\nseg 1 2 3 4 1\n");
  EXPECT_THAT(Message(),
              HasSubstr("expected a label of a segment below 1 (lines vp) or -1, found 1"));
}

// Lines along x and y in front of a camera that looks along z: parallel in the image.
LabelledSegments Grid() {
  LabelledSegments image;
  image.K << 700, 0, 320, 0, 700, 240, 0, 0, 1;
  image.directions = {Eigen::Vector3d::UnitX(), Eigen::Vector3d(0, 1, 0.1).normalized()};
  for (int i = 0; i < 20; ++i) {
    image.segments.push_back({{10.0 * i, 20.0 * i}, {10.0 * i + 60.0 + i, 20.0 * i}});
    image.labels.push_back(0);
    image.segments.push_back({{30.0 * i, 10.0 * i}, {30.0 * i, 10.0 * i + 50.0 + i}});
    image.labels.push_back(1);
  }
  return image;
}

TEST(VpDetection, CountsRecallAndFalseOnes) {
  // The second direction is labelled 5.71 degrees off: found within 10, and the found one false.
  const std::vector<VpDetectionResult> results =
      MeasureVpDetection({.detection = {}, .num_seeds = 2}, {Grid(), Grid()});
  ASSERT_THAT(results, SizeIs(2));
  for (const VpDetectionResult& result : results) {
    EXPECT_EQ(result.num_images, 2u);
    EXPECT_EQ(result.num_labelled, 4u);
    EXPECT_EQ(result.num_found, 4u);
    EXPECT_THAT(result.num_recalled, ElementsAre(2u, 2u, 4u));
    EXPECT_EQ(result.num_false, 2u);
    EXPECT_EQ(result.num_labelled_segments, 80u);
    EXPECT_EQ(result.num_right_segments, 40u);
  }
  EXPECT_EQ(results[1].seed, results[0].seed + 1);
  const Table table = VpDetectionTable(results);
  EXPECT_THAT(table.rows, SizeIs(3));
  EXPECT_THAT(table.rows[0], SizeIs(table.header.size()));
  EXPECT_EQ(table.rows[0][1], "50.0");
  EXPECT_EQ(table.rows[0][3], "100");
  EXPECT_EQ(VpDetectionToJson(results)[0]["recalled"]["10"], 4);
}

TEST(VpDetection, FindsWhatIsLabelledInYudPlus) {
  HOLBA_SKIP_WITHOUT_DATA();
  const auto images = ReadLabelledSegments(DataFolder() / "yud_plus");
  ASSERT_THAT(images, SizeIs(44));
  for (const VpDetectionResult& result :
       MeasureVpDetection({.detection = {}, .num_seeds = 3}, images)) {
    ASSERT_EQ(result.num_labelled, 152u);
    EXPECT_GE(result.num_recalled[0], 110u);  // 72 %
    EXPECT_GE(result.num_recalled[1], 132u);  // 87 %
    EXPECT_GE(result.num_recalled[2], 135u);  // 89 %
    EXPECT_LE(result.num_false, 48u);         // 1.1 per image
    EXPECT_GE(result.num_right_segments, 0.93 * result.num_labelled_segments);
  }
}

// What FormVanishingPoints and LabelLines make of the models of real sets, whose own vanishing
// points are taken away. The scenes' real directions are orthogonal.
TEST(VanishingPointsInSpace, OfRealSetsAreTheirOrthogonalDirections) {
  HOLBA_SKIP_WITHOUT_DATA();
  struct Case {
    std::string set;
    size_t num_vps, min_lines;
  };
  for (const Case& real : {Case{"entry_p10", 2, 400}, Case{"fountain_p11", 2, 150},
                           Case{"southbuilding26", 3, 550}, Case{"herzjesu_p8", 2, 180}}) {
    const auto folder = DataFolder() / real.set / "holistic";
    if (!std::filesystem::is_directory(folder)) continue;
    Reconstruction model = ReadModel(folder);
    const auto is_vp = [](group3D_t, const Group3D& group) { return group.type->IsParallelism(); };
    model.groups3D.RemoveIf(is_vp);
    model.relations.clear();
    ImageFeatureMap features;
    for (auto& [id, image] : model.images) {
      image.groups2D.clear();
      const IdealView view(model, id);
      ImageFeatures& of_image = features[id];
      for (const Line2D& line : image.lines2D) of_image.segments.push_back(line.segment);
      VanishingPoints found = DetectVanishingPoints({}, of_image.segments, view.K());
      of_image.vanishing_points = std::move(found.points);
      of_image.vp_of_segment = std::move(found.vp_of_segment);
    }
    for (auto& [id, group] : model.groups3D) group.observations.clear();
    FormVanishingPoints({}, features, &model);
    const LineLabelReport labels = LabelLines({}, &model);
    EXPECT_GE(labels.num_labelled_lines, real.min_lines) << real.set;
    FormRelations({}, &model);
    EXPECT_EQ(model.FindInconsistency(), std::nullopt);
    std::vector<Eigen::Vector3d> directions;
    for (const auto& [id, group] : model.groups3D) {
      if (is_vp(id, group)) directions.emplace_back(group.params.data());
    }
    ASSERT_THAT(directions, SizeIs(real.num_vps)) << real.set;
    size_t num_orthogonal = 0;
    for (const Relation& relation : model.relations) {
      num_orthogonal += relation.type == RelationType::kOrthogonal &&
                        is_vp(0, model.groups3D.at(relation.group3D_id1)) &&
                        is_vp(0, model.groups3D.at(relation.group3D_id2));
    }
    EXPECT_EQ(num_orthogonal, real.num_vps * (real.num_vps - 1) / 2) << real.set;
    for (size_t i = 0; i < directions.size(); ++i) {
      for (size_t j = 0; j < i; ++j) {
        EXPECT_LT(std::abs(directions[i].dot(directions[j])), 0.0175) << real.set;  // 1 degree
      }
    }
  }
}

}  // namespace
}  // namespace holba
