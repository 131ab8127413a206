// SPDX-License-Identifier: BSD-3-Clause
// What the tests and fuzzers of this folder share: a small model as files, temporary folders,
// comparison of models bit for bit, the folder of real data.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "holba/base/random.h"
#include "holba/io/colmap_files.h"
#include "holba/io/files.h"
#include "holba/io/side_files.h"
#include "holba/scene/reconstruction.h"

namespace holba {

using FileReader = void (*)(ModelFormat, std::string_view, const std::filesystem::path&,
                            Reconstruction*);
using FileWriter = void (*)(ModelFormat, const Reconstruction&, std::ostream*);
struct NamedFile {
  const char* name;
  FileReader read;
  FileWriter write;
};
// In the order in which they are read.
inline const std::vector<NamedFile>& AllFiles() {
  static const std::vector<NamedFile> files = {
      {"cameras", ReadCameras, WriteCameras},       {"rigs", ReadRigs, WriteRigs},
      {"frames", ReadFrames, WriteFrames},          {"images", ReadImages, WriteImages},
      {"points3D", ReadPoints3D, WritePoints3D},    {"lines2D", ReadLines2D, WriteLines2D},
      {"lines3D", ReadLines3D, WriteLines3D},       {"groups2D", ReadGroups2D, WriteGroups2D},
      {"groups3D", ReadGroups3D, WriteGroups3D},    {"wireframe", ReadWireframe, WriteWireframe},
      {"relations", ReadRelations, WriteRelations},
  };
  return files;
}

using Files = std::map<std::string, std::string>;  // bytes by name without extension

// A rig of two cameras, three images (one name with a blank, one image without points), lines, a
// vanishing point and a plane.
inline const Files& SmallModelText() {
  static const Files files = {
      {"cameras",
       "# Camera list with one line of data per camera:\n"
       "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
       "# Number of cameras: 2\n"
       "1 PINHOLE 640 480 500 500 320 240\n"
       "2 SIMPLE_RADIAL 640 480 500 320 240 0.25\n"},
      {"rigs",
       "# Rig calib list with one line of data per calib:\n"
       "#   RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, SENSORS[] as (SENSOR_TYPE, "
       "SENSOR_ID, HAS_POSE, [QW, QX, QY, QZ, TX, TY, TZ])\n"
       "# Number of rigs: 1\n"
       "1 2 CAMERA 1 CAMERA 2 1 1 0 0 0 0.5 0 0\n"},
      {"frames",
       "# Frame list with one line of data per frame:\n"
       "#   FRAME_ID, RIG_ID, RIG_FROM_WORLD[QW, QX, QY, QZ, TX, TY, TZ], NUM_DATA_IDS, DATA_IDS[] "
       "as (SENSOR_TYPE, SENSOR_ID, DATA_ID)\n"
       "# Number of frames: 2\n"
       "1 1 1 0 0 0 0 0 5 2 CAMERA 1 1 CAMERA 2 2\n"
       "2 1 1 0 0 0 1 0 5 1 CAMERA 1 3\n"},
      {"images",
       "# Image list with two lines of data per image:\n"
       "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"
       "#   POINTS2D[] as (X, Y, POINT3D_ID)\n"
       "# Number of images: 3, mean observations per image: 1.3333333333333333\n"
       "1 1 0 0 0 0 0 5 1 left one.jpg\n"
       "10 20 1 30 40 2 50 60 -1\n"
       "2 1 0 0 0 0.5 0 5 2 right.jpg\n"
       "11 21 1 31 41 2\n"
       "3 1 0 0 0 1 0 5 1 c.jpg\n"
       "\n"},
      {"points3D",
       "# 3D point list with one line of data per point:\n"
       "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
       "# Number of points: 2, mean track length: 2\n"
       "1 0 0 0 10 20 30 0.5 1 0 2 0\n"
       "2 1 0 0 1 2 3 -1 1 1 2 1\n"},
      {"lines2D",
       "# IMAGE_ID NUM_LINES (X1 Y1 X2 Y2 LINE3D_ID)*\n"
       "1 2 0 0 10 0 1 5 5 6 6 -1\n"
       "2 1 0 0 10 1 1\n"},
      {"lines3D",
       "# LINE3D_ID DX DY DZ MX MY MZ X1 Y1 Z1 X2 Y2 Z2 R G B ERROR (IMAGE_ID LINE2D_IDX)*\n"
       "1 1 0 0 0 0 0 0 0 0 1 0 0 1 2 3 0.5 1 0 2 0\n"
       "2 0 1 0 -1 0 0 0 0 1 0 1 1 255 0 0 -1\n"},
      {"groups2D",
       "# IMAGE_ID GROUP2D_IDX TYPE GROUP3D_ID NUM_POINTS POINT2D_IDX* NUM_LINES LINE2D_IDX*\n"
       "1 0 VP 1 0 1 0\n"
       "1 1 PLANE 2 2 0 1 1 0\n"
       "2 0 PLANE -1 1 0 0\n"},
      {"groups3D",
       "# GROUP3D_ID TYPE NUM_PARAMS PARAM* NUM_POINTS POINT3D_ID* NUM_LINES LINE3D_ID* NUM_OBS "
       "(IMAGE_ID GROUP2D_IDX)*\n"
       "1 VP 3 1 0 0 0 1 1 1 1 0\n"
       "2 PLANE 4 0 0 1 0 2 1 2 1 1 1 1 1\n"},
      {"wireframe",
       "# POINT3D_ID LINE3D_ID NUM_IMAGES\n"
       "1 1 2\n"
       "2 2 1\n"},
      {"relations",
       "# GROUP3D_ID1 GROUP3D_ID2 TYPE\n"
       "1 2 ORTHOGONAL\n"},
  };
  return files;
}
inline constexpr const char* kSmallModelJson =
    "{\"format\": 1, \"frame\": {\"num_images\": 3, \"centroid\": [-0.5, 0, -5], "
    "\"spread\": 0.40824829046386302}}\n";

// The model that holds the files before `end` (all: null).
inline Reconstruction ReadFiles(const Files& files, ModelFormat format, const char* end = nullptr) {
  Reconstruction model;
  for (const NamedFile& file : AllFiles()) {
    if (end != nullptr && std::string_view(file.name) == end) break;
    const auto bytes = files.find(file.name);
    if (bytes == files.end()) continue;
    file.read(format, bytes->second, std::string(file.name) + Extension(format), &model);
  }
  return model;
}

inline Files WriteFiles(const Reconstruction& model, ModelFormat format) {
  Files files;
  for (const NamedFile& file : AllFiles()) {
    const std::string_view name = file.name;
    if (!model.has_rig_files && (name == "rigs" || name == "frames")) continue;
    std::ostringstream stream;
    file.write(format, model, &stream);
    files[file.name] = stream.str();
  }
  return files;
}

// All of a model, bit for bit: equal if and only if the models are the same.
inline std::string Fingerprint(const Reconstruction& model) {
  std::ostringstream stream;
  for (const NamedFile& file : AllFiles()) {
    stream << file.name << model.has_rig_files;
    file.write(ModelFormat::kBinary, model, &stream);
  }
  return stream.str();
}

class TestFolder {
 public:
  TestFolder() {
    static Random random(static_cast<uint64_t>(
        std::filesystem::file_time_type::clock::now().time_since_epoch().count()));
    path_ =
        std::filesystem::temp_directory_path() / ("holba_test_" + std::to_string(random.Bits()));
    std::filesystem::create_directories(path_);
  }
  ~TestFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

inline void WriteBytes(const std::filesystem::path& path, std::string_view bytes) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << bytes;
}

// Names of all files in a folder, sorted.
inline std::vector<std::string> ListFolder(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace holba
