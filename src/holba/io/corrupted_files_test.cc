// SPDX-License-Identifier: BSD-3-Clause
// Every way in which a file may be broken ends in an InputError that names the place and what was
// expected.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "holba/io/test_models.h"

namespace holba {
namespace {

using testing::HasSubstr;

// The message of reading all files; empty if nothing is wrong with them.
std::string MessageOf(const Files& files, ModelFormat format) {
  try {
    const Reconstruction model = ReadFiles(files, format);
    return model.FindInconsistency().value_or("");
  } catch (const InputError& error) {
    return error.what();
  }
}

struct TextCase {
  const char* file;
  const char* from;  // its first occurrence after the comments is replaced
  const char* to;
  const char* place;    // "" if it is found only after all files are read
  const char* message;  // part of it
};

TEST(CorruptedText, IsRefusedWithLineAndExpectation) {
  const std::vector<TextCase> cases = {
      {"cameras", "1 PINHOLE", "x PINHOLE",
       "cameras.txt:4: ", "expected CAMERA_ID (an id), found 'x'"},
      {"cameras", "1 PINHOLE", "4294967296 PINHOLE", "cameras.txt:4: ", "found '4294967296'"},
      {"cameras", "PINHOLE", "PINHOL", "cameras.txt:4: ", "expected MODEL (one of SIMPLE_PINHOLE,"},
      {"cameras", "640", "-640",
       "cameras.txt:4: ", "expected WIDTH (a whole number), found '-640'"},
      {"cameras", "500 500 320 240", "500 500 320",
       "cameras.txt:4: ", "expected PARAMS (a finite number), found the end of the line"},
      {"cameras", "500 500 320 240", "500 500 320 240 1",
       "cameras.txt:4: ", "expected the end of the line, found '1'"},
      {"cameras", "500 500", "nan 500",
       "cameras.txt:4: ", "expected PARAMS (a finite number), found 'nan'"},
      {"cameras", "500 500", "inf 500", "cameras.txt:4: ", "found 'inf'"},
      {"cameras", "500 500", "1e999 500", "cameras.txt:4: ", "found '1e999'"},
      {"cameras", "500 500", "5,5 500", "cameras.txt:4: ", "found '5,5'"},
      {"cameras", "500 500", "0 500", "cameras.txt:4: ", "camera 1 has a focal length of 0"},
      {"cameras", "2 SIMPLE", "1 SIMPLE", "cameras.txt:5: ", "camera 1 is there twice"},
      {"rigs", "CAMERA 1", "LIDAR 1",
       "rigs.txt:4: ", "expected SENSOR_TYPE (CAMERA or IMU), found 'LIDAR'"},
      {"rigs", "CAMERA 2", "CAMERA 3",
       "rigs.txt:4: ", "rig 1 names camera 3, which is not in the model"},
      {"rigs", "CAMERA 2", "CAMERA 1", "rigs.txt:4: ", "camera 1 of rig 1 is there twice"},
      {"rigs", "2 1 1 0", "2 2 1 0", "rigs.txt:4: ", "expected HAS_POSE (0 or 1), found 2"},
      {"rigs", "1 2 CAMERA", "1 3 CAMERA", "rigs.txt:4: ", "expected SENSOR_TYPE"},
      {"rigs", "1 2 CAMERA", "1 1000000 CAMERA", "rigs.txt:4: ", "more than the line can hold"},
      {"rigs", "2 1 1 0", "2 0 1 0", "rigs.txt:4: ", "expected the end of the line"},
      {"frames", "1 1 1 0", "1 7 1 0",
       "frames.txt:4: ", "frame 1 names rig 7, which is not in the model"},
      {"frames", "1 1 1 0", "1 1 0 0",
       "frames.txt:4: ", "frame 1 has a rotation quaternion of norm 0, expected 1"},
      {"frames", "1 CAMERA 1 3", "1 CAMERA 1 1",
       "frames.txt:5: ", "image 1 is in frame 1 and again in frame 2"},
      {"frames", "1 CAMERA 1 3", "1 IMU 1 3",
       "frames.txt:5: ", "data of IMU 1, which is not in its rig 1"},
      {"frames", "2 1 1", "1 1 1", "frames.txt:5: ", "frame 1 is there twice"},
      {"images", "1 1 0 0 0 0 0 5 1 left", "1 0 0 0 0 0 0 5 1 left",
       "images.txt:5: ", "image 1 has a rotation quaternion of norm 0, expected 1"},
      {"images", "5 1 left one.jpg", "5 9 left one.jpg",
       "images.txt:5: ", "image 1 names camera 9, which is not in the model"},
      {"images", "5 1 left one.jpg", "5 2 left one.jpg",
       "images.txt:5: ", "image 1 is of camera 2, but its frame 1 says camera 1"},
      {"images", "5 1 left one.jpg", "5 1", "images.txt:5: ", "expected NAME"},
      {"images", "3 1 0 0 0 1", "4 1 0 0 0 1", "images.txt:9: ", "image 4 is in no frame"},
      {"images", "3 1 0 0 0 1", "2 1 0 0 0 1",
       "images.txt:9: ", "image 2 is of camera 1, but its frame"},
      {"images", "30 40 2", "30 40", "images.txt:6: ", "expected POINT3D_ID"},
      {"images", "30 40 2", "30 40 -2",
       "images.txt:6: ", "expected POINT3D_ID (an id, or -1 for none), found '-2'"},
      {"images", "60 -1", "60", "images.txt:6: ", "found the end of the line"},
      {"images", "30 40 2 50 60 -1", "30 40 2 50 60 99", "",
       "names 3D point 99, which is not in the model"},
      {"points3D", "2 1 0 0", "1 1 0 0", "points3D.txt:5: ", "3D point 1 is there twice"},
      {"points3D", "10 20 30", "10 20 256",
       "points3D.txt:4: ", "expected B (0 to 255), found '256'"},
      {"points3D", "1 0 2 0", "1 0 9 0", "", "3D point 1 names image 9, which is not in the model"},
      {"points3D", "1 0 2 0", "1 0 2 2", "",
       "3D point 1 names point 2 of image 2, which has 2 of them"},
      {"points3D", "1 0 2 0", "1 0 1 2", "", "which names no 3D point"},
      {"points3D", "1 0 2 0", "1 0 2", "points3D.txt:4: ", "expected POINT2D_IDX"},
      {"points3D", "1 0 2 0", "1 0", "",
       "point 0 of image 2 names 3D point 1, which does not name it back"},
      {"points3D", "1 0 2 0", "1 0 2 0 2 0", "", "3D point 1 names point 0 of image 2 twice"},
      {"lines2D", "1 2 0", "9 2 0",
       "lines2D.txt:2: ", "expected IMAGE_ID of an image of the model, found 9"},
      {"lines2D", "1 2 0", "1 3 0", "lines2D.txt:2: ", "expected X1"},
      {"lines2D", "1 2 0", "1 1152921504606846976 0",
       "lines2D.txt:2: ", "more than the line can hold"},
      {"lines2D", "2 1 0", "1 1 0",
       "lines2D.txt:3: ", "the list of lines of image 1 is there twice"},
      {"lines2D", "6 6 -1", "6 6 5", "",
       "line 1 of image 1 names 3D line 5, which is not in the model"},
      {"lines3D", "1 1 0 0 0", "1 2 0 0 0",
       "lines3D.txt:2: ", "3D line 1 has a direction of length 2, expected 1"},
      {"lines3D", "2 0 1 0 -1 0 0", "2 0 1 0 -1 0.5 0",
       "lines3D.txt:3: ", "3D line 2 has a moment that is not perpendicular to its direction"},
      {"lines3D", "0.5 1 0 2 0", "0.5 1 0 2 1", "",
       "3D line 1 names line 1 of image 2, which has 1 of them"},
      {"lines3D", "0.5 1 0 2 0", "0.5 1 0 1 1", "", "which names no 3D line"},
      {"lines3D", "2 0 1 0 -1", "1 0 1 0 -1", "lines3D.txt:3: ", "3D line 1 is there twice"},
      {"groups2D", "VP", "PYRAMID", "groups2D.txt:2: ", "expected TYPE (one of VP, PLANE"},
      {"groups2D", "1 1 PLANE", "1 2 PLANE",
       "groups2D.txt:3: ", "expected GROUP2D_IDX 1 of image 1"},
      {"groups2D", "1 1 PLANE", "1 0 PLANE",
       "groups2D.txt:3: ", "expected GROUP2D_IDX 1 of image 1"},
      {"groups2D", "1 0 VP 1 0 1 0", "1 0 VP 1 0 0",
       "groups2D.txt:2: ", "group 0 of image 1 is a VP without members"},
      {"groups2D", "1 0 VP 1 0 1 0", "1 0 VP 1 1 0 0",
       "groups2D.txt:2: ", "is a VP, which takes no points"},
      {"groups2D", "1 0 VP 1 0 1 0", "1 0 VP 1 0 1 2",
       "groups2D.txt:2: ", "expected LINE2D_IDX below 2"},
      {"groups2D", "1 0 VP 1 0 1 0", "1 0 VP 8 0 1 0", "", "which names 3D group 8"},
      {"groups3D", "1 VP 3 1 0 0", "1 VP 4 1 0 0",
       "groups3D.txt:2: ", "expected NUM_PARAMS 3 of a VP"},
      {"groups3D", "1 VP 3 1 0 0", "1 VP 3 2 0 0",
       "groups3D.txt:2: ", "group 1 has parameters that are no VP"},
      {"groups3D", "1 VP 3 1 0 0", "1 PLANE 4 1 0 0 0",
       "groups3D.txt:2: ", "group 1 is a PLANE, but its observation, group 0 of image 1, is a VP"},
      {"groups3D", "0 1 1 1 1 0", "0 1 9 1 1 0",
       "groups3D.txt:2: ", "expected LINE3D_ID of the model, found 9"},
      {"groups3D", "0 1 1 1 1 0", "0 1 1 0", "",
       "group 0 of image 1 names 3D group 1, which does not name it back"},
      {"groups3D", "2 1 2 1 1 1 1 1", "2 1 7 1 1 1 1 1",
       "groups3D.txt:3: ", "expected POINT3D_ID of the model, found 7"},
      {"groups3D", "2 1 2 1 1 1 1 1", "2 1 1 1 1 1 1 1",
       "groups3D.txt:3: ", "has point 1 twice among its members"},
      {"wireframe", "1 1 2", "7 1 2",
       "wireframe.txt:2: ", "expected POINT3D_ID of the model, found 7"},
      {"wireframe", "1 1 2", "1 7 2",
       "wireframe.txt:2: ", "expected LINE3D_ID of the model, found 7"},
      {"wireframe", "1 1 2", "1 1 -2",
       "wireframe.txt:2: ", "expected NUM_IMAGES (a whole number), found '-2'"},
      {"wireframe", "2 2 1", "1 1 1", "", "the wireframe has point 1 on line 1 twice"},
      {"relations", "1 2 O", "1 3 O",
       "relations.txt:2: ", "expected GROUP3D_ID2 of the model, found 3"},
      {"relations", "ORTHOGONAL", "ORTHOGNAL",
       "relations.txt:2: ", "expected TYPE (ORTHOGONAL or PARALLEL), found 'ORTHOGNAL'"},
      {"relations", "1 2 O", "1 1 O", "", "a relation is between group 1 and itself"},
  };
  for (const TextCase& c : cases) {
    Files files = SmallModelText();
    std::string& text = files.at(c.file);
    const size_t records = text.find("\n", text.rfind("\n#") + 1) + 1;
    const size_t at = text.find(c.from, text.starts_with("#") ? records : 0);
    ASSERT_NE(at, std::string::npos) << c.file << ": " << c.from;
    text.replace(at, std::strlen(c.from), c.to);
    const std::string message = MessageOf(files, ModelFormat::kText);
    EXPECT_THAT(message, testing::StartsWith(c.place))
        << c.file << ": " << c.from << " -> " << c.to;
    EXPECT_THAT(message, HasSubstr(c.message)) << c.file << ": " << c.from << " -> " << c.to;
  }
}

TEST(CorruptedText, ASensorOfUnknownPoseIsNamed) {
  Files files = SmallModelText();
  files["rigs"] = "1 2 CAMERA 1 CAMERA 2 0\n";
  EXPECT_THAT(MessageOf(files, ModelFormat::kText),
              HasSubstr("images.txt:7: image 2 is of camera 2, whose pose in rig 1 is unknown; "));
}

struct BinaryCase {
  const char* file;
  size_t offset;      // of a field
  std::string bytes;  // that replace it
  const char* place;
  const char* message;
};

template <typename T>
std::string Raw(T value) {
  return {reinterpret_cast<const char*>(&value), sizeof(T)};
}

TEST(CorruptedBinary, IsRefusedWithByteAndExpectation) {
  const Files good =
      WriteFiles(ReadFiles(SmallModelText(), ModelFormat::kText), ModelFormat::kBinary);
  ASSERT_EQ(MessageOf(good, ModelFormat::kBinary), "");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<BinaryCase> cases = {
      {"cameras", 0, Raw(uint64_t{1} << 60), "cameras.bin: at byte 0: ",
       "expected the number of cameras (at most 4, as 112 bytes follow), found "
       "1152921504606846976"},
      {"cameras", 0, Raw(uint64_t{1}), "cameras.bin: at byte 64: ",
       "expected the end of the file after its last record, found 56 more bytes"},
      {"cameras", 0, Raw(uint64_t{3}),
       "cameras.bin: at byte 120: ", "found the end of the file: it is truncated"},
      {"cameras", 8, Raw(kInvalidId32),
       "cameras.bin: at byte 8: ", "expected CAMERA_ID (an id), found none"},
      {"cameras", 12, Raw(int32_t{-1}), "cameras.bin: at byte 12: ", "expected MODEL_ID"},
      {"cameras", 32, Raw(nan),
       "cameras.bin: at byte 32: ", "expected PARAMS (a finite number), found nan"},
      {"cameras", 32, Raw(0.0), "cameras.bin: at byte 8: ", "camera 1 has a focal length of 0"},
      {"rigs", 12, Raw(uint32_t{0xffffffff}),
       "rigs.bin: at byte 12: ", "expected NUM_SENSORS (at most"},
      {"rigs", 16, Raw(int32_t{2}),
       "rigs.bin: at byte 16: ", "expected SENSOR_TYPE (0 CAMERA or 1 IMU), found 2"},
      {"rigs", 32, Raw(uint8_t{2}),
       "rigs.bin: at byte 32: ", "expected HAS_POSE (0 or 1), found 2"},
      {"frames", 72, Raw(uint32_t{1} << 30),
       "frames.bin: at byte 72: ", "expected NUM_DATA_IDS (at most"},
      {"images", 0, Raw(uint64_t{1} << 61),
       "images.bin: at byte 0: ", "expected the number of images"},
      {"images", 85, Raw(uint64_t{1} << 60),
       "images.bin: at byte 85: ", "expected NUM_POINTS2D (at most"},
      {"points3D", 51, Raw(uint64_t{1} << 60),
       "points3D.bin: at byte 51: ", "expected TRACK_LENGTH (at most"},
      {"points3D", 59, Raw(uint32_t{9}), "", "3D point 1 names image 9"},
      {"lines2D", 12, Raw(uint64_t{1} << 59),
       "lines2D.bin: at byte 12: ", "expected NUM_LINES (at most"},
      {"lines3D", 123, Raw(uint64_t{1} << 60),
       "lines3D.bin: at byte 123: ", "expected TRACK_LENGTH (at most"},
      {"groups2D", 16, Raw(uint8_t{200}), "groups2D.bin: at byte 16: ", "found code 200"},
      {"groups3D", 17, Raw(uint64_t{1} << 60),
       "groups3D.bin: at byte 17: ", "expected NUM_PARAMS (at most"},
      {"groups3D", 17, Raw(uint64_t{4}),
       "groups3D.bin: at byte 17: ", "expected NUM_PARAMS 3 of a VP"},
      {"wireframe", 0, Raw(uint64_t{3}),
       "wireframe.bin: at byte 0: ", "expected the number of edges (at most 2"},
      {"relations", 24, Raw(uint8_t{2}),
       "relations.bin: at byte 24: ", "expected TYPE (0 ORTHOGONAL or 1 PARALLEL), found 2"},
  };
  for (const BinaryCase& c : cases) {
    Files files = good;
    files.at(c.file).replace(c.offset, c.bytes.size(), c.bytes);
    const std::string message = MessageOf(files, ModelFormat::kBinary);
    EXPECT_THAT(message, testing::StartsWith(c.place)) << c.file << " at " << c.offset;
    EXPECT_THAT(message, HasSubstr(c.message)) << c.file << " at " << c.offset;
  }
}

TEST(CorruptedBinary, EveryTruncationAndEveryTrailingByteIsRefused) {
  const Files good =
      WriteFiles(ReadFiles(SmallModelText(), ModelFormat::kText), ModelFormat::kBinary);
  size_t num_cases = 0;
  for (const NamedFile& file : AllFiles()) {
    const std::string& bytes = good.at(file.name);
    const Reconstruction before = ReadFiles(good, ModelFormat::kBinary, file.name);
    for (size_t size = 0; size < bytes.size(); ++size) {
      Reconstruction model = before;
      EXPECT_THROW(file.read(ModelFormat::kBinary, bytes.substr(0, size), "cut", &model),
                   InputError)
          << file.name << " cut after " << size;
      ++num_cases;
    }
    Reconstruction model = before;
    EXPECT_THROW(file.read(ModelFormat::kBinary, bytes + '\0', "long", &model), InputError);
  }
  EXPECT_GT(num_cases, 1000u);
}

// Never a crash or a hang, whatever single byte is wrong.
TEST(CorruptedBinary, EveryByteMayBeAnything) {
  for (const ModelFormat format : {ModelFormat::kBinary, ModelFormat::kText}) {
    const Files good = WriteFiles(ReadFiles(SmallModelText(), ModelFormat::kText), format);
    size_t num_refused = 0;
    for (const NamedFile& file : AllFiles()) {
      const Reconstruction before = ReadFiles(good, format, file.name);
      for (size_t at = 0; at < good.at(file.name).size(); ++at) {
        for (const char value : {'\0', '\1', '\x7f', '\xff', '-', '\n', '9'}) {
          std::string bytes = good.at(file.name);
          bytes[at] = value;
          Reconstruction model = before;
          try {
            file.read(format, bytes, "changed", &model);
          } catch (const InputError&) {
            ++num_refused;
          }
          model.FindInconsistency();
        }
      }
    }
    EXPECT_GT(num_refused, 1000u);
  }
}

}  // namespace
}  // namespace holba
