// SPDX-License-Identifier: BSD-3-Clause
// ScanNet++: dslr/colmap with the fisheye photographs of dslr/resized_images, the same undistorted
// (dslr/resized_undistorted_images, camera in dslr/nerfstudio/transforms_undistorted.json), or
// iphone/colmap with iphone/rgb; the laser scan as mesh and cloud in scans/. COLMAP's models are in
// the scan's frame, metres. Source: https://kaldir.vc.in.tum.de/scannetpp/documentation.
#include <nlohmann/json.hpp>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/datasets/dataset.h"
#include "holba/datasets/dataset_files.h"
#include "holba/io/model_io.h"

namespace holba {
namespace fs = std::filesystem;

namespace {

struct Part {
  fs::path model, images;
  fs::path transforms;  // of undistorted photographs; empty: the model's own cameras
};

Part PartOf(const fs::path& folder, const std::string& name) {
  const fs::path dslr = folder / "dslr", iphone = folder / "iphone";
  if (name == "dslr") return {dslr / "colmap", dslr / "resized_images", {}};
  if (name == "dslr_undistorted") {
    return {dslr / "colmap", dslr / "resized_undistorted_images",
            dslr / "nerfstudio" / "transforms_undistorted.json"};
  }
  if (name == "iphone") return {iphone / "colmap", iphone / "rgb", {}};
  throw InputError("--part: expected dslr, dslr_undistorted or iphone for ScanNet++, found '" +
                   name + "'");
}

// The pinhole camera of undistorted photographs.
Camera UndistortedCamera(const fs::path& path) {
  const std::string bytes = ReadFileBytes(NeededFile(path, "the camera of undistorted images"));
  try {
    const nlohmann::json json = nlohmann::json::parse(bytes);
    return MakeCamera("PINHOLE", json.at("w").get<uint64_t>(), json.at("h").get<uint64_t>(),
                      {json.at("fl_x").get<double>(), json.at("fl_y").get<double>(),
                       json.at("cx").get<double>(), json.at("cy").get<double>()});
  } catch (const nlohmann::json::exception& error) {
    throw InputError(path, std::string("expected JSON with w, h, fl_x, fl_y, cx and cy, found "
                                       "another one (") +
                               error.what() + ")");
  }
}

}  // namespace

Dataset ReadScanNetPp(const fs::path& folder, const DatasetOptions& options) {
  Dataset dataset;
  dataset.scene = NameOfFolder(folder);
  dataset.part = options.part.empty() ? "dslr" : options.part;
  dataset.pose_source = "COLMAP, aligned with the laser scan by the authors";
  const Part part = PartOf(folder, dataset.part);
  dataset.truth = CamerasOf(ReadPoses(NeededFolder(part.model, "the poses of the photographs")),
                            options.stride);
  if (dataset.truth.images.empty())
    throw InputError(part.model, "expected at least one posed image, found none");
  if (!part.transforms.empty()) {
    const Camera camera = UndistortedCamera(part.transforms);
    for (auto& [id, old] : dataset.truth.cameras) old = camera;
  }
  for (auto& [id, image] : dataset.truth.images) {
    dataset.images.push_back(
        {image.name, NeededFile(part.images / image.name, "a photograph that the model has")});
  }
  dataset.truth.AddTrivialRigsAndFrames();
  const fs::path mesh = folder / "scans" / "mesh_aligned_0.05.ply";
  const fs::path cloud = folder / "scans" / "pc_aligned.ply";
  if (fs::is_regular_file(mesh)) {
    dataset.surfaces.push_back({"mesh.ply", mesh});
    dataset.mesh_name = "mesh.ply";
  }
  if (fs::is_regular_file(cloud)) {
    dataset.surfaces.push_back({"cloud.ply", cloud});
    dataset.point_cloud_name = "cloud.ply";
  }
  if (dataset.mesh_name.empty() && dataset.point_cloud_name.empty()) {
    dataset.notes.push_back(
        "There is neither scans/mesh_aligned_0.05.ply nor scans/pc_aligned.ply in the folder: "
        "nothing to evaluate geometry against.");
  }
  return dataset;
}

}  // namespace holba
