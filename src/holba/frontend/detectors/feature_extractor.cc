// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/feature_extractor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include "holba/frontend/detectors/lbd_descriptor.h"
#include "holba/frontend/detectors/segment_gradients.h"
#include "holba/frontend/detectors/segment_refinement.h"
#include "holba/frontend/photographs/opencv_threads.h"
#include "holba/frontend/photographs/undistort.h"

namespace holba {
namespace {

// Counts up when the same settings begin to give other features.
constexpr int kVersion = 1;
constexpr double kGradientSigmaPx = 0.5;
// What a photograph shows next to its border is no edge of the scene.
constexpr double kBorderPx = 3.0;
// The border itself, curved on the canvas, is found in pieces that leave it here and there.
constexpr double kMinShownShare = 0.75;

// The longest part of a segment of the canvas that the mask of the photograph allows.
std::optional<LineSegment2d> UnmaskedPart(const GreyImage& mask, const IdealCanvas& canvas,
                                          const LineSegment2d& segment) {
  // Places at most half a pixel apart.
  const int num_steps = std::max(1, static_cast<int>(std::ceil(2.0 * segment.Length())));
  const Eigen::Vector2d step = (segment.end - segment.start) / num_steps;
  int best_first = 0, best_size = 0, size = 0;
  for (int i = 0; i <= num_steps; ++i) {
    const auto pixel = canvas.ToPixel(segment.start + i * step);
    size = pixel && IsUnmasked(mask, *pixel) ? size + 1 : 0;
    if (size > best_size) {
      best_size = size;
      best_first = i - size + 1;
    }
  }
  if (best_size == num_steps + 1) return segment;
  if (best_size < 2) return std::nullopt;
  return LineSegment2d{segment.start + best_first * step,
                       segment.start + (best_first + best_size - 1) * step};
}

std::vector<LineSegment2d> DetectSegments(const SegmentOptions& options, const IdealCanvas& canvas,
                                          const GreyImage& image, const GradientImage& gradients,
                                          const GreyImage* mask) {
  std::vector<LineSegment2d> segments;
  for (const LineSegment2d& found : FindSegmentDetector(options.detector).detect(options, image)) {
    auto shown = canvas.ShownPart(found, kBorderPx);
    if (!shown || shown->Length() < kMinShownShare * found.Length()) continue;
    if (mask != nullptr) shown = UnmaskedPart(*mask, canvas, *shown);
    if (shown) segments.push_back(*shown);
  }
  std::erase_if(segments, [&](const LineSegment2d& segment) {
    return !(segment.Length() >= options.min_length_px);
  });
  OrientSegments(gradients, &segments);
  if (options.refine) {
    for (LineSegment2d& segment : segments)
      segment = RefineSegment(gradients, segment).value_or(segment);
  }
  if (mask != nullptr) {
    // Refinement may have moved them across the mask's border.
    std::erase_if(segments, [&](LineSegment2d& segment) {
      const auto part = UnmaskedPart(*mask, canvas, segment);
      if (part) segment = *part;
      return !part || part->Length() < options.min_length_px;
    });
  }
  const auto order = [](const LineSegment2d& s) {
    return std::tuple(-s.Length(), s.start.x(), s.start.y(), s.end.x(), s.end.y());
  };
  std::sort(segments.begin(), segments.end(),
            [&](const LineSegment2d& a, const LineSegment2d& b) { return order(a) < order(b); });
  if (segments.size() > static_cast<size_t>(options.max_num_segments))
    segments.resize(options.max_num_segments);
  return segments;
}

}  // namespace

void ExtractionOptions::Describe(OptionTable* table) const {
  segments.Describe(table);
  corners.Describe(table);
}

ImageFeatures ExtractFeatures(const ExtractionOptions& options, const GreyImage& image,
                              const Camera& camera, const std::vector<LineSegment2d>* given,
                              const GreyImage* mask) {
  HoldOpenCvThreads();
  const IdealCanvas canvas(camera);
  const GreyImage straight = canvas.Resample(image);
  const GradientImage gradients(straight, kGradientSigmaPx);
  ImageFeatures features;
  std::vector<LineSegment2d> described;
  if (given) {
    for (const LineSegment2d& segment : *given) {
      const auto start = canvas.FromPixel(segment.start), end = canvas.FromPixel(segment.end);
      // Beyond the canvas there is nothing to describe; the segment keeps its place in the order.
      std::vector<LineSegment2d> turned{start && end ? LineSegment2d{*start, *end} : segment};
      OrientSegments(gradients, &turned);
      const bool kept = !start || turned[0].start == *start;
      features.segments.push_back(kept ? segment : LineSegment2d{segment.end, segment.start});
      described.push_back(turned[0]);
    }
  } else {
    // Refinement moves ends by less than the border of what is shown.
    for (const LineSegment2d& segment :
         DetectSegments(options.segments, canvas, straight, gradients, mask)) {
      const auto start = canvas.ToPixel(segment.start), end = canvas.ToPixel(segment.end);
      if (!start || !end) continue;
      described.push_back(segment);
      features.segments.push_back({*start, *end});
    }
  }
  features.segment_descriptors = DescribeSegments(gradients, described);
  Corners corners = DetectCorners(options.corners, image, mask);
  features.corners = std::move(corners.positions);
  features.corner_descriptors = std::move(corners.descriptors);
  return features;
}

std::string SettingsOf(const ExtractionOptions& options, const Camera& camera) {
  std::string text = fmt::format("features {}{}", kVersion, TextOfOptions(options));
  text += fmt::format(" camera={} {}x{}", camera.model->name, camera.width, camera.height);
  // A pinhole camera's parameters change nothing: segments are found in the photograph itself.
  if (!camera.model->is_pinhole) {
    for (const double param : camera.params) text += fmt::format(" {}", param);
  }
  return text;
}

}  // namespace holba
