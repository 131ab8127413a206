// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/colours.h"

#include <algorithm>
#include <array>
#include <map>
#include <vector>

#include "holba/base/threads.h"
#include "holba/frontend/photographs/photograph.h"

namespace holba {
namespace {

// Places along a segment whose colours are averaged.
constexpr int kSamplesPerSegment = 8;

struct ColourSum {
  std::array<uint64_t, 3> sum{};
  uint64_t count = 0;

  void Add(const ColourImage& image, const Eigen::Vector2d& pixel) {
    const int x = std::clamp(static_cast<int>(pixel.x()), 0, image.width - 1);
    const int y = std::clamp(static_cast<int>(pixel.y()), 0, image.height - 1);
    const uint8_t* rgb = &image.pixels[3 * (static_cast<size_t>(y) * image.width + x)];
    for (int c = 0; c < 3; ++c) sum[c] += rgb[c];
    ++count;
  }
  void Add(const ColourSum& other) {
    for (int c = 0; c < 3; ++c) sum[c] += other.sum[c];
    count += other.count;
  }
  std::array<uint8_t, 3> Mean() const {
    std::array<uint8_t, 3> mean{};
    for (int c = 0; c < 3 && count > 0; ++c)
      mean[c] = static_cast<uint8_t>((sum[c] + count / 2) / count);
    return mean;
  }
};

struct ImageColours {
  std::map<point3D_t, ColourSum> points;
  std::map<line3D_t, ColourSum> lines;
};

}  // namespace

void ColourFeatures(const PhotographFolder& image_path, std::span<const point3D_t> point3D_ids,
                    int num_threads, Reconstruction* model,
                    const std::set<image_t>& without_photograph) {
  std::vector<point3D_t> wanted(point3D_ids.begin(), point3D_ids.end());
  std::sort(wanted.begin(), wanted.end());
  std::vector<ImageColours> of_image(model->images.size());
  ParallelTasks(num_threads, of_image.size(), [&](size_t i) {
    const auto& [image_id, image] = *(model->images.begin() + i);
    if (without_photograph.contains(image_id)) return;
    const ColourImage photograph = ReadColourImage(image_path / image.name);
    for (const Point2D& point : image.points2D) {
      if (std::binary_search(wanted.begin(), wanted.end(), point.point3D_id))
        of_image[i].points[point.point3D_id].Add(photograph, point.xy);
    }
    for (const Line2D& line : image.lines2D) {
      if (line.line3D_id == kNoId) continue;
      for (int s = 0; s < kSamplesPerSegment; ++s) {
        const double along = (s + 0.5) / kSamplesPerSegment;
        of_image[i].lines[line.line3D_id].Add(
            photograph, (1.0 - along) * line.segment.start + along * line.segment.end);
      }
    }
  });
  ImageColours all;
  for (const ImageColours& image : of_image) {
    for (const auto& [id, colour] : image.points) all.points[id].Add(colour);
    for (const auto& [id, colour] : image.lines) all.lines[id].Add(colour);
  }
  for (const auto& [id, colour] : all.points) model->points3D.at(id).rgb = colour.Mean();
  for (const auto& [id, colour] : all.lines) model->lines3D.at(id).rgb = colour.Mean();
}

}  // namespace holba
