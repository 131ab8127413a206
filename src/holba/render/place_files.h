// SPDX-License-Identifier: BSD-3-Clause
// What goes with photographs, as bytes of files: the mesh of a place as PLY, maps as numpy's
// arrays.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "holba/render/photographer.h"
#include "holba/render/place.h"

namespace holba {

// Triangles in metres, coloured; curved surfaces within a tenth of a millimetre. Every vertex has
// the label of what it belongs to (0: none).
void FormatPlaceMesh(const Place& place, std::ostream* stream);

// (H, W) metres along z, and (H, W, 3) unit vectors in the camera frame, as float32; 0: nothing
// there.
void FormatDepthNpy(const TruthMaps& maps, std::ostream* stream);
void FormatNormalsNpy(const TruthMaps& maps, std::ostream* stream);

// The label of each pixel: the id of the entity's group in the truth; 0: none.
std::vector<uint16_t> LabelsOf(const TruthMaps& maps);
// labels.json of docs/import.md: the type of each label.
std::string LabelTypesJson(const Place& place);

}  // namespace holba
