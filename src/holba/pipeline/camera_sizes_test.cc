// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/camera_sizes.h"

#include <gtest/gtest.h>

#include "holba/pipeline/pipeline_testing.h"

namespace holba {
namespace {

class CameraSizesTest : public PipelineTest {};

TEST_F(CameraSizesTest, PixelsFromTheMiddleBecomePixelsFromTheCorner) {
  const Reconstruction whole = model_;
  for (auto& [id, camera] : model_.cameras) {
    camera.width = camera.height = 0;
    for (const int idx : camera.model->principal_point_idxs) camera.params[idx] = 0.0;
  }
  for (auto& [id, image] : model_.images) {
    const Camera& camera = whole.cameras.at(image.camera_id);
    for (Point2D& point : image.points2D)
      point.xy -= 0.5 * Eigen::Vector2d(static_cast<double>(camera.width),
                                        static_cast<double>(camera.height));
  }
  EXPECT_EQ(TakeSizesFromPhotographs(folder_, &model_), whole.cameras.size());
  for (const auto& [id, camera] : whole.cameras) {
    EXPECT_EQ(model_.cameras.at(id).width, camera.width);
    EXPECT_EQ(model_.cameras.at(id).height, camera.height);
  }
  for (const auto& [id, image] : whole.images) {
    for (size_t i = 0; i < image.points2D.size(); ++i)
      EXPECT_LT((model_.images.at(id).points2D[i].xy - image.points2D[i].xy).norm(), 1e-9);
  }
  // What is known stays.
  const Reconstruction before = model_;
  EXPECT_EQ(TakeSizesFromPhotographs(folder_, &model_), 0u);
  EXPECT_EQ(model_.cameras.begin()->second.params, before.cameras.begin()->second.params);
}

TEST_F(CameraSizesTest, WithoutPhotographsNothingIsTaken) {
  for (auto& [id, camera] : model_.cameras) camera.width = camera.height = 0;
  EXPECT_EQ(TakeSizesFromPhotographs(folder_ / "none", &model_), 0u);
}

}  // namespace
}  // namespace holba
