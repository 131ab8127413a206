// SPDX-License-Identifier: BSD-3-Clause
// Photographs of a preset with everything that is true of them, as files.
#pragma once

#include <string>
#include <string_view>

#include "holba/base/options.h"
#include "holba/io/files.h"
#if defined(HOLBA_WITH_EMBREE)
#include "holba/render/rendering.h"
#endif

namespace holba {

struct PlaceSetOptions {
  bool is_jpeg = true;
  bool maps = true;
#if defined(HOLBA_WITH_EMBREE)
  RenderOptions render;
#endif

  void Describe(OptionTable* table) const;
};

// Writes images, truth (a model), mesh.ply and, if wanted, depth, normals and labels into the
// stage. Throws InputError for a preset that is unknown.
void RenderPlaceSet(const std::string& preset, uint64_t seed, const PlaceSetOptions& options,
                    int num_threads, StagedFolder* stage);
// Whether an entry of the folder is of such a set.
bool IsPlaceSetFile(std::string_view name);

}  // namespace holba
