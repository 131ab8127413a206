// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/sift_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>

#include "holba/frontend/detectors/segment_testing.h"
#include "holba/frontend/detectors/sift_descriptor.h"

namespace holba {
namespace {

double Blob(const Eigen::Vector2d& d, double sigma_px) {
  return std::exp(-0.5 * d.squaredNorm() / (sigma_px * sigma_px));
}

double ScaleOf(const Keypoints& keypoints, size_t i) {
  return std::hypot(keypoints.data[6 * i + 2], keypoints.data[6 * i + 4]);
}

double OrientationOf(const Keypoints& keypoints, size_t i) {
  return std::atan2(keypoints.data[6 * i + 4], keypoints.data[6 * i + 2]);
}

// The key point nearest to a place among those of about this scale; size(): none.
size_t Nearest(const Keypoints& keypoints, const Eigen::Vector2d& place, double sigma_px) {
  size_t best = keypoints.size();
  for (size_t i = 0; i < keypoints.size(); ++i) {
    if (std::abs(std::log(ScaleOf(keypoints, i) / sigma_px)) > 0.5) continue;
    if (best == keypoints.size() ||
        (keypoints.Position(i) - place).norm() < (keypoints.Position(best) - place).norm())
      best = i;
  }
  return best;
}

// Blobs of all sizes at random, with noise: many features at every level.
GreyImage Clutter(int width, int height, const Eigen::Vector2d& shift = {0, 0},
                  double angle_rad = 0.0) {
  struct Disc {
    Eigen::Vector2d centre;
    double sigma_px, height;
  };
  Random random(11);
  std::vector<Disc> discs;
  for (int i = 0; i < width * height / 150; ++i) {
    discs.push_back({{random.Uniform(0, width), random.Uniform(0, height)},
                     std::exp(random.Uniform(0.0, 2.2)),
                     random.Uniform(-90, 90)});
  }
  std::vector<double> sum(static_cast<size_t>(width) * height, 120.0);
  const Eigen::Rotation2Dd turn(angle_rad);
  const Eigen::Vector2d middle(0.5 * width, 0.5 * height);
  for (const Disc& disc : discs) {
    const Eigen::Vector2d centre = middle + turn * (disc.centre - middle) + shift;
    const int reach = static_cast<int>(4 * disc.sigma_px) + 1;
    for (int y = std::max(0, static_cast<int>(centre.y()) - reach);
         y < std::min<double>(height, centre.y() + reach); ++y) {
      for (int x = std::max(0, static_cast<int>(centre.x()) - reach);
           x < std::min<double>(width, centre.x() + reach); ++x) {
        sum[static_cast<size_t>(y) * width + x] +=
            disc.height * Blob(Eigen::Vector2d(x + 0.5, y + 0.5) - centre, disc.sigma_px);
      }
    }
  }
  GreyImage image{width, height, {}};
  for (const double value : sum)
    image.pixels.push_back(static_cast<uint8_t>(std::clamp(std::lround(value), 0l, 255l)));
  return image;
}

// Share of the key points of `a` that have one of `b` within a hundredth of a pixel at the same
// scale.
double ShareFoundIn(const Keypoints& b, const Keypoints& a, double within_px = 0.01) {
  size_t num_found = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    bool found = false;
    for (size_t j = 0; j < b.size() && !found; ++j) {
      found = (a.Position(i) - b.Position(j)).norm() < within_px &&
              std::abs(std::log(ScaleOf(a, i) / ScaleOf(b, j))) < 0.1;
    }
    num_found += found;
  }
  return static_cast<double>(num_found) / static_cast<double>(std::max<size_t>(a.size(), 1));
}

TEST(SiftDetector, PlacesBlobsInColmapsPixelsWithoutBias) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  int count = 0;
  for (int i = 0; i < 24; ++i) {
    const double sigma_px = 1.7 + 0.17 * i;
    const Eigen::Vector2d truth(60.0 + 0.137 * i, 61.0 - 0.233 * i);
    const GreyImage image = Picture(121, 119, 0.0, [&](const Eigen::Vector2d& p) {
      return 50.0 + 150.0 * Blob(p - truth, sigma_px);
    });
    const SiftFeatures features = DetectSift({}, image);
    const size_t nearest = Nearest(features.keypoints, truth, sigma_px);
    // Between two octaves a blob may be lost.
    if (nearest == features.keypoints.size()) continue;
    const Eigen::Vector2d error = features.keypoints.Position(nearest) - truth;
    EXPECT_LT(error.norm(), 0.04 * sigma_px) << sigma_px;
    // A blob is an extremum at its own scale.
    EXPECT_NEAR(ScaleOf(features.keypoints, nearest) / sigma_px, 1.0, 0.15) << sigma_px;
    sum += error;
    ++count;
  }
  EXPECT_GE(count, 20);
  EXPECT_LT((sum / count).cwiseAbs().maxCoeff(), 0.02);
}

