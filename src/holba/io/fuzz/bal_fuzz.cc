// SPDX-License-Identifier: BSD-3-Clause
#include <cstdlib>
#include <sstream>

#include "holba/base/error.h"
#include "holba/io/bal.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  holba::Reconstruction model;
  try {
    model = holba::ParseBal(bytes, "input");
  } catch (const holba::InputError&) {
    return 0;
  }
  if (model.FindInconsistency()) std::abort();
  std::ostringstream stream;
  holba::FormatBal(model, &stream);
  // What we write we read; rotations may differ in the last bits.
  const holba::Reconstruction again = holba::ParseBal(stream.str(), "written");
  if (again.images.size() != model.images.size()) std::abort();
  return 0;
}
