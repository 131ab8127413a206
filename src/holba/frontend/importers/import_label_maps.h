// SPDX-License-Identifier: BSD-3-Clause
// Segmentations of other tools: a PNG of labels for each image, and JSON that says what they are
// (docs: Importing features).
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// {"labels": {"1": "plane", "7": "cylinder", "9": null}}: the types, in any case; null: none.
// Throws InputError.
std::map<uint16_t, const GroupType*> ParseLabelTypes(std::string_view json,
                                                     const std::filesystem::path& path);

// Labels from a PNG: grey or indexed. Without types. Throws InputError.
LabelMap ParseLabelPng(std::string_view png, const std::filesystem::path& path);

// FOLDER/NAME.EXT, else FOLDER/STEM.EXT (NAME without its extension), for the extensions in order.
// Empty: there is none.
std::optional<std::filesystem::path> FindFileOfImage(const std::filesystem::path& folder,
                                                     const std::string& image_name,
                                                     const std::vector<std::string>& extensions);

// FOLDER/NAME.png with the types, of the labels that it has, of NAME.json or, without it, of
// FOLDER/labels.json. Empty: the image has no map. Throws InputError.
std::optional<LabelMap> ReadLabelMap(const std::filesystem::path& folder,
                                     const std::string& image_name);

}  // namespace holba
