// SPDX-License-Identifier: BSD-3-Clause
#include "holba/render/presets.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <functional>

#include "holba/base/error.h"

namespace holba {
namespace {

struct Preset {
  std::string name;
  std::function<Place(uint64_t seed)> build;
};

const std::vector<Preset>& Presets() {
  static const std::vector<Preset> presets = [] {
    std::vector<Preset> list;
    // Seeds of one number stay apart: the user's seed is added a thousand times.
    for (uint64_t i = 1; i <= 8; ++i) {
      list.push_back({fmt::format("room_{}", i),
                      [i](uint64_t seed) { return BuildRoom(1.0, 1000 * seed + i); }});
    }
    for (uint64_t i = 1; i <= 8; ++i) {
      list.push_back({fmt::format("facade_{}", i),
                      [i](uint64_t seed) { return BuildFacade(1000 * seed + 100 + i); }});
    }
    list.push_back({"hall", [](uint64_t seed) { return BuildHall(1000 * seed + 200); }});
    list.push_back({"corridor", [](uint64_t seed) { return BuildCorridor(1000 * seed + 300); }});
    list.push_back({"plain_room", [](uint64_t seed) { return BuildRoom(0.0, 1000 * seed + 1); }});
    list.push_back({"table", [](uint64_t seed) { return BuildTable(1000 * seed + 400); }});
    return list;
  }();
  return presets;
}

}  // namespace

std::vector<std::string> PresetNames() {
  std::vector<std::string> names;
  for (const Preset& preset : Presets()) names.push_back(preset.name);
  return names;
}

Place BuildPreset(std::string_view name, uint64_t seed) {
  for (const Preset& preset : Presets()) {
    if (preset.name == name) return preset.build(seed);
  }
  throw InputError(
      fmt::format("unknown preset '{}'; give one of {}", name, fmt::join(PresetNames(), ", ")));
}

}  // namespace holba
