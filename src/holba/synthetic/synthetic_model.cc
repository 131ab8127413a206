// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/synthetic_model.h"

#include <algorithm>
#include <tuple>
#include <utility>
#include <vector>

namespace holba {

Line3D MakeSyntheticLine(const Segment3d& segment) {
  Line3D line;
  line.line = PlueckerLine::FromPoints(segment[0], segment[1]);
  line.start = segment[0];
  line.end = segment[1];
  return line;
}

void AddAssociations(const SyntheticStructure& structure, Reconstruction* model) {
  for (size_t k = 0; k < structure.groups.size(); ++k) {
    const SyntheticGroup& source = structure.groups[k];
    Group3D group;
    group.type = source.type;
    group.params = source.params;
    // (image, is line, index), sorted: one Group2D for each image.
    std::vector<std::tuple<image_t, bool, uint32_t>> seen;
    for (const uint32_t p : source.points) {
      group.point3D_ids.push_back(SyntheticIdOf(p));
      for (const PointObservation& o : model->points3D.at(SyntheticIdOf(p)).track) {
        seen.emplace_back(o.image_id, false, o.point2D_idx);
      }
    }
    for (const uint32_t l : source.lines) {
      group.line3D_ids.push_back(SyntheticIdOf(l));
      for (const LineObservation& o : model->lines3D.at(SyntheticIdOf(l)).track) {
        seen.emplace_back(o.image_id, true, o.line2D_idx);
      }
    }
    std::sort(seen.begin(), seen.end());
    Group2D* in_image = nullptr;
    for (const auto& [image_id, is_line, idx] : seen) {
      if (group.observations.empty() || group.observations.back().image_id != image_id) {
        auto& groups2D = model->images.at(image_id).groups2D;
        group.observations.push_back({image_id, static_cast<group2D_t>(groups2D.size())});
        groups2D.push_back({group.type, SyntheticIdOf(k), {}, {}});
        in_image = &groups2D.back();
      }
      (is_line ? in_image->line2D_idxs : in_image->point2D_idxs).push_back(idx);
    }
    model->groups3D.Add(SyntheticIdOf(k), std::move(group));
  }
  for (const SyntheticEdge& edge : structure.edges) {
    const auto& line_track = model->lines3D.at(SyntheticIdOf(edge.line)).track;
    uint64_t num_images = 0;
    for (const PointObservation& o : model->points3D.at(SyntheticIdOf(edge.point)).track) {
      num_images += std::any_of(line_track.begin(), line_track.end(),
                                [&](const LineObservation& l) { return l.image_id == o.image_id; });
    }
    // A pair that no image of both tracks shows was still seen to meet somewhere.
    model->wireframe.push_back(
        {SyntheticIdOf(edge.point), SyntheticIdOf(edge.line), std::max<uint64_t>(1, num_images)});
  }
  for (const SyntheticRelation& relation : structure.relations) {
    model->relations.push_back(
        {SyntheticIdOf(relation.group1), SyntheticIdOf(relation.group2), relation.type});
  }
}

}  // namespace holba
