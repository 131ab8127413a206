// SPDX-License-Identifier: BSD-3-Clause
// Pictures of what a database holds of one or two images, for people to look at.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "holba/frontend/photographs/photograph.h"
#include "holba/io/database.h"

namespace holba {

// The names in a list "a.jpg,b.jpg" of one or two images of the database; names may have commas.
// Throws InputError for others.
std::vector<std::string> NamedImages(const Database& database, const std::string& list);

// Of one image its features; of two, what both hold and their matches: inliers, rejected ones,
// segments (the mutual nearest ones). On white where `image_path` is empty, else on the photographs
// in that folder. `size_px`: longer side of an image. Throws InputError for photographs that are
// not there.
ColourImage DrawDatabaseImages(const Database& database, const std::vector<std::string>& names,
                               const std::optional<std::filesystem::path>& image_path, int size_px);

// Writes a whole picture, or throws InputError and leaves what was there.
void WritePicture(const ColourImage& picture, const std::filesystem::path& path);
// What would keep WritePicture from it, found out by trying. Throws InputError.
void ProbePicture(const std::filesystem::path& path);

}  // namespace holba
