// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/mapping.h"

#include <utility>
#include <vector>

#include "holba/io/database_scene.h"
#include "holba/pipeline/image_structure.h"
#include "holba/pipeline/match_lines.h"
#include "holba/pipeline/photograph_folder.h"

namespace holba {
namespace {

// What the database has, whatever it was made with.
ImageFeatureMap StoredStructure(const VanishingPointOptions& vps, const Database& database) {
  ImageFeatureMap all;
  const auto cameras = database.ReadCameras();
  for (const auto& [id, image] : database.ReadImages()) {
    const auto settings = database.ReadSegmentSettings(id);
    auto segments = settings ? database.ReadSegments(id, *settings) : std::nullopt;
    if (!segments) continue;
    ImageFeatures& features = all[id];
    features.segments = std::move(*segments);
    if (auto descriptors = database.ReadSegmentDescriptors(id, *settings))
      features.segment_descriptors = std::move(*descriptors);
    const auto vp_settings = database.ReadVanishingPointSettings(id);
    if (auto stored = vp_settings ? database.ReadVanishingPoints(id, *vp_settings) : std::nullopt) {
      features.vanishing_points = std::move(stored->points);
      features.vp_of_segment = std::move(stored->vp_of_segment);
      continue;
    }
    const auto camera = cameras.find(image.camera_id);
    if (camera != cameras.end()) FindVanishingPoints(vps, camera->second.camera, &features);
  }
  return all;
}

// Of pairs whose segments cannot be matched, for want of descriptors, what the database has of
// their matches, whoever made them.
void AddStoredLineMatches(const std::vector<ImagePair>& pairs, const ImageFeatureMap& features,
                          const Database& database, LineMatchMap* matches) {
  const auto is_described = [&](image_t id) {
    const auto found = features.find(id);
    return found != features.end() && !found->second.segment_descriptors.empty();
  };
  for (const auto& [id1, id2] : pairs) {
    if (is_described(id1) && is_described(id2)) continue;
    std::vector<LineMatch> mutual =
        MutualNearest(StoredLineMatches(database, id1, id2), kMaxLineMatchRatio);
    if (!mutual.empty()) (*matches)[{id1, id2}] = std::move(mutual);
  }
}

// All images as if they had poses: what is found in single photographs asks for none.
Reconstruction Posed(Reconstruction scene) {
  std::vector<frame_t> frames;
  for (const auto& [id, frame] : scene.unregistered_frames) frames.push_back(id);
  for (const frame_t id : frames) scene.RegisterFrame(id, Rigid3d());
  return scene;
}

}  // namespace

MappingData ReadMappingData(const MappingDataOptions& options, const DetectionOptions& detection,
                            const LineMatchingOptions& matching,
                            const std::filesystem::path* photographs, Database* database) {
  MappingData data;
  if (options.structure && photographs != nullptr) {
    Reconstruction posed = Posed(ReadScene(*database).scene);
    // As `extract` found it, whose work is not done again.
    for (auto& [id, camera] : posed.cameras) camera = AsPinholeIfStraight(camera);
    std::map<image_t, image_t> own_ids;
    for (const auto& [id, image] : posed.images) own_ids[id] = id;
    std::map<image_t, ImportedSegments> imported;
    DetectionReport report;
    data.input.features = DetectFeatures(detection, PhotographFolder(*photographs, posed), posed,
                                         own_ids, database, &imported, &report);
    for (const LeftOutPhotograph& left_out : report.left_out)
      data.without_photograph.insert(left_out.image_id);
  } else if (options.structure) {
    data.input.features = StoredStructure(detection.vps, *database);
  }
  LineMatchMap line_matches;
  if (!data.input.features.empty()) {
    const std::vector<ImagePair> pairs = database->VerifiedPairs(options.selection.min_num_matches);
    data.segments =
        MatchSegmentsOfPairs(matching, pairs, options.num_threads, database, &line_matches);
    AddStoredLineMatches(pairs, data.input.features, *database, &line_matches);
  }
  DatabaseScene scene = ReadScene(*database, data.input.features);
  data.scene = std::move(scene.scene);
  data.num_images_of_unknown_rigs = scene.num_images_of_unknown_rigs;
  data.input.cameras_of_known_focal_length = std::move(scene.cameras_of_known_focal_length);
  for (const ImagePair& pair : database->MatchedPairs(0)) data.input.compared_pairs.insert(pair);
  data.input.graph =
      ReadCorrespondenceGraph(*database, options.selection, &data.input.features, &line_matches);
  return data;
}

}  // namespace holba
