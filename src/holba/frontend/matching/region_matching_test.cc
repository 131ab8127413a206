// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/region_matching.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "holba/base/random.h"
#include "holba/frontend/importers/import_correspondences.h"
#include "holba/frontend/importers/import_testing.h"

namespace holba {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// Images 1 and 2 see 3D points 1 to 8 (by index 0 to 7) and lines 1 to 3; 2D lines 3 and 4 have
// none.
Reconstruction ModelWithFeatures() {
  Reconstruction model = SmallImportModel();
  for (const image_t id : {1, 2, 3}) {
    Image& image = model.images.at(id);
    for (point3D_t i = 1; i <= 8; ++i) image.points2D.push_back({{1, 1}, i});
    for (line3D_t i = 1; i <= 3; ++i) image.lines2D.push_back({{{1, 1}, {5, 5}}, i});
    for (int i = 0; i < 2; ++i) image.lines2D.push_back({{{1, 1}, {5, 5}}, kNoId});
  }
  return model;
}

Group2D Group(const char* type, std::vector<point2D_t> points, std::vector<line2D_t> lines) {
  return {FindGroupType(type), kNoId, std::move(points), std::move(lines)};
}

std::vector<std::array<uint32_t, 5>> Rows(const std::vector<GroupMatch>& matches) {
  std::vector<std::array<uint32_t, 5>> rows;
  for (const GroupMatch& m : matches) {
    rows.push_back({m.image_id1, m.group2D_idx1, m.image_id2, m.group2D_idx2, m.num_votes});
  }
  return rows;
}
using Row = std::array<uint32_t, 5>;

TEST(MatchGroupsByVotes, MoreThanThreeSharedFeaturesOfOneTypeMakeAMatch) {
  Reconstruction model = ModelWithFeatures();
  model.images.at(1).groups2D = {Group("PLANE", {0, 1, 2}, {0, 1}),
                                 Group("SPHERE", {4, 5, 6, 7}, {}), Group("VP", {}, {0, 1, 2})};
  model.images.at(2).groups2D = {Group("VP", {}, {0, 1, 2}), Group("PLANE", {0, 1, 2, 5}, {1}),
                                 Group("PLANE", {4, 5, 6, 7}, {}), Group("PLANE", {0, 1, 2}, {})};
  GroupVotingReport report;
  EXPECT_THAT(Rows(MatchGroupsByVotes(model, nullptr, {}, &report)),
              ElementsAre(Row{1, 0, 2, 1, 4}));
  EXPECT_EQ(report.num_matches, 1u);
  EXPECT_EQ(report.num_pairs_with_votes, 3u) << "with the VPs and the fourth plane";
  EXPECT_EQ(report.dropped.at("too few votes"), 2u);
  GroupVotingOptions options;
  options.min_num_votes = 3;
  EXPECT_THAT(Rows(MatchGroupsByVotes(model, nullptr, options, &report)),
              ElementsAre(Row{1, 0, 2, 1, 4}, Row{1, 0, 2, 3, 3}, Row{1, 2, 2, 0, 3}));
}

TEST(MatchGroupsByVotes, AFeatureVotesOnceHoweverOftenItIsSeen) {
  Reconstruction model = ModelWithFeatures();
  for (const image_t id : {1, 2}) {
    for (Line2D& line : model.images.at(id).lines2D) line.line3D_id = 1;  // all are one line
    model.images.at(id).groups2D = {Group("PLANE", {0, 1}, {0, 1, 2, 3, 4})};
  }
  GroupVotingOptions options;
  options.min_num_votes = 1;
  GroupVotingReport report;
  EXPECT_THAT(Rows(MatchGroupsByVotes(model, nullptr, options, &report)),
              ElementsAre(Row{1, 0, 2, 0, 3}));
}

TEST(MatchGroupsByVotes, MatchesOfSegmentsWithout3dLinesVote) {
  Reconstruction model = ModelWithFeatures();
  model.images.at(1).groups2D = {Group("PLANE", {0, 1}, {0, 3, 4})};
  model.images.at(3).groups2D = {Group("PLANE", {0, 1}, {0, 3, 4})};
  LineMatchMap matches;
  // The first two segments' 3D line has voted; segment 3 votes once; 4 -> 1 is of no group.
  matches[{1, 3}] = {{0, 0, 0}, {3, 3, 0}, {3, 4, 0}, {4, 1, 0}};
  GroupVotingReport report;
  EXPECT_THAT(Rows(MatchGroupsByVotes(model, &matches, {}, &report)),
              ElementsAre(Row{1, 0, 3, 0, 4}));
  EXPECT_TRUE(MatchGroupsByVotes(model, nullptr, {}, &report).empty());
}

// Label 1 in columns [x0, x1), else 0.
LabelMap Strip(int width, int height, int x0, int x1, const char* type = "PLANE") {
  LabelMap map;
  map.width = width;
  map.height = height;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) map.labels.push_back(x >= x0 && x < x1 ? 1 : 0);
  }
  map.types[1] = FindGroupType(type);
  return map;
}

