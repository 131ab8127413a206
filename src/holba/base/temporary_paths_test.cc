// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/temporary_paths.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>

namespace holba {
namespace {

namespace fs = std::filesystem;

fs::path TestFolder(const std::string& name) {
  const fs::path folder =
      fs::temp_directory_path() / ("holba_" + name + "_" + std::to_string(getpid()));
  fs::remove_all(folder);
  fs::create_directories(folder);
  return folder;
}

void Touch(const fs::path& path) { std::ofstream(path) << "x"; }

TEST(TemporaryPath, ItsEndRemovesTheFolderWithWhatIsInIt) {
  const fs::path folder = TestFolder("end");
  {
    const TemporaryPath temporary(folder / "temporary");
    fs::create_directories(temporary.path() / "inner");
    Touch(temporary.path() / "inner" / "file");
  }
  EXPECT_TRUE(fs::is_empty(folder));
  fs::remove_all(folder);
}

TEST(TemporaryPath, WhatWasRenamedIntoPlaceStays) {
  const fs::path folder = TestFolder("rename");
  {
    const TemporaryPath temporary(folder / "temporary");
    Touch(temporary.path());
    fs::rename(temporary.path(), folder / "output");
  }
  EXPECT_TRUE(fs::exists(folder / "output"));
  EXPECT_FALSE(fs::exists(folder / "temporary"));
  fs::remove_all(folder);
}

TEST(TemporaryPath, WhatIsToBeKeptStays) {
  const fs::path folder = TestFolder("keep");
  {
    TemporaryPath temporary(folder / "temporary");
    Touch(temporary.path());
    temporary.Keep();
  }
  EXPECT_TRUE(fs::exists(folder / "temporary"));
  fs::remove_all(folder);
}

TEST(HoldSignals, ASignalWaitsForWhatIsBeingPutInPlace) {
  const fs::path folder = TestFolder("hold");
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    RemoveTemporaryPathsOnSignal();
    const TemporaryPath temporary(folder / "temporary");
    {
      const HoldSignals hold;
      raise(SIGTERM);
      // Long enough for the signal to take effect if it were not held.
      usleep(50000);
      Touch(folder / "output");
    }
    for (;;) pause();
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(WTERMSIG(status), SIGTERM);
  EXPECT_TRUE(fs::exists(folder / "output"));
  fs::remove_all(folder);
}

TEST(TemporaryPath, AnInterruptRemovesTheFolderAndEndsTheProcessByTheSignal) {
  for (const int signal : {SIGINT, SIGTERM}) {
    const fs::path folder = TestFolder("signal");
    Touch(folder / "output");
    int ready[2];
    ASSERT_EQ(pipe(ready), 0);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      std::signal(signal, SIG_DFL);  // a background job of a shell inherits SIGINT as ignored
      RemoveTemporaryPathsOnSignal();
      const TemporaryPath temporary(folder / "temporary");
      fs::create_directories(temporary.path());
      Touch(temporary.path() / "file");
      if (write(ready[1], "r", 1) != 1) _exit(3);
      for (;;) pause();
    }
    char byte = 0;
    ASSERT_EQ(read(ready[0], &byte, 1), 1);
    ASSERT_TRUE(fs::exists(folder / "temporary"));
    ASSERT_EQ(kill(child, signal), 0);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFSIGNALED(status));
    EXPECT_EQ(WTERMSIG(status), signal);
    EXPECT_FALSE(fs::exists(folder / "temporary"));
    EXPECT_TRUE(fs::exists(folder / "output"));
    close(ready[0]);
    close(ready[1]);
    fs::remove_all(folder);
  }
}

}  // namespace
}  // namespace holba
