// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/database_pictures.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/temporary_paths.h"
#include "holba/frontend/drawing/pair_pictures.h"
#include "holba/frontend/matching/line_matching.h"
#include "holba/io/files.h"
#include "holba/pipeline/match_segments.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

ShownImage ReadShown(const Database& database, image_t id, const std::string& name,
                     const Camera& camera, const std::optional<fs::path>& image_path) {
  ShownImage shown;
  shown.name = name;
  shown.width = static_cast<int>(camera.width);
  shown.height = static_cast<int>(camera.height);
  if (image_path) shown.photograph = ReadColourImage(*image_path / name);
  if (const auto keypoints = database.ReadKeypoints(id)) {
    for (size_t i = 0; i < keypoints->size(); ++i) shown.points.push_back(keypoints->Position(i));
  }
  if (const auto settings = database.ReadSegmentSettings(id))
    shown.segments = database.ReadSegments(id, *settings).value_or(std::vector<LineSegment2d>());
  if (const auto settings = database.ReadVanishingPointSettings(id)) {
    if (auto vps = database.ReadVanishingPoints(id, *settings))
      shown.vp_of_segment = std::move(vps->vp_of_segment);
  }
  if (const auto settings = database.ReadCornerSettings(id)) {
    if (auto corners = database.ReadCorners(id, *settings))
      shown.corners = std::move(corners->positions);
  }
  return shown;
}

ShownPair ReadPair(const Database& database, image_t id1, image_t id2) {
  ShownPair shown;
  if (auto geometry = database.ReadTwoViewGeometry(id1, id2)) {
    shown.geometry = NameOf(geometry->config);
    shown.inliers = std::move(geometry->inlier_matches);
  }
  const std::set<std::array<point2D_t, 2>> inliers(shown.inliers.begin(), shown.inliers.end());
  for (const auto& match : database.ReadMatches(id1, id2).value_or(PointMatches())) {
    if (!inliers.contains(match)) shown.rejected.push_back(match);
  }
  if (const auto settings = database.ReadLineMatchSettings(id1, id2)) {
    if (const auto matches = database.ReadLineMatches(id1, id2, *settings))
      shown.segments = MutualNearest(*matches, kMaxLineMatchRatio);
  }
  return shown;
}

bool IsPictureName(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

}  // namespace

std::vector<std::string> NamedImages(const Database& database, const std::string& list) {
  if (database.FindImage(list)) return {list};
  std::string missing = list;
  for (size_t comma = list.find(','); comma != std::string::npos;
       comma = list.find(',', comma + 1)) {
    const std::string name1 = list.substr(0, comma), name2 = list.substr(comma + 1);
    const bool has1 = database.FindImage(name1).has_value();
    const bool has2 = database.FindImage(name2).has_value();
    if (has1 && has2) {
      if (name1 != name2) return {name1, name2};
      throw InputError(database.path(),
                       fmt::format("'{}' is named twice; give two different images", name1));
    }
    if (has1) missing = name2;
    if (has2) missing = name1;
  }
  throw InputError(database.path(),
                   fmt::format("there is no image '{}'; see 'holba inspect' for the names, give "
                               "one, or two with a comma between them",
                               missing));
}

ColourImage DrawDatabaseImages(const Database& database, const std::vector<std::string>& names,
                               const std::optional<fs::path>& image_path, int size_px) {
  HOLBA_CHECK(names.size() == 1 || names.size() == 2);
  const auto cameras = database.ReadCameras();
  const auto images = database.ReadImages();
  std::vector<image_t> ids;
  std::vector<ShownImage> shown;
  for (const std::string& name : names) {
    const image_t id = *database.FindImage(name);
    ids.push_back(id);
    shown.push_back(
        ReadShown(database, id, name, cameras.at(images.at(id).camera_id).camera, image_path));
  }
  if (names.size() == 1) return DrawImageFeatures(shown[0], size_px);
  return DrawImagePair(shown[0], shown[1], ReadPair(database, ids[0], ids[1]), size_px);
}

void WritePicture(const ColourImage& picture, const fs::path& path) {
  std::error_code error;
  const fs::path parent = fs::absolute(path).parent_path();
  fs::create_directories(parent, error);
  if (error) throw FolderCannotBeMade(parent, error.message());
  const TemporaryPath temporary(parent / fmt::format(".{}.holba-{}{}", path.stem().string(),
                                                     getpid(), path.extension().string()));
  WriteImage(picture, temporary.path());
  fs::rename(temporary.path(), path, error);
  if (error) throw CannotBeWritten(path, error.message());
}

void ProbePicture(const fs::path& path) {
  if (!IsPictureName(path)) {
    throw InputError(path, "the name of a picture must end in .png, .jpg or .jpeg");
  }
  ProbeFile(path);
}

}  // namespace holba
