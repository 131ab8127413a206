// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/rendered_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <limits>

#include "apps/temporary_folder_testing.h"

namespace holba {
namespace {

using ::testing::ElementsAre;

class Scan : public TemporaryFolderTest {};

TEST_F(Scan, CoversASurfaceEvenly) {
  std::ofstream(folder_ / "mesh.obj") << "v 0 0 1\nv 0.3 0 1\nv 0.3 0.4 1\nv 0 0.4 1\n"
                                         "f 1 2 3 4\n";
  const std::vector<Eigen::Vector3d> scan = ScanOfMesh(folder_ / "mesh.obj", 0.01);
  // One for each square of the spacing, and a few more at the edges.
  EXPECT_GE(scan.size(), 1200u);
  EXPECT_LT(scan.size(), 1400u);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& x : scan) {
    EXPECT_NEAR(x.z(), 1.0, 1e-12);
    mean += x / static_cast<double>(scan.size());
  }
  EXPECT_LT((mean - Eigen::Vector3d(0.15, 0.2, 1.0)).norm(), 1e-3);
  // No place of the surface is farther from the scan than the spacing, at sharp corners a little
  // more.
  const NearestDistance distance = NearestDistance::ToPoints(scan);
  for (int i = 0; i <= 60; ++i) {
    for (int j = 0; j <= 80; ++j)
      EXPECT_LT(distance.Of(Eigen::Vector3d(0.005 * i, 0.005 * j, 1.0)), 0.011);
  }
}

TEST_F(Scan, TakesNoMoreThanItsLengthOfASliver) {
  std::ofstream(folder_ / "mesh.obj") << "v 0 0 0\nv 1 0 0\nv 0.4 0.0001 0\nf 1 2 3\n"
                                         "v 5 0 0\nv 5 0 0\nv 5 0 0\nf 4 5 6\n";
  EXPECT_EQ(ScanOfMesh(folder_ / "mesh.obj", 0.01).size(), 50u + 1u)
      << "half its length at half its height";
}

TEST(RenderedSets, AreTheEightRoomsAndThenOthersOfTheirKind) {
  PaperBenchOptions options;
  options.num_seeds = 3;
  options.seed = 6;
  EXPECT_THAT(RenderedSets(options).RoomNames(), ElementsAre("room_7", "room_8", "room_1, seed 2"));
}

TEST(Aucs, OfTheTruthAre100AndOfNothing0) {
  Reconstruction truth;
  for (image_t id = 1; id <= 3; ++id) {
    Image image;
    image.name = std::to_string(id);
    image.camera_id = 1;
    image.cam_from_world.translation = {static_cast<double>(id), 0.1 * id * id, 0.0};
    truth.images.Add(id, image);
  }
  EXPECT_THAT(AucsOf(truth, truth, {0.5, 10}), ElementsAre(100.0, 100.0));
  EXPECT_THAT(AucsOf({}, truth, {0.5, 10}), ElementsAre(0.0, 0.0));
}

}  // namespace
}  // namespace holba
