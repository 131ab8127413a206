// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/views.h"

#include <gtest/gtest.h>

#include "holba/scene/random_model.h"

namespace holba {
namespace {

TEST(ViewMap, HoldsTheViewOfEveryImageInTheModelsOrder) {
  const Reconstruction model = RandomModel(3);
  const ViewMap views(model);
  ASSERT_GT(views.size(), 1u);
  ASSERT_EQ(views.size(), model.images.size());
  size_t idx = 0;
  for (const auto& [image_id, image] : model.images) {
    EXPECT_EQ(views.ImageId(idx), image_id);
    EXPECT_EQ(views.IndexOf(image_id), idx);
    EXPECT_TRUE(views.contains(image_id));
    EXPECT_EQ(&views.at(image_id), &views[idx]);
    const IdealView alone(model, image_id);
    EXPECT_EQ(views[idx].K(), alone.K());
    EXPECT_EQ(views[idx].R(), alone.R());
    EXPECT_EQ(views[idx].t(), alone.t());
    ++idx;
  }
  EXPECT_EQ(static_cast<size_t>(views.end() - views.begin()), idx);
}

TEST(ViewMap, OfAnImageThatIsNotThereIsAFault) {
  const ViewMap views((Reconstruction()));
  EXPECT_FALSE(views.contains(1));
  EXPECT_THROW(views.at(1), CheckError);
}

}  // namespace
}  // namespace holba
