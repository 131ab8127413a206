// SPDX-License-Identifier: BSD-3-Clause
// Pictures of a model for people to look at: what was found in a photograph, and the scene from
// above. The same group has the same colour in all of them. A photograph may be smaller or larger
// than the camera of its image; it is drawn pale, so that the colours speak.
#pragma once

#include <array>
#include <cstdint>

#include "holba/frontend/photographs/photograph.h"
#include "holba/scene/reconstruction.h"

namespace holba {

using Rgb = std::array<uint8_t, 3>;

// Vanishing points are counted by themselves, and so are all other groups, in the order of the
// model.
Rgb GroupColour(const Reconstruction& model, group3D_t group3D_id);

// Segments in the colour of the vanishing point of their 3D line, grey without; thin and faint
// without a 3D line.
ColourImage DrawSegments(const Reconstruction& model, image_t image_id,
                         const ColourImage& photograph);

// Planes as translucent regions between their points that this image observes, and those points as
// dots; other groups as the outline of their extent.
ColourImage DrawGroups(const Reconstruction& model, image_t image_id,
                       const ColourImage& photograph);

// Junctions (points that lie on 3D lines) as rings, with the segments they join.
ColourImage DrawWireframe(const Reconstruction& model, image_t image_id,
                          const ColourImage& photograph);

// The scene from above on white: lines in the colours of their vanishing points, vertical planes as
// broad traces, points as faint dots, cameras as black arrowheads. Square, fitted to the 2 to 98
// percentiles of the lines and to the cameras.
ColourImage DrawTopView(const Reconstruction& model, int size_px);

}  // namespace holba
