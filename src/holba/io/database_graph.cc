// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/database_graph.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>

#include "holba/base/check.h"
#include "holba/base/error.h"

namespace holba {

CorrespondenceGraph ReadCorrespondenceGraph(const Database& database,
                                            const MatchSelection& selection,
                                            const ImageFeatureMap* features,
                                            const LineMatchMap* line_matches) {
  CorrespondenceGraphBuilder builder;
  std::map<image_t, bool> has_keypoints;
  for (const auto& [image_id, image] : database.ReadImages()) {
    const std::optional<size_t> num_keypoints = database.NumKeypoints(image_id);
    size_t num_segments = 0;
    if (features != nullptr) {
      const auto found = features->find(image_id);
      if (found != features->end()) num_segments = found->second.segments.size();
    }
    has_keypoints[image_id] = num_keypoints.has_value();
    builder.AddImage(image_id, num_keypoints.value_or(0), num_segments);
  }
  const size_t min_num_matches = std::max<size_t>(selection.min_num_matches, 1);
  for (const auto& [image_id1, image_id2] : database.VerifiedPairs(min_num_matches)) {
    for (const image_t image_id : {image_id1, image_id2}) {
      const auto found = has_keypoints.find(image_id);
      if (found != has_keypoints.end() && found->second) continue;
      throw InputError(
          database.path(),
          fmt::format("two_view_geometries has matches of images {} and {}, but {} {}; match these "
                      "images again, or remove the row",
                      image_id1, image_id2,
                      found == has_keypoints.end() ? "there is no image" : "no keypoints of image",
                      image_id));
    }
    const auto geometry = database.ReadTwoViewGeometry(image_id1, image_id2);
    HOLBA_CHECK(geometry.has_value());
    if (selection.ignore_watermarks && geometry->config == TwoViewConfig::kWatermark) continue;
    builder.AddTwoViewGeometry(image_id1, image_id2, *geometry);
  }
  if (line_matches != nullptr) {
    for (const auto& [pair, matches] : *line_matches) {
      builder.AddLineMatches(pair.first, pair.second, matches);
    }
  }
  return builder.Build();
}

}  // namespace holba
