// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/detection.h"

#include <gmock/gmock.h>

#include "holba/base/error.h"
#include "holba/io/files.h"
#include "holba/pipeline/pipeline_testing.h"
#include "holba/scene/name_pairing.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Detection : public PipelineTest {
 protected:
  ImageFeatureMap Detect(DetectionReport* report) {
    *report = {};
    Database database(folder_ / "database.db");
    std::map<image_t, ImportedSegments> imported;
    return DetectFeatures(options_, folder_, model_, database.MatchImages(model_), &database,
                          &imported, report);
  }
  size_t NumReused() {
    DetectionReport report;
    Detect(&report);
    EXPECT_EQ(report.num_images, 3u);
    return report.images_reused;
  }

  DetectionOptions options_{.num_threads = 2};
};

void ExpectSame(const ImageFeatureMap& a, const ImageFeatureMap& b) {
  ASSERT_EQ(a.size(), b.size());
  for (const auto& [image_id, f] : a) {
    const ImageFeatures& g = b.at(image_id);
    ASSERT_EQ(f.segments.size(), g.segments.size());
    for (size_t i = 0; i < f.segments.size(); ++i) {
      EXPECT_EQ(f.segments[i].start, g.segments[i].start);
      EXPECT_EQ(f.segments[i].end, g.segments[i].end);
    }
    EXPECT_EQ(f.segment_descriptors, g.segment_descriptors);
    EXPECT_EQ(f.corners, g.corners);
    EXPECT_EQ(f.corner_descriptors, g.corner_descriptors);
    EXPECT_EQ(f.vp_of_segment, g.vp_of_segment);
    EXPECT_EQ(f.vanishing_points.size(), g.vanishing_points.size());
  }
}

TEST_F(Detection, OfASecondRunTakesAllFromTheDatabase) {
  DetectionReport first, second;
  const ImageFeatureMap found = Detect(&first);
  EXPECT_EQ(first.images_reused, 0u);
  // Six rectangles of four sides in each of three images.
  EXPECT_GE(first.num_segments, 72u);
  EXPECT_GE(first.num_corners, 72u);
  const ImageFeatureMap stored = Detect(&second);
  EXPECT_EQ(second.images_reused, 3u);
  EXPECT_EQ(second.num_segments, first.num_segments);
  EXPECT_EQ(second.num_corners, first.num_corners);
  EXPECT_EQ(second.num_vanishing_points, first.num_vanishing_points);
  ExpectSame(found, stored);
}

TEST_F(Detection, NoticesAChangedPhotograph) {
  EXPECT_EQ(NumReused(), 0u);
  WritePhotograph(5, 180.0);
  EXPECT_EQ(NumReused(), 2u);
  EXPECT_EQ(NumReused(), 3u);
}

TEST_F(Detection, NoticesOtherOptionsAndOtherCameras) {
  EXPECT_EQ(NumReused(), 0u);
  options_.num_threads = 1;
  EXPECT_EQ(NumReused(), 3u) << "threads change nothing";
  options_.vps.max_error_px *= 2.0;
  EXPECT_EQ(NumReused(), 0u);
  model_.cameras.at(1).params[0] += 1.0;
  EXPECT_EQ(NumReused(), 0u);
  EXPECT_EQ(NumReused(), 3u);
}

TEST_F(Detection, TakesImportedSegmentsAndNoticesOthers) {
  const auto text = [](double x) {
    std::string all;
    for (const char* name : {"3.png", "5.png"}) {
      all += "IMAGE " + std::string(name) + "\n10 20 " + std::to_string(x) + " 25\n30 40 90 140\n";
    }
    return all;
  };
  options_.imports.segments = Write("segments.txt", text(100.0)).string();
  DetectionReport report;
  const ImageFeatureMap features = Detect(&report);
  EXPECT_EQ(report.num_segments, 4u);
  EXPECT_TRUE(features.at(8).segments.empty());
  EXPECT_EQ(NumReused(), 3u);
  Write("segments.txt", text(101.0));
  EXPECT_EQ(NumReused(), 1u) << "the image without segments";
}

TEST_F(Detection, RefusesPhotographsOfAnotherSize) {
  model_.cameras.at(1).width = 300;
  DetectionReport report;
  try {
    Detect(&report);
    FAIL() << "the photographs have another size";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("240 x 180 pixels, its camera in the model 300 x 180"));
  }
}