TEST(SiftDetector, PlacesBlobsWithoutBiasInPhotographsThatAreScaledDownAndInParts) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero(), sum_of_parts = Eigen::Vector2d::Zero();
  SiftOptions options;
  options.max_image_size = 200;
  SiftOptions whole;
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector2d truth(201.0 + 0.37 * i, 150.0 - 0.53 * i);
    const GreyImage image = Picture(401, 301, 0.0, [&](const Eigen::Vector2d& p) {
      return 50.0 + 150.0 * Blob(p - truth, 6.0);
    });
    const SiftFeatures scaled = DetectSift(options, image);
    const size_t nearest = Nearest(scaled.keypoints, truth, 6.0);
    ASSERT_LT(nearest, scaled.keypoints.size());
    sum += scaled.keypoints.Position(nearest) - truth;
    const SiftFeatures parts = DetectSiftInParts(whole, image, 401 * 200);
    const size_t of_parts = Nearest(parts.keypoints, truth, 6.0);
    ASSERT_LT(of_parts, parts.keypoints.size());
    sum_of_parts += parts.keypoints.Position(of_parts) - truth;
  }
  EXPECT_LT((sum / 12).cwiseAbs().maxCoeff(), 0.04);  // 0.02 of the scaled image
  EXPECT_LT((sum_of_parts / 12).cwiseAbs().maxCoeff(), 0.02);
}

TEST(SiftDetector, PartsOfAnImageFindWhatTheWholeImageHas) {
  const GreyImage image = Clutter(480, 700);
  const SiftFeatures whole = DetectSiftInParts({}, image, 480 * 700 + 480 * 128);
  const SiftFeatures parts = DetectSiftInParts({}, image, 480 * 300);
  ASSERT_GT(whole.keypoints.size(), 1000u);
  // Octaves -1 and 0 are the same numbers, the coarser ones come from the half image.
  SiftOptions fine;
  fine.num_octaves = 2;
  const SiftFeatures fine_whole = DetectSiftInParts(fine, image, 480 * 700 + 480 * 128);
  const SiftFeatures fine_parts = DetectSiftInParts(fine, image, 480 * 300);
  ASSERT_EQ(fine_whole.keypoints.size(), fine_parts.keypoints.size());
  // Single precision of the rows that OpenCV counts.
  for (size_t i = 0; i < fine_whole.keypoints.data.size(); ++i)
    EXPECT_NEAR(fine_whole.keypoints.data[i], fine_parts.keypoints.data[i], 1e-3);
  size_t num_same = 0;
  for (size_t i = 0; i < fine_whole.descriptors.data.size(); ++i)
    num_same += fine_whole.descriptors.data[i] == fine_parts.descriptors.data[i];
  EXPECT_GT(num_same, 0.99 * static_cast<double>(fine_whole.descriptors.data.size()));
  EXPECT_GT(whole.keypoints.size(), fine_whole.keypoints.size() + 50);
  EXPECT_GT(ShareFoundIn(parts.keypoints, whole.keypoints, 0.3), 0.95);
  EXPECT_GT(ShareFoundIn(whole.keypoints, parts.keypoints, 0.3), 0.95);
}

