// SPDX-License-Identifier: BSD-3-Clause
// Body of the fuzzers: the bytes as one file of a model, in both formats, after the files that come
// before it in a small model. Nothing but InputError may come of it, and what is accepted must be
// written and read back the same.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <sstream>

#include "holba/base/error.h"
#include "holba/io/test_models.h"

namespace holba {

inline int FuzzReader(const char* name, const uint8_t* data, size_t size) {
  static const Reconstruction before = ReadFiles(SmallModelText(), ModelFormat::kText, name);
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  for (const NamedFile& file : AllFiles()) {
    if (std::string_view(file.name) != name) continue;
    for (const ModelFormat format : {ModelFormat::kText, ModelFormat::kBinary}) {
      Reconstruction model = before;
      try {
        file.read(format, bytes, "input", &model);
      } catch (const InputError&) {
        continue;
      }
      model.FindInconsistency();
      std::ostringstream once, twice;
      file.write(format, model, &once);
      Reconstruction again = before;
      file.read(format, once.str(), "written", &again);
      file.write(format, again, &twice);
      if (once.str() != twice.str()) {
        std::fprintf(stderr, "what was written is read differently\n");
        std::abort();
      }
    }
  }
  return 0;
}

}  // namespace holba

// The program that fuzzes the reader of one file.
#define HOLBA_FUZZ_READER(name)                                             \
  extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) { \
    return holba::FuzzReader(name, data, size);                             \
  }
