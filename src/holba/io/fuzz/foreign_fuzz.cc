// SPDX-License-Identifier: BSD-3-Clause
// Models of other programs: the first byte chooses the format, PLY points behind the last one.
#include <cstdlib>

#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/io/foreign/foreign_model.h"
#include "holba/io/foreign/ply_points.h"
#include "holba/scene/one_sided_links.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  holba::SetLogLevel(holba::LogLevel::kOff);
  const auto& formats = holba::AllForeignFormats();
  const size_t choice = data[0] % (formats.size() + 1);
  const std::string_view bytes(reinterpret_cast<const char*>(data + 1), size - 1);
  try {
    if (choice == formats.size()) {
      holba::ParsePlyPoints(bytes, "input");
      return 0;
    }
    holba::Reconstruction model = formats[choice].parse(bytes, "input");
    holba::DropOneSidedLinks(false, &model);
    model.FindInconsistency();
  } catch (const holba::InputError&) {
    return 0;
  }
  return 0;
}
