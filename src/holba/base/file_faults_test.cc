// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/file_faults.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <fstream>

namespace holba {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;
namespace fs = std::filesystem;

std::string MessageOfReading(const fs::path& path) {
  try {
    ReadFileBytes(path);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(FileFaults, SayThePathTheReasonAndTheRemedy) {
  EXPECT_STREQ(NoSuchFile("a/b.txt").what(), "a/b.txt: there is no such file; check the path");
  EXPECT_STREQ(NoSuchFolder("images", "--image_path").what(),
               "images: there is no such folder; check --image_path");
  errno = ENOSPC;
  EXPECT_STREQ(CannotBeWritten("out/cameras.bin", SystemFault()).what(),
               "out/cameras.bin: cannot be written (No space left on device); give another place, "
               "or check the permissions of the folder and the space on its disk");
}

TEST(FileFaults, AFileIsReadWholeOrRefusedByItsName) {
  const fs::path folder = fs::path(testing::TempDir()) / "file_faults_test";
  fs::create_directories(folder);
  const std::string bytes("\0binary\r\n\xff", 10);
  std::ofstream(folder / "file", std::ios::binary) << bytes;
  EXPECT_EQ(ReadFileBytes(folder / "file"), bytes);
  EXPECT_THAT(MessageOfReading(folder / "none"),
              StartsWith((folder / "none").string() + ": there is no such file"));
  EXPECT_THAT(MessageOfReading(folder), HasSubstr("expected a file, found a folder"));
  fs::remove_all(folder);
}

TEST(FileFaults, TextInUtf16IsRefusedAndUtf8IsNot) {
  EXPECT_NO_THROW(RefuseUtf16("\xEF\xBB\xBFtext", "a.txt"));
  EXPECT_NO_THROW(RefuseUtf16("", "a.txt"));
  EXPECT_THROW(RefuseUtf16("\xFF\xFEt", "a.txt"), InputError);
  EXPECT_THROW(RefuseUtf16("\xFE\xFFt", "a.txt"), InputError);
}

}  // namespace
}  // namespace holba
