// SPDX-License-Identifier: BSD-3-Clause
// Data sets as their authors publish them, read into what experiments need: photographs, true
// cameras, true surfaces. To add one: NAME.cc with a function Read...(folder, options) and one line
// in list.inc; docs/datasets.md says what it reads.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "holba/base/options.h"
#include "holba/io/ply_reader.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct DatasetOptions {
  // Of sets with several: "dslr", "rig", "cam_00", "seq-01". Empty: the adapter's choice.
  std::string part;
  int stride = 1;  // every stride-th image, or instant of a rig, is taken

  void Describe(OptionTable* table) const;
};

// A file of the set as it was downloaded, and its name in ours.
struct DatasetFile {
  std::string name;  // with '/'
  std::filesystem::path source;
};

struct Dataset {
  std::string scene;  // its name
  std::string part;   // that was read
  // Cameras, and images with their true poses; those without one are unregistered. Pixels are
  // COLMAP's (the centre of the first pixel is at 0.5, 0.5).
  Reconstruction truth;
  std::vector<DatasetFile> images;    // by the names that they have in `truth`
  std::vector<DatasetFile> surfaces;  // meshes, clouds and what belongs to them, as they are
  std::optional<FileGeometry> mesh;   // of a set whose mesh has another form; written as mesh.ply
  // Which of these is the truth for evaluate_geometry, by its name in our set; empty: none.
  std::string mesh_name, point_cloud_name;
  std::string unit = "metres";
  std::string pose_source;         // "laser scans", "motion capture", ...
  std::vector<std::string> notes;  // what one has to know, in sentences
};

struct DatasetFormat {
  std::string_view name;     // as its authors write it: "ScanNet++"
  std::string_view key;      // for the command line: "scannetpp"
  std::string_view summary;  // what a folder of it holds
  Dataset (*read)(const std::filesystem::path& folder, const DatasetOptions& options);
};

// In the order of list.inc.
std::vector<DatasetFormat> AllDatasetFormats();
// By name or key, whatever the case and what is between letters ("tum_rgbd", "TUM RGB-D").
std::optional<DatasetFormat> FindDatasetFormat(std::string_view name);

}  // namespace holba
