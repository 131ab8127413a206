// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/photograph_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/error.h"
#include "holba/pipeline/pipeline_testing.h"

namespace holba {
namespace {

// The photographs are 3.png, 5.png and 8.png.
class PhotographFolderTest : public PipelineTest {};

TEST_F(PhotographFolderTest, TakesNamesAsTheyAre) {
  const PhotographFolder folder(folder_, model_);
  EXPECT_EQ(folder / "3.png", folder_ / "3.png");
  EXPECT_EQ(folder / "missing.png", folder_ / "missing.png");
  EXPECT_EQ(PhotographFolder(folder_) / "sub/3.jpg", folder_ / "sub/3.jpg");
}

TEST_F(PhotographFolderTest, FindsPhotographsWhoseNamesDiffer) {
  model_.images.at(3).name = "3.JPG";
  model_.images.at(5).name = "images\\5.png";
  std::filesystem::create_directories(folder_ / "deep" / "er");
  std::filesystem::rename(folder_ / "8.png", folder_ / "deep" / "er" / "8.png");
  const PhotographFolder folder(folder_, model_);
  EXPECT_EQ(folder / "3.JPG", folder_ / "3.png");
  EXPECT_EQ(folder / "images\\5.png", folder_ / "5.png");
  EXPECT_EQ(folder / "8.png", folder_ / "deep/er/8.png");
}

TEST_F(PhotographFolderTest, DoesNotChooseBetweenTwoAndLeavesTheOthers) {
  model_.images.at(3).name = "a/3.tif";
  std::filesystem::create_directories(folder_ / "x");
  std::filesystem::copy(folder_ / "3.png", folder_ / "x" / "3.png");
  const PhotographFolder folder(folder_, model_);
  EXPECT_EQ(folder / "a/3.tif", folder_ / "a/3.tif");
  EXPECT_EQ(folder / "5.png", folder_ / "5.png");
}

TEST_F(PhotographFolderTest, RefusesAFolderOfOtherPhotographs) {
  for (auto& [id, image] : model_.images) image.name = "other" + image.name;
  try {
    PhotographFolder folder(folder_, model_);
    FAIL() << "photographs of another set were accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("the folder has '3.png', the model 'other3.png'"));
    EXPECT_THAT(error.what(), testing::HasSubstr("--image_path must be"));
  }
}

}  // namespace
}  // namespace holba
