// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/regions.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "holba/pipeline/pipeline_testing.h"

namespace holba {
namespace {

using ::testing::SizeIs;

class Regions : public PipelineTest {
 protected:
  // The left half of images 3 and 5 as a plane (label 4), with a normal in image 5.
  ImageFeatureMap LabelledFeatures() const {
    ImageFeatureMap features;
    for (const image_t id : {3, 5}) {
      LabelMap& map = features[id].label_map;
      map.width = kWidth;
      map.height = kHeight;
      for (int i = 0; i < kWidth * kHeight; ++i) map.labels.push_back(i % kWidth < 120 ? 4 : 0);
      map.types = {{4, FindGroupType("PLANE")}};
    }
    features[5].normals[4] = {Eigen::Vector3d::UnitZ(), 3.0};
    return features;
  }

  void ExpectOneSurface(const RegionOptions& options) {
    RegionReport report;
    const RegionObservations regions =
        ObserveRegions(options, "", LabelledFeatures(), {}, &model_, &report);
    EXPECT_EQ(report.num_groups2D, 2u);
    EXPECT_THAT(model_.images.at(3).groups2D, SizeIs(1));
    EXPECT_THAT(model_.images.at(8).groups2D, SizeIs(0));
    EXPECT_EQ(model_.images.at(5).groups2D[0].type, FindGroupType("PLANE"));
    ASSERT_EQ(regions.normals.size(), 1u);
    EXPECT_EQ(regions.normals.at({5, 0}).sigma_deg, 3.0);
    EXPECT_EQ(report.num_matches, regions.matches.size());
    ASSERT_FALSE(regions.matches.empty());
    for (const auto& [a, b] : regions.matches) {
      EXPECT_EQ(ImagePair(std::minmax(a.image_id, b.image_id)), ImagePair(3, 5));
      EXPECT_EQ(a.group2D_idx, 0u);
      EXPECT_EQ(b.group2D_idx, 0u);
    }
  }
};

TEST_F(Regions, OfOneSurfaceAreMatchedByTheirPoints) {
  ExpectOneSurface({.matching = RegionMatching::kVotes});
}

TEST_F(Regions, OfOneSurfaceAreMatchedByWarping) {
  ExpectOneSurface({.matching = RegionMatching::kWarp});
}

}  // namespace
}  // namespace holba
