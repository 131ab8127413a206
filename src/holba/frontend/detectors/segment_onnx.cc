// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/segment_onnx.h"

#include <fmt/format.h>

#include "holba/base/error.h"
#include "holba/frontend/detectors/onnx_image.h"

namespace holba {

std::vector<LineSegment2d> DetectWithOnnx(const SegmentOptions& options, const GreyImage& image) {
  if (options.model_path.empty()) {
    throw InputError(
        "--Segments.detector onnx needs a model; give its JSON file as --Segments.model_path");
  }
  const auto model = SharedOnnxModel(options.model_path, OnnxKind::kSegments);
  const OnnxDescription& described = model->description;
  const OnnxImage input = MakeOnnxImage(described, image);
  const bool has_scores = described.outputs.contains("scores");
  std::vector<std::string> names = {described.outputs.at("segments")};
  if (has_scores) names.push_back(described.outputs.at("scores"));
  const auto found = model->model.Run({{described.inputs.at("image"), input.tensor}}, names);
  const auto& path = model->model.path();
  const OnnxTable table = ToTable(path, names[0], found[0], 4, false);
  std::vector<float> scores;
  if (has_scores) scores = found[1].floats;
  if (has_scores && scores.size() != table.num_rows) {
    throw InputError(path, fmt::format("output '{}': expected a score for each segment ({}), found "
                                       "{} floats",
                                       names[1], table.num_rows, scores.size()));
  }
  std::vector<LineSegment2d> segments;
  for (const size_t i : BestRows(described, table.num_rows, scores)) {
    const LineSegment2d segment{input.ToPhotograph(described, table.At(i, 0), table.At(i, 1)),
                                input.ToPhotograph(described, table.At(i, 2), table.At(i, 3))};
    if (segment.start != segment.end) segments.push_back(segment);
  }
  return segments;
}

}  // namespace holba
