// SPDX-License-Identifier: BSD-3-Clause
// The structure of one photograph: segments with descriptors, corners, vanishing points. Detected,
// or taken from the database, which keeps it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "holba/estimation/directions/vanishing_points.h"
#include "holba/frontend/detectors/feature_extractor.h"
#include "holba/frontend/importers/import_segments.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/io/database.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct StructureTask {
  image_t image_id = kInvalidId32, database_id = kInvalidId32;
  std::string name;
  const Camera* camera = nullptr;
  std::filesystem::path path;
  std::filesystem::path mask, camera_mask;     // of the image, of all images; empty: none
  const ImportedSegments* imported = nullptr;  // used instead of ours
  // What features and vanishing points depend on (AddSettings).
  std::string feature_settings, vp_settings;
  bool has_features = false, has_vps = false;  // they were in the database
  ImageFeatures features;
};

// A part of the settings that says which photograph features are of.
std::string PhotographText(const std::filesystem::path& path);

// Where COLMAP looks for the mask of an image: NAME.png, or NAME with the extension .png.
std::filesystem::path MaskOf(const std::string& mask_path, const std::string& name);

// Throws InputError if it is not there, cannot be read, or has not this size.
GreyImage ReadMask(const std::filesystem::path& path, uint64_t width, uint64_t height);
// Where features may be: what both masks of the task allow. Empty: everywhere.
std::optional<GreyImage> ReadMasks(const StructureTask& task);
GreyImage ReadPhotographOfSize(const std::filesystem::path& path, uint64_t width, uint64_t height,
                               const char* remedy);

// Both of a task's settings, from the options, the camera, the import, the masks and the
// photograph, whose files are read for it.
void AddSettings(const ExtractionOptions& extraction, const VanishingPointOptions& vps,
                 StructureTask* task);

// What the database has that was made with the task's settings.
void ReadStored(const Database& database, StructureTask* task);

// Segments, descriptors and corners (unless the database had them), then vanishing points.
// `photograph` and `mask` (null: none) have the camera's size; the photograph is not looked at if
// the task has features.
void DetectStructure(const ExtractionOptions& extraction, const VanishingPointOptions& vps,
                     const GreyImage* photograph, const GreyImage* mask, StructureTask* task);

// Of the features' segments; each segment gets the one it runs to.
void FindVanishingPoints(const VanishingPointOptions& options, const Camera& camera,
                         ImageFeatures* features);

// In one transaction.
void StoreStructure(const StructureTask& task, Database* database);

// A camera whose photographs show straight lines straight is a pinhole to what depends on that,
// whatever its model: that with its focal lengths and principal point. Else the camera itself.
Camera AsPinholeIfStraight(const Camera& camera);

}  // namespace holba
