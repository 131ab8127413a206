// SPDX-License-Identifier: BSD-3-Clause
// Photographs made smaller for people to look at.
#pragma once

#include "holba/frontend/photographs/photograph.h"

namespace holba {

// With a longer side of at most `longer_side_px` (at least 1), each pixel the mean of what it
// covers. A smaller photograph stays as it is.
ColourImage Shrunk(const ColourImage& image, int longer_side_px);

}  // namespace holba
