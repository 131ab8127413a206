// SPDX-License-Identifier: BSD-3-Clause
// Dense correspondences of other tools (RoMa and the like): npy, npz or HDF5 (docs: Importing
// features).
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "holba/frontend/importers/import_store.h"
#include "holba/frontend/matching/region_matching.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// A field from its array: (H, W, 2), the place in image 2 of each pixel of image 1, in its pixels
// (centre of the first at 0); or (H, W, 4) as RoMa's, places in image 1 and 2 from -1 to 1, of
// which the first must be the grid itself. `certainty` (H, W), may be null. Throws InputError.
CorrespondenceField FieldFromArray(const StoredArray& target, const StoredArray* certainty,
                                   const Eigen::Vector2d& size2);

struct CorrespondenceImportReport {
  size_t num_fields = 0;
  size_t num_unknown_pairs = 0;  // with a name that is no image of the model
};

// Calls `use` with each field and the two images it leads from and to, in the order of the names,
// holding one field in memory at a time where the file is a folder. Throws InputError.
void ForEachCorrespondenceField(
    const std::filesystem::path& path, const Reconstruction& model,
    const std::function<void(image_t from, image_t to, const CorrespondenceField& field)>& use,
    CorrespondenceImportReport* report);

}  // namespace holba
