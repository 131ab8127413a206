// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/retrieval.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "holba/base/random.h"

namespace holba {
namespace {

std::vector<double> RandomVector(Random* random) {
  std::vector<double> values(128);
  for (double& v : values) v = std::abs(random->Normal());
  return values;
}

// As SIFT's bytes: length about 512.
void AppendBytes(std::vector<double> values, double noise, Random* random, Descriptors* to) {
  double squared = 0.0;
  for (double& v : values) {
    v = std::abs(v + random->Normal(noise));
    squared += v * v;
  }
  for (double v : values)
    to->data.push_back(static_cast<uint8_t>(std::min(255.0, 512.0 * v / std::sqrt(squared))));
}

// Places of 200 points each. An image sees the points [begin, begin + 60) of its place, as many of
// its own, and clutter that all images have in common.
struct Sight {
  size_t place, begin;
};
std::vector<Descriptors> MakeImages(const std::vector<Sight>& sights) {
  Random random(3);
  std::vector<std::vector<std::vector<double>>> places(6);
  for (auto& place : places) {
    for (int k = 0; k < 200; ++k) place.push_back(RandomVector(&random));
  }
  std::vector<std::vector<double>> clutter;
  for (int k = 0; k < 20; ++k) clutter.push_back(RandomVector(&random));
  std::vector<Descriptors> images;
  for (const Sight& sight : sights) {
    Descriptors image;
    for (size_t k = 0; k < 60; ++k) {
      AppendBytes(places[sight.place][sight.begin + k], 0.15, &random, &image);
      AppendBytes(RandomVector(&random), 0.0, &random, &image);
    }
    for (const auto& values : clutter) AppendBytes(values, 0.15, &random, &image);
    images.push_back(std::move(image));
  }
  return images;
}

std::vector<Sight> SixPlacesOfFive() {
  std::vector<Sight> sights;
  for (size_t k = 0; k < 30; ++k) sights.push_back({k % 6, 10 * (k / 6)});
  return sights;
}

TEST(FindImagesAlike, ImagesOfOnePlaceComeFirst) {
  const auto sights = SixPlacesOfFive();
  const auto alike = FindImagesAlike({}, MakeImages(sights), 4);
  for (size_t i = 0; i < sights.size(); ++i) {
    ASSERT_EQ(alike[i].size(), 4u);
    for (uint32_t j : alike[i]) EXPECT_EQ(sights[j].place, sights[i].place) << i << " " << j;
  }
}

TEST(FindImagesAlike, ImagesThatShareNothingAreJoinedByTheirNeighbours) {
  // On a walk along each of two places the first and the last image have no point in common.
  std::vector<Sight> sights;
  for (size_t place : {0, 1}) {
    for (size_t k = 0; k <= 4; ++k) sights.push_back({place, 15 * k});
  }
  const auto alike = FindImagesAlike({}, MakeImages(sights), 4);
  for (size_t i = 0; i < sights.size(); ++i) {
    for (uint32_t j : alike[i]) EXPECT_EQ(sights[j].place, sights[i].place) << i << " " << j;
  }
}

TEST(FindImagesAlike, TheListsAreTheSameForAnyNumberOfThreads) {
  const auto images = MakeImages(SixPlacesOfFive());
  RetrievalOptions options;
  options.num_threads = 1;
  const auto one = FindImagesAlike(options, images, 29);
  options.num_threads = 3;
  EXPECT_EQ(FindImagesAlike(options, images, 29), one);
}

TEST(FindImagesAlike, EachOtherImageIsListedOnceAndNoneWithoutDescriptors) {
  auto images = MakeImages(SixPlacesOfFive());
  images[7] = {};
  images[8].type = 1;  // floats among bytes
  const auto alike = FindImagesAlike({}, images, 100);
  for (uint32_t i = 0; i < images.size(); ++i) {
    if (i == 7 || i == 8) {
      EXPECT_TRUE(alike[i].empty());
      continue;
    }
    std::vector<uint32_t> listed = alike[i], expected;
    std::sort(listed.begin(), listed.end());
    for (uint32_t j = 0; j < images.size(); ++j) {
      if (j != i && j != 7 && j != 8) expected.push_back(j);
    }
    EXPECT_EQ(listed, expected);
  }
  EXPECT_THAT(FindImagesAlike({}, std::vector<Descriptors>(3), 5),
              testing::Each(testing::IsEmpty()));
  EXPECT_TRUE(FindImagesAlike({}, {}, 5).empty());
}

Descriptors Numbered(int count) {
  Descriptors descriptors;
  descriptors.num_bytes = 2;
  for (int k = 0; k < count; ++k) descriptors.data.insert(descriptors.data.end(), {uint8_t(k), 0});
  return descriptors;
}

TEST(StrongestFirst, LargestKeypointsComeFirstInEveryFormOfKeypoints) {
  const float scales[] = {2, 5, 1, 5, 3};
  Keypoints four{.num_cols = 4}, six{.num_cols = 6};
  for (const float s : scales) {
    const float c = s * std::cos(0.7f), n = s * std::sin(0.7f);
    four.data.insert(four.data.end(), {10, 20, s, 0.7f});
    six.data.insert(six.data.end(), {10, 20, c, -n, n, c});
  }
  for (const Keypoints& keypoints : {four, six}) {
    const Descriptors strongest = StrongestFirst(keypoints, Numbered(5), 3);
    // Which of the two equal ones is first depends on the rounding of six columns.
    ASSERT_EQ(strongest.size(), 3u);
    EXPECT_THAT((std::vector<int>{strongest.data[0], strongest.data[2]}),
                testing::UnorderedElementsAre(1, 3));
    EXPECT_EQ(strongest.data[4], 4);
  }
}

TEST(StrongestFirst, WithoutScalesTheyAreSpreadEvenly) {
  Keypoints positions{.num_cols = 2};
  positions.data.resize(20);
  EXPECT_THAT(StrongestFirst(positions, Numbered(10), 5).data,
              testing::ElementsAre(0, 0, 2, 0, 4, 0, 6, 0, 8, 0));
  EXPECT_EQ(StrongestFirst(positions, Numbered(10), 99).size(), 10u);
  EXPECT_EQ(StrongestFirst({}, {}, 5).size(), 0u);
}

}  // namespace
}  // namespace holba
