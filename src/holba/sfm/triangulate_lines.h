// SPDX-License-Identifier: BSD-3-Clause
// Lines of a growing model: made, continued, merged and filtered along the graph of matches of
// segments (paper, appendix "Incremental Mapping").
#pragma once

#include <cstddef>
#include <span>

#include "holba/estimation/lines/line_options.h"
#include "holba/sfm/mapper_state.h"

namespace holba {

struct LineChanges {
  size_t created = 0;    // lines
  size_t continued = 0;  // observations that joined a line
  size_t merged = 0;     // lines that went into others

  LineChanges& operator+=(const LineChanges& other);
};

// Segments of a registered image join the lines of their matches, or make new ones with them.
LineChanges TriangulateLines(const LineOptions& options, image_t image_id, MapperState* state);

// Lines of which matches of segments say that they are one, and one line fits the segments of both.
LineChanges MergeLines(const LineOptions& options, std::span<const line3D_t> line_ids,
                       MapperState* state);

// Observations that no longer fit, lines that fewer than two images show or whose place is
// uncertain; sets the extents of the others anew. Returns the number of observations removed.
size_t FilterLines(const LineOptions& options, std::span<const line3D_t> line_ids,
                   MapperState* state);

}  // namespace holba
