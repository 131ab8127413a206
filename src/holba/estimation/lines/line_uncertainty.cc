// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/line_uncertainty.h"

namespace holba {

std::vector<LineSupport> SupportsOfLine(const Reconstruction& model, const ViewMap& views,
                                        const Line3D& line) {
  std::vector<LineSupport> supports;
  for (const LineObservation& observation : line.track) {
    const IdealView& view = views.at(observation.image_id);
    const Image& image = model.images.at(observation.image_id);
    const std::optional<LineSegment2d> ideal =
        view.ToIdeal(image.lines2D[observation.line2D_idx].segment);
    if (ideal && ideal->Length() > 0.0) supports.emplace_back(view, *ideal, observation.image_id);
  }
  return supports;
}

LineWithExtent WithExtent(const Line3D& line) {
  LineWithExtent result;
  result.line.direction = line.line.direction.normalized();
  result.line.point = line.line.ClosestPoint(0.5 * (line.start + line.end));
  result.t_start = result.line.direction.dot(line.start - result.line.point);
  result.t_end = result.line.direction.dot(line.end - result.line.point);
  return result;
}

std::optional<LineUncertainty> UncertaintyOfLine(const Reconstruction& model, const ViewMap& views,
                                                 line3D_t line3D_id, double sigma_px) {
  const Line3D& line = model.lines3D.at(line3D_id);
  const LineWithExtent placed = WithExtent(line);
  return UncertaintyOfFit(SupportsOfLine(model, views, line), LinePrior(), sigma_px, placed.line,
                          placed.t_start, placed.t_end);
}

}  // namespace holba
