// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/files.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "holba/base/error.h"

namespace holba {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;

class Files : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / ("holba_files_" + std::to_string(getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  void Make(const fs::path& name, const std::string& text = "old") const {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
  }
  std::string Read(const fs::path& name) const { return ReadFileBytes(folder_ / name); }
  std::vector<std::string> List(const fs::path& name = "") const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_ / name))
      names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
  }
  // Our files are a, b and all that is in ours/ or truth/; a version of a and ours/x is written.
  void WriteVersion(const std::string& text) const {
    StagedFolder stage(folder_ / "out");
    for (const char* name : {"a", "ours/x", "truth/t"})
      stage.Write(name, [&](std::ostream* stream) { *stream << text; });
    stage.Commit([](std::string_view name) {
      return name == "a" || name == "b" || name == "ours" || name == "truth/t" || name == "truth/u";
    });
  }
  void ExpectVersion(const std::string& text) const {
    EXPECT_EQ(Read("out/a"), text);
    EXPECT_THAT(List("out/ours"), ElementsAre("x"));
    EXPECT_EQ(Read("out/ours/x"), text);
    EXPECT_EQ(Read("out/truth/t"), text);
  }

  fs::path folder_;
};

TEST_F(Files, WhatIsOwnedIsReplacedAndAllElseIsKept) {
  for (const char* name :
       {"a", "b", "ours/x", "ours/y", "mine/deep/m", "truth/t", "truth/u", "truth/mine", "note"}) {
    Make(fs::path("out") / name);
  }
  fs::create_symlink("mine/deep", folder_ / "out/link");
  fs::permissions(folder_ / "out/mine", fs::perms::owner_all);
  const auto time = fs::last_write_time(folder_ / "out/mine");
  WriteVersion("new");
  ExpectVersion("new");
  EXPECT_THAT(List("out"), ElementsAre("a", "link", "mine", "note", "ours", "truth"));
  EXPECT_THAT(List("out/truth"), ElementsAre("mine", "t"));
  EXPECT_EQ(Read("out/link/m"), "old");
  EXPECT_EQ(fs::status(folder_ / "out/mine").permissions(), fs::perms::owner_all);
  EXPECT_EQ(fs::last_write_time(folder_ / "out/mine"), time);
  EXPECT_THAT(List(), ElementsAre("out"));
}

TEST_F(Files, AFolderThatShouldNotBeMovedIsWrittenInPlace) {
  for (const char* name : {"a", "b", "ours/y", "truth/u", "truth/mine"})
    Make(fs::path("out") / name);
  ASSERT_EQ(mkfifo((folder_ / "out/pipe").c_str(), 0600), 0);
  const auto inode = [&] {
    struct stat status {};
    stat((folder_ / "out").c_str(), &status);
    return status.st_ino;
  };
  const auto before = inode();
  WriteVersion("new");
  EXPECT_EQ(inode(), before);
  ExpectVersion("new");
  EXPECT_THAT(List("out"), ElementsAre("a", "ours", "pipe", "truth"));
  EXPECT_THAT(List("out/truth"), ElementsAre("mine", "t"));
  EXPECT_THAT(List(), ElementsAre("out"));
  // A file is where a folder of ours goes.
  fs::remove_all(folder_ / "out/ours");
  Make("out/ours");
  WriteVersion("newer");
  EXPECT_EQ(inode(), before);
  ExpectVersion("newer");
}

TEST_F(Files, WhatAKilledProgramLeftIsRemovedButNotWhatALivingOneWorksOn) {
  WriteVersion("old");
  // Killed while it wrote; while it removed on a signal; after the folders changed places, before
  // all that is not ours was back.
  Make(".out.holba-00000001/a", "half");
  Make(".out.holba-00000002.removed/a", "half");
  Make(".out.holba-00000003/b");
  Make(".out.holba-00000003/late", "not of holba");
  Make("out/.model.holba-00000004/a", "half");
  // Other names, and one whose program lives.
  Make(".out.holba-notes");
  Make(".outer.holba-00000005/a");
  Make(".out.holba-00000006/a", "half");
  const int living = open((folder_ / ".out.holba-00000006").c_str(), O_RDONLY);
  ASSERT_EQ(flock(living, LOCK_EX), 0);
  WriteVersion("new");
  close(living);
  ExpectVersion("new");
  EXPECT_EQ(Read("out/late"), "not of holba");
  EXPECT_THAT(List("out"), ElementsAre("a", "late", "ours", "truth"));
  EXPECT_THAT(List(), ElementsAre(".out.holba-00000006", ".out.holba-notes",
                                  ".outer.holba-00000005", "out"));

  Make(".file.holba-00000001", "half");
  WriteFileWhole(folder_ / "file", [](std::ostream* stream) { *stream << "new"; });
  EXPECT_EQ(Read("file"), "new");
  EXPECT_FALSE(fs::exists(folder_ / ".file.holba-00000001"));
}

TEST_F(Files, ANameAsLongAsTheSystemAllowsCanBeWritten) {
  const std::string name(255, 'n');
  WriteFileWhole(folder_ / name, [](std::ostream* stream) { *stream << "text"; });
  EXPECT_EQ(Read(name), "text");
  StagedFolder stage(folder_ / (name.substr(1) + 'f'));
  stage.Commit([](std::string_view) { return false; });
  EXPECT_THAT(List(), ElementsAre(name.substr(1) + 'f', name));
}

TEST_F(Files, AProbeLeavesNothingAndFindsWhatCannotBeWritten) {
  const auto no_files = [](std::string_view) { return false; };
  Make("file");
  ProbeFolder(folder_ / "new" / "deep", no_files);
  ProbeFolder(folder_, no_files);
  ProbeFile(folder_ / "new" / "deep" / "file");
  ProbeFile(folder_ / "file");
  ProbeFile("/dev/null");
  EXPECT_THAT(List(), ElementsAre("file"));
  EXPECT_EQ(Read("file"), "old");
  // Not even root makes folders in the first.
  for (const fs::path& path :
       {fs::path("/proc/no/such"), folder_ / "file" / "x", folder_ / std::string(256, 'n')}) {
    EXPECT_THROW(ProbeFolder(path, no_files), InputError) << path;
    EXPECT_THROW(ProbeFile(path), InputError) << path;
  }
  EXPECT_THROW(ProbeFile(folder_), InputError);
  EXPECT_THROW(ProbeFile(folder_ / "new/"), InputError);
  EXPECT_THROW(ProbeFolder(folder_ / "file", no_files), InputError);
  Make("taken/points3D.bin/x");
  EXPECT_THROW(
      ProbeFolder(folder_ / "taken", [](std::string_view name) { return name == "points3D.bin"; }),
      InputError);
  ProbeFolder(folder_ / "taken", no_files);
}

}  // namespace
}  // namespace holba
