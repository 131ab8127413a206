// SPDX-License-Identifier: BSD-3-Clause
// Why images are in no model, said so that a user sees what to change.
#pragma once

#include <map>
#include <string>

#include "holba/sfm/mapper_options.h"
#include "holba/sfm/mapper_state.h"

namespace holba {

// Of each image without a pose: a phrase that goes on behind its name and a colon. Of a state
// without any pose: why no model was begun with it.
std::map<image_t, std::string> WhyLeftOut(const MapperOptions& options, const MapperState& state);

}  // namespace holba
