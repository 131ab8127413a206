// SPDX-License-Identifier: BSD-3-Clause
// The places by name. A name is a recipe with a seed of its own; another seed gives another place
// of the kind.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "holba/render/place.h"

namespace holba {

std::vector<std::string> PresetNames();
// Throws InputError that lists the names.
Place BuildPreset(std::string_view name, uint64_t seed);

// The recipes. richness: of texture, 1 to 0 (none).
Place BuildRoom(double richness, uint64_t seed);
Place BuildFacade(uint64_t seed);
Place BuildHall(uint64_t seed);
Place BuildCorridor(uint64_t seed);
Place BuildTable(uint64_t seed);

}  // namespace holba
