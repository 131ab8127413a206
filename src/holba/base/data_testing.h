// SPDX-License-Identifier: BSD-3-Clause
// The folder of real image sets and adjustment problems that tests use where it is there: HOLBA_DATA_DIR of the
// environment, else the one configured (holba_test_data in cmake/HolbaBuild.cmake).
#pragma once

#include <cstdlib>
#include <filesystem>

namespace holba {

// The folder may be missing.
inline std::filesystem::path DataFolder() {
  const char* stated = std::getenv("HOLBA_DATA_DIR");
  return stated ? stated : HOLBA_CONFIGURED_DATA_DIR;
}

}  // namespace holba

#define HOLBA_SKIP_WITHOUT_DATA()                                        \
  if (!std::filesystem::is_directory(::holba::DataFolder())) {           \
    GTEST_SKIP() << "SKIPPED, NOT TESTED: no real data at "              \
                 << ::holba::DataFolder() << " (set HOLBA_DATA_DIR)";    \
  }                                                                      \
  static_assert(true)
