// SPDX-License-Identifier: BSD-3-Clause
#include <cstdlib>

#include "holba/base/error.h"
#include "holba/io/holistic_json.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  try {
    const holba::ModelFrame frame = holba::ParseHolisticJson(bytes, "input");
    const holba::ModelFrame again = holba::ParseHolisticJson(holba::HolisticJson(frame), "written");
    if (again.num_images != frame.num_images || again.centroid != frame.centroid ||
        again.spread != frame.spread) {
      std::abort();
    }
  } catch (const holba::InputError&) {
  }
  return 0;
}