// Pixel (x, y) of image 1 is (x + dx, y) of image 2, both 800 x 600.
CorrespondenceField Shift(double dx) {
  CorrespondenceField field{800, 600, {}, 800, 600, {}};
  for (int y = 0; y < 600; ++y) {
    for (int x = 0; x < 800; ++x) {
      field.target.emplace_back(static_cast<float>(x + 0.5 + dx), static_cast<float>(y + 0.5));
    }
  }
  return field;
}

TEST(MatchRegionsByWarping, TheIdentityOverlapsWhollyAtAnyResolution) {
  for (const int scale : {1, 2, 4}) {
    const LabelMap map = Strip(800 / scale, 600 / scale, 200 / scale, 400 / scale);
    RegionWarpReport report;
    const auto matches =
        MatchRegionsByWarping(map, Strip(800, 600, 200, 400), Shift(0), {}, &report);
    ASSERT_EQ(matches.size(), 1u);
    EXPECT_EQ(matches[0].overlap, 1.0);
    EXPECT_EQ(matches[0].intersection_px, 200.0 * 600.0);
  }
}

TEST(MatchRegionsByWarping, AShiftLeavesTheRatioOfIntersectionAndUnion) {
  const LabelMap map = Strip(800, 600, 200, 400);
  RegionWarpReport report;
  // 200 wide, moved by 40: 160 of 240.
  auto matches = MatchRegionsByWarping(map, map, Shift(40), {}, &report);
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_EQ(matches[0].overlap, 160.0 / 240.0);
  EXPECT_EQ(matches[0].intersection_px, 160.0 * 600.0);
  // Moved by 50: 150 of 250 is 0.6, which is not above it.
  EXPECT_TRUE(MatchRegionsByWarping(map, map, Shift(50), {}, &report).empty());
  EXPECT_EQ(report.dropped.at("too little overlap"), 1u);
  EXPECT_EQ(report.num_matches, 1u);
}

TEST(MatchRegionsByWarping, WhatTheOtherImageDoesNotSeeDoesNotCount) {
  // The camera turned by 300 pixels: only [300, 400) of the region is in image 2, at [0, 100).
  RegionWarpReport report;
  const auto matches = MatchRegionsByWarping(Strip(800, 600, 200, 400), Strip(800, 600, 0, 100),
                                             Shift(-300), {}, &report);
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_EQ(matches[0].overlap, 1.0);
  EXPECT_EQ(matches[0].intersection_px, 100.0 * 600.0);
}

TEST(MatchRegionsByWarping, UncertainCorrespondencesCountAsNotSeen) {
  CorrespondenceField field = Shift(40);
  field.certainty.assign(field.target.size(), 1.0f);
  for (int y = 0; y < 600; ++y) {
    for (int x = 0; x < 800; ++x) {
      // Only where both have the region.
      if (x < 200 || x >= 360) field.certainty[static_cast<size_t>(800 * y + x)] = 0.1f;
    }
  }
  const LabelMap map = Strip(800, 600, 200, 400);
  RegionWarpReport report;
  EXPECT_EQ(MatchRegionsByWarping(map, map, field, {}, &report).at(0).overlap, 1.0);
}

TEST(MatchRegionsByWarping, TypesAndAreasMustAgree) {
  RegionWarpReport report;
  EXPECT_TRUE(MatchRegionsByWarping(Strip(800, 600, 200, 400), Strip(800, 600, 200, 400, "SPHERE"),
                                    Shift(0), {}, &report)
                  .empty());
  EXPECT_EQ(report.dropped.at("of different types"), 1u);
  const LabelMap thin = Strip(800, 600, 200, 201);  // 600 px
  EXPECT_TRUE(MatchRegionsByWarping(thin, thin, Shift(0), {}, &report).empty());
  EXPECT_EQ(report.dropped.at("too small an intersection"), 1u);
  EXPECT_TRUE(MatchRegionsByWarping(LabelMap(), thin, Shift(0), {}, &report).empty());
}

