// SPDX-License-Identifier: BSD-3-Clause
// A model in three dimensions as pictures for papers: points in their colours, lines by vanishing
// point, planes and other groups as translucent surfaces of the extent of their members, junctions,
// cameras, with what the colours mean and, where one scale holds for all of a picture, a bar of
// known length.
#pragma once

#include <string>

#include "holba/frontend/drawing/pictures.h"
#include "holba/frontend/drawing/scene_view.h"

namespace holba {

struct ScenePictureOptions {
  // What the bar is labelled with: "m" where a model is in metres; empty: units of the model.
  std::string unit;
  int num_threads = -1;
};

// On white.
ColourImage DrawScene(const Reconstruction& model, const SceneView& view,
                      const ScenePictureOptions& options);

// What an image sees of the model, through its lens, over its photograph: surfaces (those in front
// cover those behind), its lines as they project in the colours of their vanishing points, its
// segments as white edges under them, and its keypoints in a colour for how far the point projects
// from them.
ColourImage DrawSceneInImage(const Reconstruction& model, image_t image_id,
                             const ColourImage& photograph, int num_threads);

}  // namespace holba
