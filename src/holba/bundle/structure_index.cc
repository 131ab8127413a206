// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/structure_index.h"

namespace holba {
namespace {

template <typename Entry>
void SortById(uint64_t Entry::* key, std::vector<Entry>* entries) {
  std::stable_sort(entries->begin(), entries->end(),
                   [&](const Entry& a, const Entry& b) { return a.*key < b.*key; });
}

}  // namespace

StructureIndex::StructureIndex(const Reconstruction& model) {
  uint32_t group_position = 0;
  for (const auto& [id, group] : model.groups3D) {
    for (uint32_t k = 0; k < group.point3D_ids.size(); ++k)
      points_.push_back({group.point3D_ids[k], group_position, k});
    for (uint32_t k = 0; k < group.line3D_ids.size(); ++k)
      lines_.push_back({group.line3D_ids[k], group_position, k});
    ++group_position;
  }
  for (uint32_t k = 0; k < model.wireframe.size(); ++k)
    edges_.push_back({model.wireframe[k].point3D_id, k});
  for (uint32_t k = 0; k < model.relations.size(); ++k)
    relations_.push_back({model.relations[k].group3D_id1, k});
  SortById(&Membership::feature_id, &points_);
  SortById(&Membership::feature_id, &lines_);
  SortById(&Place::id, &edges_);
  SortById(&Place::id, &relations_);
}

}  // namespace holba