TEST_F(Detection, LeavesOutWhatCannotBeReadAndNamesWhatEndsEarly) {
  DetectionReport report;
  const ImageFeatureMap whole = Detect(&report);
  std::filesystem::remove(folder_ / "database.db");
  // A JPEG is read whatever its name.
  WriteImage(ReadColourImage(folder_ / "5.png"), folder_ / "5.jpg");
  const std::string bytes = ReadFileBytes(folder_ / "5.jpg");
  Write("5.png", bytes.substr(0, bytes.size() - 400));
  Write("8.png", "text");
  const ImageFeatureMap features = Detect(&report);
  EXPECT_THAT(report.cut_off, ElementsAre("5.png"));
  ASSERT_EQ(report.left_out.size(), 1u);
  EXPECT_EQ(report.left_out[0].image_id, 8u);
  EXPECT_THAT(report.left_out[0].reason, HasSubstr("8.png"));
  EXPECT_TRUE(features.at(8).segments.empty());
  EXPECT_TRUE(features.at(8).corners.empty());
  EXPECT_GE(features.at(5).segments.size(), 8u);
  EXPECT_EQ(features.at(3).corners, whole.at(3).corners);
  options_.strict = true;
  EXPECT_THROW(Detect(&report), InputError);
}

TEST(ImportPaths, SayWhatIsMissing) {
  const auto message = [](const ImportPaths& paths) {
    try {
      paths.Check();
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(message({}), "");
  EXPECT_THAT(message({.segments = "/nowhere"}), HasSubstr("--Import.segments_path"));
  const std::string here = testing::TempDir();
  EXPECT_THAT(message({.line_matches = here}), HasSubstr("must go with --Import.segments_path"));
  EXPECT_THAT(message({.depths = here}), HasSubstr("must go with --Import.labels_path"));
  EXPECT_EQ(message({.labels = here, .depths = here}), "");
}

// The images of `model` under other names in the database, with their keypoints moved by this.
void WriteUnderOtherNames(const Reconstruction& model, const std::filesystem::path& path,
                          bool with_keypoints, double moved_px) {
  Reconstruction other = model;
  for (const auto& [image_id, image] : model.images) {
    Image& renamed = other.images.at(image_id);
    renamed.name = "set/" + std::string(WithoutExtension(image.name)) + ".JPG";
    for (Point2D& point : renamed.points2D) point.xy.array() += moved_px;
    if (!with_keypoints) renamed.points2D.clear();
  }
  Database(path).MatchImages(other);
}

TEST_F(Detection, AnImageUnderAnotherNameInTheDatabaseIsFoundIfItsKeypointsAreTheSame) {
  const std::filesystem::path path = folder_ / "other.db";
  WriteUnderOtherNames(model_, path, true, 0.0);
  Database database(path);
  const std::map<std::string, std::string> names = CheckDatabase(database, folder_, model_);
  ASSERT_EQ(names.size(), 3u);
  EXPECT_EQ(names.at("5.png"), "set/5.JPG");
  const std::map<image_t, image_t> ids = database.MatchImages(model_, names);
  EXPECT_EQ(ids, (std::map<image_t, image_t>{{3, 3}, {5, 5}, {8, 8}}));
  EXPECT_EQ(database.ReadImages().size(), 3u);  // none was added
}

TEST_F(Detection, OtherKeypointsUnderNamesThatAreAlikeAreOfOtherPhotographs) {
  WriteUnderOtherNames(model_, folder_ / "other.db", true, 3.0);
  const Database database(folder_ / "other.db");
  try {
    CheckDatabase(database, folder_, model_);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("the database of other photographs"));
  }
}

TEST_F(Detection, NamesThatAreAlikeAreNotBelievedWithoutKeypoints) {
  WriteUnderOtherNames(model_, folder_ / "other.db", false, 0.0);
  Database database(folder_ / "other.db");
  EXPECT_TRUE(CheckDatabase(database, folder_, model_).empty());
  database.MatchImages(model_);
  EXPECT_EQ(database.ReadImages().size(), 6u);
}

}  // namespace
}  // namespace holba
