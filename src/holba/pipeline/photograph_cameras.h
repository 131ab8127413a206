// SPDX-License-Identifier: BSD-3-Clause
// Which camera took which photograph of a folder, and what is known about it: COLMAP's rules
// (ImageReader) on the photographs' headers.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/frontend/photographs/photograph_header.h"
#include "holba/io/database.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Names and defaults are COLMAP's.
struct ImageReaderOptions {
  std::string mask_path;         // folder; empty: none
  std::string camera_mask_path;  // one mask for all photographs; empty: none
  std::string camera_model = "SIMPLE_RADIAL";
  bool single_camera = false;
  bool single_camera_per_folder = false;
  bool single_camera_per_image = false;
  int existing_camera_id = -1;
  std::string camera_params;  // "f,cx,cy,k"; empty: from EXIF, else the factor
  double default_focal_length_factor = 1.2;

  void Describe(OptionTable* table) const;
  // Throws InputError for what is not there, or does not go together.
  void Check() const;
};

// A photograph with its camera.
struct PlannedImage {
  std::string name;  // relative to the folder, with '/'
  std::filesystem::path path;
  PhotographHeader header;
  std::optional<std::string> fault;  // why it cannot be used; the rest is empty then
  std::optional<image_t> image_id;   // it is in the database
  size_t camera_idx = 0;             // of CameraPlan::cameras
  PosePrior prior;                   // position and gravity that EXIF says
};

struct CameraPlan {
  std::vector<PlannedImage> images;  // in the order of their names
  struct PlannedCamera {
    DatabaseCamera camera;
    std::optional<camera_t> camera_id;  // it is in the database
  };
  std::vector<PlannedCamera> cameras;
};

// Names of all photographs below a folder (by their extensions) in COLMAP's order; or those of a
// list, a file with a name a line (empty: none). Throws InputError if there are none.
std::vector<std::string> PhotographNames(const std::filesystem::path& image_path,
                                         const std::string& image_list_path);

// Reads the headers. Images with the same camera: those of one EXIF text (CameraText), or of a
// folder, or all, as the options say; an image that the database has says which camera is its.
CameraPlan PlanCameras(const ImageReaderOptions& options, const std::filesystem::path& image_path,
                       const std::vector<std::string>& names, const Database& database,
                       int num_threads);

// COLMAP's parameters for a camera of which a focal length is known: the principal point in the
// middle, no distortion. `model`: any.
Camera DefaultCamera(const CameraModel& model, double focal_px, uint64_t width, uint64_t height);

}  // namespace holba
