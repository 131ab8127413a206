// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/hdf5_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>

#include "holba/base/random.h"
#include "holba/frontend/importers/import_golden_files.h"
#include "holba/frontend/importers/import_testing.h"

namespace holba {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

bool Everything(std::string_view) { return true; }

std::vector<std::string> NamesOf(const std::map<std::string, NumericArray>& arrays) {
  std::vector<std::string> names;
  for (const auto& [name, array] : arrays) names.push_back(name);
  return names;
}

TEST(Hdf5, ReadsWhatH5pyWrote) {
  const TestFolder folder;
  const auto path = folder.Write("x.h5", FromBase64(kHdf5Features));
  const auto arrays = ReadHdf5(path, Everything);
  EXPECT_THAT(NamesOf(arrays),
              ElementsAre("b.jpg/keypoints", "c.jpg/keypoints", "dir/a.jpg/descriptors",
                          "dir/a.jpg/image_size", "dir/a.jpg/lines"));
  const NumericArray& lines = arrays.at("dir/a.jpg/lines");
  EXPECT_THAT(lines.shape, ElementsAre(2, 2, 2));
  EXPECT_THAT(lines.Values<double>(), ElementsAre(1, 2, 3, 4, 10.5, 20.25, 30, 40));
  EXPECT_THAT(arrays.at("dir/a.jpg/image_size").Values<int64_t>(), ElementsAre(100, 80));
  EXPECT_EQ(arrays.at("b.jpg/keypoints").ShapeText(), "(10, 4) float64");
}

TEST(Hdf5, OnlyWhatIsWantedIsRead) {
  const TestFolder folder;
  const auto path = folder.Write("x.h5", FromBase64(kHdf5Matches));
  const auto arrays =
      ReadHdf5(path, [](std::string_view name) { return name.ends_with("/line_matches0"); });
  EXPECT_THAT(NamesOf(arrays), ElementsAre("dir-a.jpg/b.jpg/line_matches0"));
  EXPECT_THAT(arrays.begin()->second.Values<int64_t>(), ElementsAre(7, -1));
}

TEST(Hdf5, LinksOutOfTheFileAreNotFollowedAndLoopsEnd) {
  const TestFolder folder;
  const auto path = folder.Write("x.h5", FromBase64(kHdf5Links));
  const auto arrays = ReadHdf5(path, Everything);
  ASSERT_EQ(arrays.size(), 1u);
  EXPECT_THAT(arrays.begin()->second.Values<int64_t>(), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
}

TEST(Hdf5, BadFilesAreRefusedWithTheReason) {
  const TestFolder folder;
  const auto message = [&](const std::string& bytes) {
    const auto path = folder.Write("x.h5", bytes);
    return MessageOf([&] { ReadHdf5(path, Everything); });
  };
  EXPECT_THAT(message("PK"), HasSubstr("x.h5: this is no HDF5 file; write it again with h5py"));
  EXPECT_THAT(message(FromBase64(kHdf5Text)), HasSubstr("'t/lines' does not hold numbers"));
  const std::string good = FromBase64(kHdf5Features);
  EXPECT_THAT(message(good.substr(0, good.size() - 100)), HasSubstr("damaged or incomplete"));
  EXPECT_THAT(MessageOf([&] { ReadHdf5(folder.path() / "none.h5", Everything); }),
              HasSubstr("no such file"));
}

TEST(Hdf5, ACrashOfTheLibraryIsAnInputError) {
  const TestFolder folder;
  const auto path = folder.Write("x.h5", FromBase64(kHdf5Features));
  const auto crash = [](std::string_view) {  // called from within the library
    std::raise(SIGSEGV);
    return true;
  };
  EXPECT_THAT(MessageOf([&] { ReadHdf5(path, crash); }),
              HasSubstr("the HDF5 library crashed reading this file: it is damaged; write it "
                        "again with h5py"));
  const auto die = [](std::string_view) {
    std::raise(SIGKILL);
    return true;
  };
  EXPECT_THAT(MessageOf([&] { ReadHdf5(path, die); }), HasSubstr("ran out of time or memory"));
}

// Whatever is wrong, the program that reads it lives on.
TEST(Hdf5, DamagedFilesNeverEndTheReader) {
  const TestFolder folder;
  Random random(1);
  size_t num_refused = 0, num_read = 0;
  for (const char* golden : {kHdf5Features, kHdf5Matches}) {
    const std::string good = FromBase64(golden);
    for (int i = 0; i < 150; ++i) {
      std::string bytes = good;
      for (int k = 0; k <= i % 3; ++k) {
        bytes[8 + random.Index(bytes.size() - 8)] = static_cast<char>(random.Index(256));
      }
      const auto path = folder.Write("x.h5", bytes);
      try {
        for (const auto& [name, array] : ReadHdf5(path, Everything)) {
          EXPECT_EQ(array.bytes.size(), array.size() * BytesOf(array.type));
        }
        ++num_read;
      } catch (const InputError&) {
        ++num_refused;
      }
    }
  }
  EXPECT_GT(num_refused, 50u);
  EXPECT_GT(num_read, 50u);
}

}  // namespace
}  // namespace holba
