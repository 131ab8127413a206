// SPDX-License-Identifier: BSD-3-Clause
// Blocks of points and lines, and the residuals of their observations.
#include <algorithm>
#include <set>

#include "holba/bundle/problem_builder.h"

namespace holba {

void ProblemBuilder::AddPoints() {
  const size_t num_points = selection_.points.size();
  problem_.Reserve(problem_.num_blocks() + num_points, problem_.state().size() + 3 * num_points);
  out_.points.reserve(num_points);
  BatchOfImages<PointResidual> with_sensors(this);
  const bool one_model = std::all_of(images_.begin(), images_.end(), [&](const auto& image) {
    return image.model == images_.front().model;
  });
  // Groups and incidences look for points.
  const bool is_looked_for = options_.config >= BundleConfig::kGroups;
  if (is_looked_for) {
    point_idx_ = FlatIndex(num_points);
    points_.reserve(num_points);
  }
  for (const auto& selected : selection_.points) {
    const Point3D& point = model_.points3D.at(selected.id);
    if (!TakesPart(selected.constant, point.track)) continue;
    const bool of_structure = IsOfStructure(point.origin);
    out_.num_points_of_structure += of_structure;
    const BlockId block = problem_.AddBlock("point", OpsOf<Euclidean<3>>(), BlockRole::kFeature,
                                            {point.xyz.data(), 3});
    problem_.block(block).constant = selected.constant;
    out_.points.emplace_back(selected.id, block);
    if (is_looked_for) {
      point_idx_.Add(selected.id);
      points_.push_back({block, &point});
    }
    ForEachObservation(point.track, [&](ImageBlocks& image, const PointObservation& observation) {
      const std::string_view term = of_structure ? "structure_point" : "point";
      const auto of_image = [&] {
        return BatchOfKernel<PointResidual>{
            term, {3, 6, image.model->num_params}, {image.model->id, -1, 0}, {image.model}};
      };
      const std::array blocks{block, image.pose, image.camera};
      const PointResidual::Datum datum{image.image->points2D[observation.point2D_idx].xy,
                                       image.sensor};
      if (image.sensor_block != kNoBlock) {
        with_sensors.Add(image, blocks, datum, of_image);
        return;
      }
      auto*& batch = of_structure ? image.structure_points : image.points;
      if (batch == nullptr) {
        const BatchOfKernel<PointResidual> made = of_image();
        batch = &BatchOf<PointResidual>(made.term, made.tangents, made.key,
                                        [&] { return made.kernel; });
        if (one_model && !of_structure && batch->size() == 0)
          batch->Reserve(NumPointObservations());
      }
      batch->Add(blocks, datum);
    });
  }
}

// At most.
size_t ProblemBuilder::NumPointObservations() const {
  size_t count = 0;
  for (const auto& selected : selection_.points)
    count += model_.points3D.at(selected.id).track.size();
  return count;
}

SegmentDatum ProblemBuilder::DatumOf(const ImageBlocks& image,
                                     const LineObservation& observation) const {
  const LineSegment2d& segment = image.image->lines2D[observation.line2D_idx].segment;
  return {IdealObservation(*image.model, image.params, segment.start),
          IdealObservation(*image.model, image.params, segment.end), image.sensor};
}

// Whether the lines with incidences leave the eliminated features (3D form only: it couples two
// features).
bool ProblemBuilder::LinesAreKept() const {
  return options_.config >= BundleConfig::kHolistic &&
         options_.wireframe_form == StructureForm::k3d;
}

void ProblemBuilder::AddLines() {
  std::set<line3D_t> in_wireframe;
  if (LinesAreKept()) {
    for (const WireframeEdge& edge : selection_.wireframe) in_wireframe.insert(edge.line3D_id);
  }
  line_idx_ = FlatIndex(selection_.lines.size());
  lines_.reserve(selection_.lines.size());
  BatchOfImages<LineResidual> batches(this);
  for (const auto& selected : selection_.lines) {
    const Line3D& line = model_.lines3D.at(selected.id);
    if (!TakesPart(selected.constant, line.track)) continue;
    // The anchor in the middle of the seen part keeps direction and position uncorrelated.
    const Eigen::Vector3d anchor = line.line.ClosestPoint(0.5 * (line.start + line.end));
    double values[6];
    Eigen::Map<Eigen::Vector3d>{values} = line.line.direction.normalized();
    Eigen::Map<Eigen::Vector3d>{values + 3} = anchor;
    const BlockRole role =
        in_wireframe.contains(selected.id) ? BlockRole::kGroup : BlockRole::kFeature;
    const BlockId block = problem_.AddBlock("line", OpsOf<LineManifold>(), role, values);
    problem_.block(block).constant = selected.constant;
    line_idx_.Add(selected.id);
    lines_.push_back({block, &line});
    out_.lines.emplace_back(selected.id, block);
    ForEachObservation(line.track, [&](const ImageBlocks& image, const LineObservation& o) {
      batches.Add(image, std::array{block, image.pose, image.camera}, DatumOf(image, o), [&] {
        return BatchOfKernel<LineResidual>{"line",
                                           {4, 6, image.model->num_params},
                                           {image.model->id, -1, image.observations_move},
                                           {{image.model, image.observations_move}}};
      });
    });
  }
}

}  // namespace holba
