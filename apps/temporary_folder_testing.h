// SPDX-License-Identifier: BSD-3-Clause
// A folder for the files of one test.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

namespace holba {

class TemporaryFolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  // By the names of suite and test: tests of several programs may run at a time.
  const std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) /
      (std::string("holba_") +
       ::testing::UnitTest::GetInstance()->current_test_info()->test_suite_name() + "_" +
       ::testing::UnitTest::GetInstance()->current_test_info()->name());
};

}  // namespace holba
