// SPDX-License-Identifier: BSD-3-Clause
#include <cstdlib>

#include "holba/base/error.h"
#include "holba/frontend/importers/npz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  const auto check = [](const holba::NumericArray& array) {
    if (array.bytes.size() != array.size() * holba::BytesOf(array.type)) std::abort();
    array.Values<float>();
    array.Values<int64_t>();
  };
  try {
    check(holba::ParseNpy(bytes, "input"));
  } catch (const holba::InputError&) {
  }
  try {
    const holba::NpzArchive archive(bytes, "input");
    for (const std::string& name : archive.Names()) {
      try {
        check(archive.Read(name));
      } catch (const holba::InputError&) {
      }
    }
  } catch (const holba::InputError&) {
  }
  return 0;
}