TEST(InterpolateMatches, AnAffineMapIsReproducedInTheConvexHull) {
  Random random(2);
  Eigen::Matrix2d A;
  A << 0.9, 0.1, -0.05, 1.1;
  const Eigen::Vector2d b(30.0, -20.0);
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> matches;
  for (int i = 0; i < 600; ++i) {
    const Eigen::Vector2d x(random.Uniform(100, 700), random.Uniform(100, 500));
    matches.emplace_back(x, A * x + b);
  }
  const CorrespondenceField field =
      InterpolateMatches(matches, {800, 600}, {800, 600}, FieldInterpolationOptions());
  EXPECT_EQ(field.width, 400);
  EXPECT_EQ(field.height, 300);
  size_t num_known = 0;
  for (int y = 0; y < field.height; ++y) {
    for (int x = 0; x < field.width; ++x) {
      const Eigen::Vector2f target = field.target[static_cast<size_t>(400 * y + x)];
      const Eigen::Vector2d pixel(2 * x + 1, 2 * y + 1);
      const bool inside =
          pixel.x() >= 100 && pixel.x() <= 700 && pixel.y() >= 100 && pixel.y() <= 500;
      if (!std::isfinite(target.x())) {
        // Near the hull's border only.
        EXPECT_FALSE(pixel.x() > 160 && pixel.x() < 640 && pixel.y() > 160 && pixel.y() < 440);
        continue;
      }
      ++num_known;
      EXPECT_TRUE(inside);
      EXPECT_LT((target.cast<double>() - (A * pixel + b)).norm(), 1e-3);
    }
  }
  EXPECT_GT(num_known, 50000u) << "of 60000 in the square";
}

TEST(InterpolateMatches, TrianglesThatAreLargeOrTurnedOverStayEmpty) {
  const std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> square = {
      {{100, 100}, {100, 100}},
      {{200, 100}, {200, 100}},
      {{100, 200}, {100, 200}},
      {{200, 200}, {200, 200}}};
  const auto num_known = [](const CorrespondenceField& field) {
    return std::count_if(field.target.begin(), field.target.end(),
                         [](const Eigen::Vector2f& x) { return std::isfinite(x.x()); });
  };
  FieldInterpolationOptions options;
  options.long_side = 800;
  options.max_side_px = 150;  // the diagonal has 141
  EXPECT_EQ(num_known(InterpolateMatches(square, {800, 600}, {800, 600}, options)), 100 * 100);
  options.max_side_px = 140;
  EXPECT_EQ(num_known(InterpolateMatches(square, {800, 600}, {800, 600}, options)), 0);
  options.max_side_px = 150;
  auto mirrored = square;
  for (auto& [x1, x2] : mirrored) x2.x() = 300 - x2.x();
  EXPECT_EQ(num_known(InterpolateMatches(mirrored, {800, 600}, {800, 600}, options)), 0);
  EXPECT_EQ(num_known(InterpolateMatches({}, {800, 600}, {800, 600}, options)), 0);
}

TEST(InterpolateMatches, RepeatedAndOutlyingMatchesDoNoHarm) {
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> matches;
  for (int i = 0; i <= 8; ++i) {
    for (int k = 0; k <= 6; ++k) {
      const Eigen::Vector2d x(100.0 * i, 100.0 * k);  // the corners of the image, too
      matches.emplace_back(x, x);
      matches.emplace_back(x, x);
    }
  }
  matches.emplace_back(Eigen::Vector2d(-5, 10), Eigen::Vector2d(5, 5));
  matches.emplace_back(Eigen::Vector2d(900, 10), Eigen::Vector2d(5, 5));
  matches.emplace_back(Eigen::Vector2d(50, NAN), Eigen::Vector2d(5, 5));
  FieldInterpolationOptions options;
  options.max_side_px = 150;
  const CorrespondenceField field = InterpolateMatches(matches, {800, 600}, {800, 600}, options);
  for (int y = 0; y < field.height; ++y) {
    for (int x = 0; x < field.width; ++x) {
      EXPECT_LT((field.target[static_cast<size_t>(field.width * y + x)] -
                 Eigen::Vector2f(2.0f * x + 1, 2.0f * y + 1))
                    .norm(),
                1e-3f);
    }
  }
}

