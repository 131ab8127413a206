// SPDX-License-Identifier: BSD-3-Clause
// Uncertainty of the lines of a model, cameras held: what residuals in pixels cannot show.
#pragma once

#include <map>
#include <optional>

#include "holba/estimation/lines/line_fit.h"
#include "holba/scene/reconstruction.h"
#include "holba/scene/views.h"

namespace holba {

// From the segments of its track alone. Empty: no segment sees it, or its extent is a point or
// behind the cameras.
std::optional<LineUncertainty> UncertaintyOfLine(const Reconstruction& model, const ViewMap& views,
                                                 line3D_t line3D_id, double sigma_px);

// The segments of a line's track in ideal pixels; those that have none are left out.
std::vector<LineSupport> SupportsOfLine(const Reconstruction& model, const ViewMap& views,
                                        const Line3D& line);

// The line with its point amid the extent, and the extent's ends as parameters of it.
struct LineWithExtent {
  AnchoredLine line;
  double t_start = 0.0, t_end = 0.0;
};
LineWithExtent WithExtent(const Line3D& line);

}  // namespace holba