TEST(SiftDetector, ATurnedImageTurnsOrientationsAndKeepsDescriptors) {
  const double angle_rad = 0.6;
  const GreyImage image = Clutter(300, 300), turned = Clutter(300, 300, {0, 0}, angle_rad);
  const SiftFeatures a = DetectSift({}, image), b = DetectSift({}, turned);
  const Eigen::Vector2d middle(150, 150);
  const Eigen::Rotation2Dd turn(angle_rad);
  int num_same = 0, num_close = 0;
  for (size_t i = 0; i < a.keypoints.size(); ++i) {
    if ((a.keypoints.Position(i) - middle).norm() > 100.0 || ScaleOf(a.keypoints, i) < 2.0)
      continue;
    const Eigen::Vector2d place = middle + turn * (a.keypoints.Position(i) - middle);
    for (size_t j = 0; j < b.keypoints.size(); ++j) {
      if ((b.keypoints.Position(j) - place).norm() > 0.3) continue;
      const double difference =
          std::remainder(OrientationOf(b.keypoints, j) - OrientationOf(a.keypoints, i) - angle_rad,
                         2.0 * std::numbers::pi);
      if (std::abs(difference) > 0.1) continue;
      double product = 0.0;
      for (int k = 0; k < 128; ++k)
        product += a.descriptors.data[128 * i + k] * b.descriptors.data[128 * j + k];
      ++num_same;
      num_close += product > 0.9 * 512.0 * 512.0;
    }
  }
  EXPECT_GT(num_same, 30);
  EXPECT_GT(num_close, 0.9 * num_same);
}

TEST(SiftDescriptor, OfARampFillsTheDirectionOfItsGradientInEveryCell) {
  cv::Mat ramp(81, 81, CV_32FC1);
  for (int y = 0; y < ramp.rows; ++y) {
    for (int x = 0; x < ramp.cols; ++x) ramp.at<float>(y, x) = 2.0f * static_cast<float>(x);
  }
  SiftDescriber describer;
  // The gradient runs along x: against an axis that is turned by k eighths it is direction k.
  for (int k = 0; k < 8; ++k) {
    const SiftDescriptor values =
        describer.Describe(ramp, 40.0, 40.0, 2.0, k * std::numbers::pi / 4.0);
    for (int i = 0; i < kSiftDescriptorSize; ++i) {
      if (i % 8 == k) {
        EXPECT_GT(values[i], 0.02f);
        EXPECT_NEAR(values[i], values[127 - i - 7 + 2 * k], 2e-3) << "the window is symmetric";
      } else {
        EXPECT_NEAR(values[i], 0.0f, 0.01f);
      }
    }
  }
  const SiftDescriptor none = describer.Describe(cv::Mat::ones(81, 81, CV_32FC1), 40, 40, 2, 0);
  EXPECT_EQ(none, SiftDescriptor{});
}

TEST(SiftDetector, DescriptorsHaveNorm512AndFewFeaturesAreTheCoarseLevels) {
  const GreyImage image = Clutter(400, 300);
  const SiftFeatures all = DetectSift({}, image);
  ASSERT_EQ(all.descriptors.size(), all.keypoints.size());
  for (size_t i = 0; i < all.descriptors.size(); ++i) {
    double squares = 0.0;
    for (int k = 0; k < 128; ++k)
      squares += std::pow(static_cast<double>(all.descriptors.data[128 * i + k]), 2);
    EXPECT_NEAR(std::sqrt(squares), 512.0, 6.0);
  }
  SiftOptions few;
  few.max_num_features = 100;
  const SiftFeatures coarse = DetectSift(few, image);
  ASSERT_GT(coarse.keypoints.size(), 100u);
  ASSERT_LT(coarse.keypoints.size(), all.keypoints.size());
  // The end of the list of all, finest first.
  const size_t begin = all.keypoints.data.size() - coarse.keypoints.data.size();
  EXPECT_TRUE(std::equal(coarse.keypoints.data.begin(), coarse.keypoints.data.end(),
                         all.keypoints.data.begin() + static_cast<std::ptrdiff_t>(begin)));
  EXPECT_LE(ScaleOf(all.keypoints, 0), ScaleOf(coarse.keypoints, 0));
}

