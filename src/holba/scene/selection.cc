// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/selection.h"

#include <algorithm>
#include <map>
#include <vector>

namespace holba {

void RemoveStructure(Reconstruction* model) {
  model->DeleteGroups3D([](group3D_t, const Group3D&) { return true; });
  model->DeleteEdges([](const WireframeEdge&) { return true; });
  model->DeleteLines3D([](line3D_t, const Line3D&) { return true; });
  RemovePointsOfStructure(model);
  for (auto* images : {&model->images, &model->unregistered_images}) {
    for (auto& [image_id, image] : *images) {
      model->RemoveGroups2D(image_id, [](group2D_t) { return true; });
      model->RemoveLines2D(image_id, [](line2D_t) { return true; });
    }
  }
  // Ids of structure that is built anew begin with 1.
  model->lines3D = {};
  model->groups3D = {};
}

void RemovePointsOfStructure(Reconstruction* model) {
  const bool has_some = std::any_of(model->points3D.begin(), model->points3D.end(),
                                    [](const auto& entry) { return IsOfStructure(entry.second.origin); });
  if (!has_some) return;
  for (auto& [image_id, image] : model->images) {
    model->RemovePoints2D(image_id, [&model, &image = image](point2D_t idx) {
      const point3D_t id = image.points2D[idx].point3D_id;
      return id != kNoId && IsOfStructure(model->points3D.at(id).origin);
    });
  }
  model->DeletePoints3D([](point3D_t, const Point3D& point) { return IsOfStructure(point.origin); });
}

void ObserveGroups(Reconstruction* model) {
  for (auto& [image_id, image] : model->images) {
    model->RemoveGroups2D(image_id, [&image = image](group2D_t idx) {
      return image.groups2D[idx].group3D_id != kNoId;
    });
  }
  for (const auto& [group_id, group] : model->groups3D) {
    // By position in the list of images: their order decides that of the observations.
    std::map<size_t, Group2D> in_image;
    const auto of = [&, type = group.type](image_t image_id) -> Group2D& {
      Group2D& group2D = in_image[model->images.IndexOf(image_id)];
      group2D.type = type;
      return group2D;
    };
    for (point3D_t id : group.point3D_ids) {
      for (const PointObservation& o : model->points3D.at(id).track)
        of(o.image_id).point2D_idxs.push_back(o.point2D_idx);
    }
    for (line3D_t id : group.line3D_ids) {
      for (const LineObservation& o : model->lines3D.at(id).track)
        of(o.image_id).line2D_idxs.push_back(o.line2D_idx);
    }
    for (auto& [position, group2D] : in_image) {
      const auto tidy = [](auto* idxs) {
        std::sort(idxs->begin(), idxs->end());
        idxs->erase(std::unique(idxs->begin(), idxs->end()), idxs->end());
      };
      tidy(&group2D.point2D_idxs);
      tidy(&group2D.line2D_idxs);
      const image_t image_id = model->images.begin()[position].first;
      model->AddObservation(group_id,
                            GroupObservation{image_id, model->AddGroup2D(image_id, std::move(group2D))});
    }
  }
}

}  // namespace holba
