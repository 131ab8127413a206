// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/segment_detector.h"

#include <fmt/format.h>

#include "holba/base/error.h"
#include "holba/frontend/detectors/segment_lsd.h"
#include "holba/frontend/detectors/segment_onnx.h"

namespace holba {
namespace {

constexpr SegmentDetector kDetectors[] = {
    {"lsd", DetectWithLsd},
    {"onnx", DetectWithOnnx},
};

}  // namespace

const SegmentDetector& FindSegmentDetector(std::string_view name) {
  std::string known;
  for (const SegmentDetector& detector : kDetectors) {
    if (detector.name == name) return detector;
    known += (known.empty() ? "" : ", ") + std::string(detector.name);
  }
  throw InputError(
      fmt::format("--Segments.detector: expected one of {1}, found '{0}'", name, known));
}

void SegmentOptions::Describe(OptionTable* table) const {
  table->Section("Segments");
  table->Field("detector", &detector,
               "What finds line segments in images: lsd, or onnx, a model of yours.");
  table->Field("model_path", &model_path,
               "JSON file that describes the model of the detector onnx.");
  table->Field("lsd_scale", &lsd_scale, Between(0.1, 4.0),
               "Scale of the image at which LSD looks for segments.");
  table->Field("min_length_px", &min_length_px, AtLeast(2.0), "Shortest segment kept, pixels.");
  table->Field("max_num_segments", &max_num_segments, AtLeast(0),
               "Most segments of an image; the longest are kept.");
  table->Field("refine", &refine,
               "Whether segments are moved onto the maxima of the brightness gradient.");
}

}  // namespace holba