TEST(SiftDetector, OptionsLeaveOutOctavesAndOrientations) {
  const GreyImage image = Clutter(300, 200);
  const SiftFeatures all = DetectSift({}, image);
  SiftOptions later;
  later.first_octave = 0;
  const SiftFeatures coarse = DetectSift(later, image);
  ASSERT_GT(coarse.keypoints.size(), 10u);
  EXPECT_LT(coarse.keypoints.size(), all.keypoints.size());
  for (size_t i = 0; i < coarse.keypoints.size(); ++i) EXPECT_GT(ScaleOf(coarse.keypoints, i), 1.6);
  SiftOptions one;
  one.max_num_orientations = 1;
  const SiftFeatures single = DetectSift(one, image);
  EXPECT_LT(single.keypoints.size(), all.keypoints.size());
  std::set<std::pair<float, float>> places;
  for (size_t i = 0; i < single.keypoints.size(); ++i)
    places.emplace(single.keypoints.data[6 * i], single.keypoints.data[6 * i + 1]);
  // Two levels may have one place.
  EXPECT_GE(places.size() + 2, single.keypoints.size());

  SiftOptions upright;
  upright.upright = true;
  const SiftFeatures up = DetectSift(upright, image);
  EXPECT_EQ(up.keypoints.size(), single.keypoints.size());
  for (size_t i = 0; i < up.keypoints.size(); ++i)
    EXPECT_NEAR(OrientationOf(up.keypoints, i), 0.0, 1e-6);
  const SiftFeatures down = DetectSift(upright, image, nullptr, 90.0);
  EXPECT_NEAR(OrientationOf(down.keypoints, 0), std::numbers::pi / 2, 1e-6);
  EXPECT_NE(down.descriptors.data, up.descriptors.data);
}

TEST(SiftDetector, NoKeyPointIsWhereTheMaskIsZero) {
  const GreyImage image = Clutter(300, 200);
  GreyImage mask{300, 200, std::vector<uint8_t>(60000, 255)};
  for (int y = 0; y < 200; ++y) std::fill_n(mask.pixels.begin() + 300 * y, 150, 0);
  const SiftFeatures all = DetectSift({}, image), right = DetectSift({}, image, &mask);
  size_t num_right = 0;
  for (size_t i = 0; i < all.keypoints.size(); ++i)
    num_right += all.keypoints.Position(i).x() >= 150.0;
  EXPECT_EQ(right.keypoints.size(), num_right);
  EXPECT_EQ(right.descriptors.size(), num_right);
  for (size_t i = 0; i < num_right; ++i) EXPECT_GE(right.keypoints.Position(i).x(), 150.0);
}

TEST(SiftDetector, AnImageWithoutStructureOrOfAPixelHasNoFeatures) {
  for (const auto& [width, height] : {std::pair(60, 50), std::pair(1, 1), std::pair(3, 200)}) {
    const GreyImage image =
        Picture(width, height, 0.0, [](const Eigen::Vector2d&) { return 90.0; });
    EXPECT_EQ(DetectSift({}, image).keypoints.size(), 0u);
    EXPECT_EQ(DetectSift({}, image).descriptors.size(), 0u);
  }
}

}  // namespace
}  // namespace holba
