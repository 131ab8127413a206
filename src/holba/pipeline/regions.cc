// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/regions.h"

#include <utility>
#include <vector>

#include "holba/frontend/importers/import_correspondences.h"
#include "holba/pipeline/image_pairs.h"
#include "holba/scene/covisibility.h"

namespace holba {
namespace {

// Of images with label maps, in both directions: a field leads from one image into another.
std::map<std::pair<image_t, image_t>, std::vector<SharedPoint>> SharedPixels(
    const ImageFeatureMap& features, const Reconstruction& model) {
  const Covisibility covisibility(model);
  std::vector<image_t> image_ids;
  std::vector<bool> is_labelled;
  for (const auto& [image_id, image] : model.images) {
    const auto it = features.find(image_id);
    image_ids.push_back(image_id);
    is_labelled.push_back(it != features.end() && !it->second.label_map.empty());
  }
  std::map<std::pair<image_t, image_t>, std::vector<SharedPoint>> pixels;
  for (size_t i = 0; i < image_ids.size(); ++i) {
    if (!is_labelled[i]) continue;
    const auto neighbours = covisibility.NeighboursOf(i);
    const Covisibility::Shared shared = covisibility.SharedWithNeighbours(i);
    for (size_t k = 0; k < neighbours.size(); ++k) {
      const uint32_t j = neighbours[k].image_idx;
      if (!is_labelled[j]) continue;
      pixels[{image_ids[i], image_ids[j]}] =
          PixelsOf(model.images.at(image_ids[i]), model.images.at(image_ids[j]), shared[k]);
    }
  }
  return pixels;
}

Eigen::Vector2d SizeOf(const Reconstruction& model, image_t id) {
  const Camera& camera = model.cameras.at(model.images.at(id).camera_id);
  return {static_cast<double>(camera.width), static_cast<double>(camera.height)};
}

}  // namespace

void RegionOptions::Describe(OptionTable* table) const {
  table->Section("Regions");
  table->Choice("matching", &matching,
                {{"votes", RegionMatching::kVotes}, {"warp", RegionMatching::kWarp}},
                "How labelled regions of two images are matched: by the features they share, or by "
                "warping masks through dense correspondences.");
  groups.Describe(table);
  votes.Describe(table);
  warp.Describe(table);
  interpolation.Describe(table);
}

RegionObservations ObserveRegions(const RegionOptions& options, const std::string& field_path,
                                  const ImageFeatureMap& features, const LineMatchMap& matches,
                                  Reconstruction* model, RegionReport* report) {
  RegionObservations observations;
  std::map<std::pair<image_t, uint16_t>, group2D_t> group_of_label;
  for (auto& [image_id, image] : model->images) {
    const auto it = features.find(image_id);
    if (it == features.end() || it->second.label_map.empty()) continue;
    const Camera& camera = model->cameras.at(image.camera_id);
    RegionGroups regions =
        GroupsOfLabelMap(it->second.label_map, image, camera.width, camera.height, options.groups);
    for (const auto& [reason, count] : regions.dropped) report->dropped[reason] += count;
    for (size_t i = 0; i < regions.groups.size(); ++i) {
      const auto group2D_idx = static_cast<group2D_t>(image.groups2D.size());
      group_of_label[{image_id, regions.labels[i]}] = group2D_idx;
      const auto normal = it->second.normals.find(regions.labels[i]);
      if (normal != it->second.normals.end())
        observations.normals[{image_id, group2D_idx}] = normal->second;
      image.groups2D.push_back(std::move(regions.groups[i]));
    }
  }
  report->num_groups2D = group_of_label.size();

  if (options.matching == RegionMatching::kVotes) {
    GroupVotingReport votes;
    for (const GroupMatch& match : MatchGroupsByVotes(*model, &matches, options.votes, &votes))
      observations.matches.push_back(
          {{match.image_id1, match.group2D_idx1}, {match.image_id2, match.group2D_idx2}});
    for (const auto& [reason, count] : votes.dropped) report->dropped[reason] += count;
  } else {
    RegionWarpReport warp;
    const auto use = [&](image_t from, image_t to, const CorrespondenceField& field) {
      const auto map1 = features.find(from), map2 = features.find(to);
      if (map1 == features.end() || map2 == features.end()) return;
      for (const RegionMatch& match : MatchRegionsByWarping(
               map1->second.label_map, map2->second.label_map, field, options.warp, &warp)) {
        const auto group1 = group_of_label.find({from, match.label1});
        const auto group2 = group_of_label.find({to, match.label2});
        if (group1 != group_of_label.end() && group2 != group_of_label.end())
          observations.matches.push_back({{from, group1->second}, {to, group2->second}});
      }
    };
    if (!field_path.empty()) {
      CorrespondenceImportReport imported;
      ForEachCorrespondenceField(field_path, *model, use, &imported);
    } else {
      for (const auto& [pair, pixels] : SharedPixels(features, *model)) {
        use(pair.first, pair.second,
            InterpolateMatches(pixels, SizeOf(*model, pair.first), SizeOf(*model, pair.second),
                               options.interpolation));
      }
    }
    for (const auto& [reason, count] : warp.dropped) report->dropped[reason] += count;
  }
  report->num_matches = observations.matches.size();
  return observations;
}

}  // namespace holba
