// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/sift_detector.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "holba/frontend/detectors/sift_scale_space.h"
#include "holba/frontend/photographs/opencv_threads.h"

namespace holba {
namespace {

// A descriptor reaches 10.6 times the scale of its key point around it, which is at most 2 pixels
// in octave -1; the blurs before it reach another 10 pixels.
constexpr int kMarginPx = 48;

ScaleSpaceOptions ToScaleSpace(const SiftOptions& options, double upright_deg) {
  return {options.first_octave,      options.num_octaves,
          options.octave_resolution, options.peak_threshold,
          options.edge_threshold,    options.max_num_orientations,
          options.upright,           upright_deg * std::numbers::pi / 180.0};
}

// Points of octave -1: strip by strip, so that only a part of the image has four times its pixels.
template <typename Function>
void ForEachStrip(const cv::Mat& image, int max_part_pixels, const Function& function) {
  const int most_rows = std::max(max_part_pixels / std::max(image.cols, 1), 4 * kMarginPx);
  const int strip_rows = image.rows <= most_rows ? image.rows : most_rows - 2 * kMarginPx;
  for (int first = 0; first < image.rows; first += strip_rows) {
    const int end = std::min(first + strip_rows, image.rows);
    const int begin_read = std::max(0, first - kMarginPx);
    const int end_read = std::min(image.rows, end + kMarginPx);
    // A copy: blurs look beyond the borders of a part of an image.
    const cv::Mat strip = begin_read == 0 && end_read == image.rows
                              ? image
                              : image.rowRange(begin_read, end_read).clone();
    // What lies at the very border of the image belongs to it, too.
    function(strip, begin_read, first == 0 ? -1.0 : first - 0.5,
             end == image.rows ? image.rows : end - 0.5);
  }
}

size_t NumPlaces(const std::vector<ScaleSpacePoint>& points) {
  return static_cast<size_t>(std::count_if(
      points.begin(), points.end(), [](const ScaleSpacePoint& point) { return point.is_first; }));
}

std::vector<ScaleSpacePoint> FindPoints(const SiftOptions& options, const cv::Mat& image,
                                        double upright_deg, int max_part_pixels) {
  std::vector<ScaleSpacePoint> points, coarse;
  const ScaleSpaceOptions scale_space = ToScaleSpace(options, upright_deg);
  ScaleSpaceOptions of_coarse = scale_space;
  if (options.first_octave < 0) {
    of_coarse.first_octave = 0;
    --of_coarse.num_octaves;
  }
  if (of_coarse.num_octaves > 0) coarse = FindScaleSpacePoints(of_coarse, image);
  // More than enough: the finest octave would be left out.
  const bool has_enough = NumPlaces(coarse) > static_cast<size_t>(options.max_num_features);
  if (options.first_octave < 0 && !has_enough) {
    ScaleSpaceOptions finest = scale_space;
    finest.num_octaves = 1;
    ForEachStrip(image, max_part_pixels,
                 [&](const cv::Mat& strip, int first_row, double begin, double end) {
                   for (ScaleSpacePoint& point : FindScaleSpacePoints(finest, strip)) {
                     point.y += first_row;
                     if (point.y >= begin && point.y < end) points.push_back(point);
                   }
                 });
    // Level by level, whatever the strips were.
    std::stable_sort(points.begin(), points.end(),
                     [](const auto& a, const auto& b) { return a.level < b.level; });
  }
  points.insert(points.end(), coarse.begin(), coarse.end());
  return points;
}

// The coarsest levels.
void Limit(int max_num_features, std::vector<ScaleSpacePoint>* points) {
  int num_places = 0;
  size_t first = points->size();
  while (first > 0 && num_places <= max_num_features) {
    const ScaleSpacePoint level = (*points)[first - 1];
    while (first > 0 && (*points)[first - 1].octave == level.octave &&
           (*points)[first - 1].level == level.level) {
      --first;
      num_places += (*points)[first].is_first;
    }
  }
  points->erase(points->begin(), points->begin() + static_cast<std::ptrdiff_t>(first));
}

void PutDescriptor(DescriptorNormalisation normalisation, const float* values, uint8_t* bytes) {
  double sum = 0.0, squares = 0.0;
  for (int k = 0; k < kSiftDescriptorSize; ++k) {
    sum += values[k];
    squares += static_cast<double>(values[k]) * values[k];
  }
  for (int k = 0; k < kSiftDescriptorSize; ++k) {
    const double value = normalisation == DescriptorNormalisation::kL1Root
                             ? std::sqrt(values[k] / std::max(sum, 1e-12))
                             : values[k] / std::sqrt(std::max(squares, 1e-12));
    bytes[k] = static_cast<uint8_t>(std::min(255.0, std::round(512.0 * value)));
  }
}

SiftFeatures DetectInScaledImage(const SiftOptions& options, const cv::Mat& image,
                                 double upright_deg, int max_part_pixels, double scale_x,
                                 double scale_y) {
  std::vector<ScaleSpacePoint> points = FindPoints(options, image, upright_deg, max_part_pixels);
  Limit(options.max_num_features, &points);
  SiftFeatures features;
  features.keypoints.num_cols = 6;
  features.keypoints.data.reserve(6 * points.size());
  features.descriptors.data.resize(kSiftDescriptorSize * points.size());
  uint8_t* bytes = features.descriptors.data.data();
  for (const ScaleSpacePoint& point : points) {
    const double c = point.sigma_px * std::cos(point.angle_rad);
    const double s = point.sigma_px * std::sin(point.angle_rad);
    for (const double value : {scale_x * (point.x + 0.5), scale_y * (point.y + 0.5), scale_x * c,
                               -scale_y * s, scale_x * s, scale_y * c}) {
      features.keypoints.data.push_back(static_cast<float>(value));
    }
    PutDescriptor(options.normalisation, point.descriptor.data(), bytes);
    bytes += kSiftDescriptorSize;
  }
  return features;
}

SiftFeatures Detect(const SiftOptions& options, const GreyImage& image, double upright_deg,
                    int max_part_pixels) {
  HoldOpenCvThreads();
  SiftFeatures none;
  none.keypoints.num_cols = 6;
  if (image.width < 1 || image.height < 1) return none;
  const cv::Mat original(image.height, image.width, CV_8UC1,
                         const_cast<uint8_t*>(image.pixels.data()));
  const int longer = std::max(image.width, image.height);
  if (longer <= options.max_image_size)
    return DetectInScaledImage(options, original, upright_deg, max_part_pixels, 1.0, 1.0);
  // As COLMAP: the longer side has exactly this size, the other one is rounded down.
  const double scale = static_cast<double>(options.max_image_size) / longer;
  const cv::Size size(std::max(1, static_cast<int>(image.width * scale)),
                      std::max(1, static_cast<int>(image.height * scale)));
  cv::Mat scaled;
  cv::resize(original, scaled, size, 0, 0, cv::INTER_AREA);
  return DetectInScaledImage(options, scaled, upright_deg, max_part_pixels,
                             static_cast<double>(image.width) / size.width,
                             static_cast<double>(image.height) / size.height);
}

void KeepUnmasked(const GreyImage& mask, SiftFeatures* features) {
  Keypoints& keypoints = features->keypoints;
  std::vector<uint8_t>& bytes = features->descriptors.data;
  size_t num_kept = 0;
  for (size_t i = 0; i < keypoints.size(); ++i) {
    if (!IsUnmasked(mask, keypoints.Position(i))) continue;
    std::copy_n(keypoints.data.begin() + 6 * i, 6, keypoints.data.begin() + 6 * num_kept);
    std::copy_n(bytes.begin() + kSiftDescriptorSize * i, kSiftDescriptorSize,
                bytes.begin() + kSiftDescriptorSize * num_kept);
    ++num_kept;
  }
  keypoints.data.resize(6 * num_kept);
  bytes.resize(kSiftDescriptorSize * num_kept);
}

}  // namespace

SiftFeatures DetectSift(const SiftOptions& options, const GreyImage& image, const GreyImage* mask,
                        double upright_deg) {
  SiftFeatures features = Detect(options, image, upright_deg, kMaxSiftPartPixels);
  if (mask != nullptr) KeepUnmasked(*mask, &features);
  return features;
}

SiftFeatures DetectSiftInParts(const SiftOptions& options, const GreyImage& image,
                               int max_part_pixels) {
  return Detect(options, image, 0.0, max_part_pixels);
}

void SiftOptions::Describe(OptionTable* table) const {
  table->Section("SiftExtraction");
  table->Field("max_image_size", &max_image_size, AtLeast(1),
               "Photographs of greater width or height are scaled down to this, pixels.");
  table->Field("max_num_features", &max_num_features, AtLeast(1),
               "About how many features an image has at most: whole levels of scale are kept, the "
               "coarsest first, until there are more.");
  table->Field("first_octave", &first_octave, AtLeast(-1),
               "First octave; -1: of the image at twice its size.");
  table->Field("num_octaves", &num_octaves, AtLeast(1), "Number of octaves.");
  table->Field("octave_resolution", &octave_resolution, Between(1, 16), "Levels of an octave.");
  table->Field("peak_threshold", &peak_threshold, GreaterThan(0),
               "Least difference of Gaussians, of brightness 0 to 1.");
  table->Field("edge_threshold", &edge_threshold, GreaterThan(0),
               "Greatest ratio of the curvatures: more is an edge.");
  table->Field("max_num_orientations", &max_num_orientations, AtLeast(1),
               "Most orientations of a place.");
  table->Field("upright", &upright,
               "Whether features are described as if photographs were upright (as their EXIF "
               "orientation says) instead of in their own orientation.");
  table->Choice(
      "normalization", &normalisation,
      {{"l1_root", DescriptorNormalisation::kL1Root}, {"l2", DescriptorNormalisation::kL2}},
      "Normalisation of descriptors; COLMAP's --descriptor_normalization.");
}

}  // namespace holba
