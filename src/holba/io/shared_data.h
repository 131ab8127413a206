// SPDX-License-Identifier: BSD-3-Clause
// The folder of real data that tests may use: HOLBA_SHARED of the environment, else the one
// configured.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace holba {

// The folder may be missing.
inline std::filesystem::path SharedData() {
  const char* stated = std::getenv("HOLBA_SHARED");
#ifdef HOLBA_SHARED_DEFAULT
  if (stated == nullptr) stated = HOLBA_SHARED_DEFAULT;
#endif
  return std::filesystem::path(stated == nullptr ? "" : stated) / "data";
}

}  // namespace holba

#define HOLBA_SKIP_WITHOUT_SHARED_DATA()                                 \
  if (!std::filesystem::is_directory(::holba::SharedData())) {           \
    GTEST_SKIP() << "no real data at " << ::holba::SharedData()          \
                 << ": set HOLBA_SHARED to the folder that holds data/"; \
  }                                                                      \
  static_assert(true)
