// SPDX-License-Identifier: BSD-3-Clause
// Residuals of point-line incidences.
#include <algorithm>

#include "holba/bundle/problem_builder.h"
#include "holba/residual/wireframe_3d.h"
#include "holba/residual/wireframe_line.h"
#include "holba/residual/wireframe_point.h"

namespace holba {
namespace {

template <typename Track>
bool Observes(const Track& track, image_t image_id) {
  return std::any_of(track.begin(), track.end(),
                     [&](const auto& observation) { return observation.image_id == image_id; });
}

}  // namespace

void ProblemBuilder::AddWireframe() {
  for (const WireframeEdge& edge : selection_.wireframe) {
    if (filter_.edges.contains({edge.point3D_id, edge.line3D_id})) continue;
    const Feature<Point3D>* point = PointOf(edge.point3D_id);
    const Feature<Line3D>* line = LineOf(edge.line3D_id);
    if (point == nullptr || line == nullptr) continue;
    if (options_.wireframe_form == StructureForm::k3d) {
      AddEdge3d(*point, *line);
    } else {
      AddEdge2d(*point, *line);
    }
  }
}

void ProblemBuilder::AddEdge3d(const Feature<Point3D>& point, const Feature<Line3D>& line) {
  auto& batch = BatchOf<Wireframe3dResidual>("wireframe_3d", {3, 4}, {-1, -1, 0},
                                             [] { return Wireframe3dResidual{}; });
  Use3dWeight(options_.wireframe_3d_weight, &batch);
  batch.Add(std::array{point.block, line.block}, {});
}

// The point where only the line is seen, the line where only the point is.
void ProblemBuilder::AddEdge2d(const Feature<Point3D>& point, const Feature<Line3D>& line) {
  const auto& point_track = point.record->track;
  const auto& line_track = line.record->track;
  BatchOfImages<WireframePointResidual> point_batches(this);
  ForEachObservation(line_track, [&](const ImageBlocks& image, const LineObservation& o) {
    if (Observes(point_track, o.image_id)) return;
    point_batches.Add(image, std::array{point.block, image.pose, image.camera}, DatumOf(image, o),
                      [&] {
                        return BatchOfKernel<WireframePointResidual>{
                            "wireframe_point",
                            {3, 6, image.model->num_params},
                            {image.model->id, -1, image.observations_move},
                            {{image.model, image.observations_move}}};
                      });
  });
  BatchOfImages<WireframeLineResidual> line_batches(this);
  ForEachObservation(point_track, [&](const ImageBlocks& image, const PointObservation& o) {
    if (Observes(line_track, o.image_id)) return;
    const Eigen::Vector2d& xy = image.image->points2D[o.point2D_idx].xy;
    line_batches.Add(image, std::array{line.block, image.pose, image.camera},
                     {IdealObservation(*image.model, image.params, xy), image.sensor}, [&] {
                       return BatchOfKernel<WireframeLineResidual>{
                           "wireframe_line",
                           {4, 6, image.model->num_params},
                           {image.model->id, -1, image.observations_move},
                           {{image.model, image.observations_move}}};
                     });
  });
}

}  // namespace holba
