// SPDX-License-Identifier: BSD-3-Clause
// Which groups a feature is a member of, which incidences a point has and which relations a group
// has: what the model stores from the other end only. Made once in a pass over the structure of a
// model, it lets a part be selected at the cost of the part (BundleSelection::Around). Valid until
// groups, members, incidences or relations of the model change.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "holba/scene/reconstruction.h"

namespace holba {

class StructureIndex {
 public:
  struct Membership {
    uint64_t feature_id;
    uint32_t group_position;   // in Reconstruction::groups3D
    uint32_t member_position;  // in the group's list of this kind of feature
  };

  explicit StructureIndex(const Reconstruction& model);

  // Calls visit(const Membership&) for each group of a point or line.
  template <typename Visitor>
  void ForEachGroupOfPoint(point3D_t id, const Visitor& visit) const {
    ForEach(points_, id, &Membership::feature_id, visit);
  }
  template <typename Visitor>
  void ForEachGroupOfLine(line3D_t id, const Visitor& visit) const {
    ForEach(lines_, id, &Membership::feature_id, visit);
  }
  // Calls visit(position in Reconstruction::wireframe) for each incidence of a point.
  template <typename Visitor>
  void ForEachEdgeOfPoint(point3D_t id, const Visitor& visit) const {
    ForEach(edges_, id, &Place::id, [&](const Place& place) { visit(place.position); });
  }
  // Calls visit(position in Reconstruction::relations) for each relation whose first group this is.
  template <typename Visitor>
  void ForEachRelationFrom(group3D_t id, const Visitor& visit) const {
    ForEach(relations_, id, &Place::id, [&](const Place& place) { visit(place.position); });
  }

 private:
  struct Place {
    uint64_t id;
    uint32_t position;
  };

  template <typename Entry, typename Visitor>
  static void ForEach(const std::vector<Entry>& entries, uint64_t id, uint64_t Entry::* key,
                      const Visitor& visit) {
    auto it = std::lower_bound(entries.begin(), entries.end(), id,
                               [&](const Entry& e, uint64_t wanted) { return e.*key < wanted; });
    for (; it != entries.end() && (*it).*key == id; ++it) visit(*it);
  }

  // Sorted by id, of one id in the order of the model.
  std::vector<Membership> points_, lines_;
  std::vector<Place> edges_, relations_;
};

}  // namespace holba
