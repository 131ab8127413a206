// SPDX-License-Identifier: BSD-3-Clause
// Where the records of a map lie. Arrays can show them if they lie one behind the other in the
// order of the map: as they do in models that were read or copied, until some are removed.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "holba/scene/id_map.h"

namespace holba::python {

// Bytes from record to record; empty: they do not lie at equal distances.
template <typename Map>
std::optional<int64_t> StrideOf(Map& map) {
  if (map.size() < 2) return sizeof(typename Map::Entry);
  const auto address = [&](size_t i) {
    return reinterpret_cast<const char*>(&map.begin()[static_cast<int64_t>(i)]);
  };
  const int64_t stride = address(1) - address(0);
  for (size_t i = 2; i < map.size(); ++i) {
    if (address(i) - address(i - 1) != stride) return std::nullopt;
  }
  return stride;
}

// Puts the records of a map one behind the other. What refers to them, and the ids that were given
// and are gone, are lost: for models that were just read.
template <typename Id, typename T>
void LineUp(IdMap<Id, T>* map) {
  if (StrideOf(*map)) return;
  constexpr size_t kMaxReserved = size_t{1} << 20;  // IdMap::Reserve's bound
  if (map->size() > kMaxReserved) {
    *map = IdMap<Id, T>(*map);
    return;
  }
  IdMap<Id, T> lined_up;
  lined_up.Reserve(map->size());
  for (auto& [id, record] : *map) lined_up.Add(id, std::move(record));
  *map = std::move(lined_up);
}

}  // namespace holba::python
