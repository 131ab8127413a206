// SPDX-License-Identifier: BSD-3-Clause
// Segments of one edge of a test house, for tests of fits.
#pragma once

#include <vector>

#include "holba/estimation/lines/line_fit.h"
#include "holba/estimation/lines/line_testing.h"

namespace holba {

inline std::vector<LineSupport> SupportsOfEdge(const TestHouse& house, int edge) {
  std::vector<LineSupport> supports;
  for (const auto& [id, features] : house.features) {
    const IdealView view(house.model, id);
    for (size_t s = 0; s < features.segments.size(); ++s) {
      if (house.edge_of_segment.at(id)[s] == edge)
        supports.emplace_back(view, *view.ToIdeal(features.segments[s]), id);
    }
  }
  return supports;
}

}  // namespace holba
