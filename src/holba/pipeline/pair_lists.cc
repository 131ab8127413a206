// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/pair_lists.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <sstream>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/threads.h"
#include "holba/frontend/matching/retrieval.h"
#include "holba/geometry/earth.h"

namespace holba {
namespace {

ImagePair Ordered(image_t a, image_t b) { return a < b ? ImagePair(a, b) : ImagePair(b, a); }

// Blocks of images against blocks, so that few images are needed at a time.
std::vector<ImagePair> Exhaustive(const std::vector<image_t>& ids, size_t block_size) {
  std::vector<ImagePair> pairs;
  for (size_t begin1 = 0; begin1 < ids.size(); begin1 += block_size) {
    for (size_t begin2 = begin1; begin2 < ids.size(); begin2 += block_size) {
      const size_t end1 = std::min(begin1 + block_size, ids.size());
      const size_t end2 = std::min(begin2 + block_size, ids.size());
      for (size_t i = begin1; i < end1; ++i) {
        for (size_t j = std::max(begin2, i + 1); j < end2; ++j)
          pairs.push_back(Ordered(ids[i], ids[j]));
      }
    }
  }
  return pairs;
}

// For each image (by position in `ids`) the positions of those that look most like it.
std::vector<std::vector<uint32_t>> FindAlike(const Database& database,
                                             const std::vector<image_t>& ids, size_t count,
                                             size_t period, int num_threads) {
  RetrievalOptions options;
  options.num_threads = num_threads;
  std::vector<Descriptors> strongest(ids.size());
  for (size_t i = 0; i < ids.size(); ++i) {
    const auto descriptors = database.ReadDescriptors(ids[i]);
    if (!descriptors) continue;
    strongest[i] = StrongestFirst(database.ReadKeypoints(ids[i]).value_or(Keypoints{}),
                                  *descriptors, options.max_descriptors_per_image);
  }
  std::vector<std::vector<uint32_t>> alike = FindImagesAlike(options, strongest, count);
  for (size_t i = 0; i < ids.size(); ++i) {
    if (i % period != 0) alike[i].clear();
  }
  return alike;
}

std::vector<ImagePair> Retrieval(const PairListOptions& options, const Database& database,
                                 const std::vector<image_t>& ids, int num_threads) {
  std::set<ImagePair> pairs;
  const auto alike =
      FindAlike(database, ids, static_cast<size_t>(options.num_images), 1, num_threads);
  for (size_t i = 0; i < ids.size(); ++i) {
    for (uint32_t j : alike[i]) pairs.insert(Ordered(ids[i], ids[j]));
  }
  return {pairs.begin(), pairs.end()};
}

// Images in the order of their names.
std::vector<ImagePair> Sequential(const PairListOptions& options, const Database& database,
                                  const std::map<image_t, DatabaseImage>& images, int num_threads) {
  std::vector<image_t> ids;
  for (const auto& [id, image] : images) ids.push_back(id);
  std::sort(ids.begin(), ids.end(),
            [&](image_t a, image_t b) { return images.at(a).name < images.at(b).name; });
  std::vector<ImagePair> pairs;
  std::set<ImagePair> known;
  const auto add = [&](size_t i, size_t j) {
    const ImagePair pair = Ordered(ids[i], ids[j]);
    if (i != j && known.insert(pair).second) pairs.push_back(pair);
  };
  for (size_t i = 0; i < ids.size(); ++i) {
    for (int k = 1; k <= options.overlap; ++k) {
      if (i + k < ids.size()) add(i, i + k);
      if (!options.quadratic_overlap || k >= 32) continue;
      const size_t distance = size_t{1} << k;
      if (i + distance < ids.size()) add(i, i + distance);
    }
  }
  if (options.loop_detection) {
    const auto alike =
        FindAlike(database, ids, static_cast<size_t>(options.loop_detection_num_images),
                  static_cast<size_t>(options.loop_detection_period), num_threads);
    for (size_t i = 0; i < ids.size(); ++i) {
      for (uint32_t j : alike[i]) add(i, j);
    }
  }
  return pairs;
}

std::vector<ImagePair> Spatial(const PairListOptions& options, const Database& database,
                               const std::map<image_t, DatabaseImage>& images) {
  std::vector<image_t> ids;
  std::vector<Eigen::Vector3d> places;
  for (const auto& [id, prior] : database.ReadPosePriors()) {
    if (!prior.position || !images.contains(id)) continue;
    Eigen::Vector3d place = *prior.position;
    if (options.ignore_z) place.z() = 0.0;
    ids.push_back(id);
    places.push_back(prior.system == PosePrior::System::kWgs84 ? EarthCentred(place) : place);
  }
  if (ids.size() < 2) {
    throw InputError(database.path(),
                     fmt::format("--pairs spatial: expected images with a position (table "
                                 "pose_priors), at least 2, found {}",
                                 ids.size()));
  }
  std::set<ImagePair> pairs;
  for (size_t i = 0; i < ids.size(); ++i) {
    std::vector<std::pair<double, size_t>> near;
    for (size_t j = 0; j < ids.size(); ++j) {
      const double distance = (places[i] - places[j]).norm();
      if (i != j && distance <= options.max_distance) near.emplace_back(distance, j);
    }
    std::sort(near.begin(), near.end());
    near.resize(std::min(near.size(), static_cast<size_t>(options.max_num_neighbors)));
    for (const auto& [distance, j] : near) pairs.insert(Ordered(ids[i], ids[j]));
  }
  return {pairs.begin(), pairs.end()};
}

// Lines "NAME1 NAME2"; names may have blanks if only one way to cut the line gives two images.
std::vector<ImagePair> FromList(const std::string& path,
                                const std::map<image_t, DatabaseImage>& images) {
  std::map<std::string, image_t> ids;
  for (const auto& [id, image] : images) ids[image.name] = id;
  std::istringstream file(ReadFileBytes(path));
  std::vector<ImagePair> pairs;
  std::set<ImagePair> known;
  std::string text;
  for (uint64_t line = 1; std::getline(file, text); ++line) {
    while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
    if (text.empty() || text.front() == '#') continue;
    std::vector<ImagePair> readings;
    for (size_t cut = text.find(' '); cut != std::string::npos; cut = text.find(' ', cut + 1)) {
      const auto first = ids.find(text.substr(0, cut));
      const auto second = ids.find(text.substr(cut + 1));
      if (first != ids.end() && second != ids.end() && first->second != second->second)
        readings.push_back(Ordered(first->second, second->second));
    }
    if (readings.size() != 1) {
      throw InputError::AtLine(path, line,
                               "expected the names of two different images of the database, "
                               "found '" +
                                   text + "'");
    }
    if (known.insert(readings[0]).second) pairs.push_back(readings[0]);
  }
  return pairs;
}

}  // namespace

void PairListOptions::Describe(OptionTable* table) const {
  table->Section("");
  table->Choice(
      "pairs", &selection,
      {{"auto", PairSelection::kAutomatic},
       {"exhaustive", PairSelection::kExhaustive},
       {"sequential", PairSelection::kSequential},
       {"spatial", PairSelection::kSpatial},
       {"retrieval", PairSelection::kRetrieval},
       {"list", PairSelection::kList}},
      "Which images are matched: all with all up to 300 images, else those that look alike; all "
      "with all; neighbours by name; neighbours by position; those that look most alike; the "
      "pairs of a file.");
  table->Section("ExhaustiveMatching");
  table->Field("block_size", &block_size, AtLeast(1),
               "Images that are kept in memory at a time are twice as many.");
  table->Section("SequentialMatching");
  table->Field("overlap", &overlap, AtLeast(1), "Following images that each is matched with.");
  table->Field("quadratic_overlap", &quadratic_overlap,
               "Whether also those 2, 4, 8, ... images further on.");
  table->Field("loop_detection", &loop_detection,
               "Whether images are matched with those that look alike, too.");
  table->Field("loop_detection_period", &loop_detection_period, AtLeast(1),
               "Of so many images in a row one is.");
  table->Field("loop_detection_num_images", &loop_detection_num_images, AtLeast(1),
               "With so many.");
  table->Section("SpatialMatching");
  table->Field("ignore_z", &ignore_z, "Whether heights of positions count for nothing.");
  table->Field("max_num_neighbors", &max_num_neighbors, AtLeast(1),
               "Nearest images that each is matched with.");
  table->Field("max_distance", &max_distance, GreaterThan(0),
               "Largest distance of such, in metres or the unit of the positions.");
  table->Section("Retrieval");
  table->Field("num_images", &num_images, AtLeast(1),
               "Images that each is matched with: those that look most like it.");
  table->Section("ImportedMatching");
  table->Field("match_list_path", &match_list_path, "File with the names of two images a line.");
  table->Section("");
}

void PairListOptions::Check() const {
  if ((selection == PairSelection::kList) == match_list_path.empty()) {
    throw InputError(
        "--pairs list and --ImportedMatching.match_list_path must go together; give both or none");
  }
}

std::vector<ImagePair> ListPairs(const PairListOptions& options, const Database& database,
                                 int num_threads) {
  const std::map<image_t, DatabaseImage> images = database.ReadImages();
  std::vector<image_t> ids;
  for (const auto& [id, image] : images) ids.push_back(id);
  switch (options.selection) {
    case PairSelection::kAutomatic:
      return ids.size() > kMaxNumExhaustive
                 ? Retrieval(options, database, ids, num_threads)
                 : Exhaustive(ids, static_cast<size_t>(options.block_size));
    case PairSelection::kExhaustive:
      return Exhaustive(ids, static_cast<size_t>(options.block_size));
    case PairSelection::kSequential:
      return Sequential(options, database, images, num_threads);
    case PairSelection::kSpatial:
      return Spatial(options, database, images);
    case PairSelection::kRetrieval:
      return Retrieval(options, database, ids, num_threads);
    case PairSelection::kList:
      return FromList(options.match_list_path, images);
  }
  return {};
}

}  // namespace holba