TEST(ImportCorrespondences, PixelsCountFromZeroInFilesAndRomaFromMinusOne) {
  const TestFolder folder;
  // (2, 3, 2): each pixel of a 3 x 2 grid.
  const std::vector<float> pixels = {0, 0, 10, 0, 20, 0, 0, 5, 10, 5, 99, 79};
  std::vector<float> roma;
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 3; ++x) {
      for (const float value : {(x + 0.5f) / 1.5f - 1, y + 0.5f - 1, 0.0f, 0.5f}) {
        roma.push_back(value);
      }
    }
  }
  folder.Write("dir-a.jpg/b.jpg.npz",
               Zip({{"warp.npy", Npy("<f4", "(2, 3, 2)", pixels)},
                    {"certainty.npy", Npy("<f4", "(2, 3)", std::vector<float>(6, 0.5f))}}));
  folder.Write("c.jpg/b.jpg.npy", Npy("<f4", "(1, 2, 3, 4)", roma));
  folder.Write("c.jpg/other.npy", Npy("<f4", "(2, 3, 4)", roma));
  std::map<std::pair<image_t, image_t>, CorrespondenceField> fields;
  CorrespondenceImportReport report;
  ForEachCorrespondenceField(
      folder.path(), SmallImportModel(),
      [&](image_t from, image_t to, const CorrespondenceField& field) {
        fields[{from, to}] = field;
      },
      &report);
  EXPECT_EQ(report.num_fields, 2u);
  EXPECT_EQ(report.num_unknown_pairs, 1u);
  const CorrespondenceField& plain = fields.at({1, 2});
  EXPECT_EQ(plain.width, 3);
  EXPECT_EQ(plain.height, 2);
  EXPECT_EQ(plain.target_width, 100);
  EXPECT_EQ(plain.target[1], Eigen::Vector2f(10.5f, 0.5f));
  EXPECT_EQ(plain.target[5], Eigen::Vector2f(99.5f, 79.5f));
  EXPECT_THAT(plain.certainty, ElementsAre(0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f));
  const CorrespondenceField& from_roma = fields.at({3, 2});
  EXPECT_EQ(from_roma.target[4], Eigen::Vector2f(50, 60));
  EXPECT_TRUE(from_roma.certainty.empty());
}

TEST(ImportCorrespondences, BadFilesAreRefusedWithTheReason) {
  const TestFolder folder;
  const auto message = [&](const std::string& name, const std::string& npy) {
    const auto path = folder.Write("x.npz", Zip({{name + ".npy", npy}}));
    CorrespondenceImportReport report;
    return MessageOf([&] {
      ForEachCorrespondenceField(
          path, SmallImportModel(), [](image_t, image_t, const CorrespondenceField&) {}, &report);
    });
  };
  const std::vector<float> zero(24, 0.0f);
  EXPECT_EQ(message("b.jpg/c.jpg/warp", Npy("<f4", "(2, 6, 2)", zero)), "");
  EXPECT_THAT(message("b.jpg/c.jpg/warp", Npy("<f4", "(2, 12)", zero)),
              HasSubstr("x.npz: 'b.jpg/c.jpg/warp': expected correspondences of shape (H, W, 2)"));
  EXPECT_THAT(message("b.jpg/c.jpg/warp", Npy("<f4", "(1, 6, 4)", zero)),
              HasSubstr("pixel (0, 0) of the warp says it is at (0.000, 0.000)"));
  EXPECT_THAT(message("b.jpg/d.jpg/warp", Npy("<f4", "(2, 6, 2)", zero)),
              HasSubstr("expected names like 'dir/a.jpg', found 'b.jpg/d.jpg'"));
  const auto path = folder.Write(
      "x.npz", Zip({{"b.jpg/c.jpg/warp.npy", Npy("<f4", "(2, 6, 2)", zero)},
                    {"b.jpg/c.jpg/certainty.npy", Npy("<f4", "(2, 5)", std::vector<float>(10))}}));
  CorrespondenceImportReport report;
  EXPECT_THAT(MessageOf([&] {
                ForEachCorrespondenceField(
                    path, SmallImportModel(), [](image_t, image_t, const CorrespondenceField&) {},
                    &report);
              }),
              HasSubstr("expected the certainty of 6 x 2 pixels, found (2, 5) float32"));
}

}  // namespace
}  // namespace holba
