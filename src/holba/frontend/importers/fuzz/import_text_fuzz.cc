// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdlib>

#include "holba/base/error.h"
#include "holba/frontend/importers/import_line_matches.h"
#include "holba/frontend/importers/import_segments.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  try {
    for (const auto& [name, raw] : holba::ParseSegmentText(bytes, "input", "image")) {
      for (const holba::LineSegment2d& segment : raw.segments) {
        if (!segment.start.allFinite() || !segment.end.allFinite()) std::abort();
      }
      if (!raw.scores.empty() && raw.scores.size() != raw.segments.size()) std::abort();
    }
  } catch (const holba::InputError&) {
  }
  try {
    holba::ParseLineMatchText(bytes, "input");
  } catch (const holba::InputError&) {
  }
  return 0;
}
