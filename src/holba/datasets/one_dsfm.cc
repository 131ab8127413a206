// SPDX-License-Identifier: BSD-3-Clause
// 1DSfM: list.txt ("images/NAME.jpg", or with " 0 FOCAL" behind it), gt_bundle.out in Bundler's
// form (cameras in the order of list.txt, the focal length 0 of those without a pose), and the
// photographs of the second download in images/. Source: https://www.cs.cornell.edu/projects/1dsfm/
// and Bundler's manual, https://www.cs.cornell.edu/~snavely/bundler/bundler-v0.4-manual.html.
//
// Bundler's camera looks along -z with y up, and its pixels count from the middle of the image with
// y up: x_cam = diag(1, -1, -1) (R X + t). Its distortion 1 + k1 r^2 + k2 r^4 is that of RADIAL.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "holba/base/error.h"
#include "holba/datasets/dataset.h"
#include "holba/datasets/dataset_files.h"
#include "holba/frontend/photographs/photograph_header.h"

namespace holba {
namespace fs = std::filesystem;

namespace {

// Where neither the model nor list.txt knows a focal length: COLMAP's guess, in parts of the longer
// side.
constexpr double kFocalOfLongerSide = 1.2;

struct BundlerCamera {
  double focal_px = 0.0, k1 = 0.0, k2 = 0.0;
  Rigid3d cam_from_world;
};

struct Numbers {
  std::vector<TextRow> rows;
  fs::path path;
  size_t row = 0, column = 0;

  double Next(std::string_view what) {
    while (row < rows.size() && column >= rows[row].words.size()) {
      ++row;
      column = 0;
    }
    if (row < rows.size()) return NumberIn(rows[row], column++, what, path);
    throw InputError(path, fmt::format("expected {} after the last line, found nothing", what));
  }
};

std::vector<BundlerCamera> ReadBundler(const fs::path& path) {
  NeededFile(path, "the reference reconstruction");
  Numbers numbers{ReadRows(path), path};
  const double count = numbers.Next("the number of cameras");
  numbers.Next("the number of points");
  if (!(count >= 0.0 && count < 1e7 && count == std::floor(count)))
    throw InputError(path, fmt::format("expected a number of cameras, found {}", count));
  std::vector<BundlerCamera> cameras;
  for (size_t i = 0; i < static_cast<size_t>(count); ++i) {
    BundlerCamera camera;
    camera.focal_px = numbers.Next("a focal length");
    camera.k1 = numbers.Next("k1");
    camera.k2 = numbers.Next("k2");
    Eigen::Matrix3d R;
    for (int k = 0; k < 9; ++k) R(k / 3, k % 3) = numbers.Next("an element of a rotation");
    Eigen::Vector3d t;
    for (int k = 0; k < 3; ++k) t[k] = numbers.Next("a translation");
    if (camera.focal_px > 0.0) {
      if (!((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-2)) {
        throw InputError(path,
                         fmt::format("the matrix of camera {} must be a rotation", cameras.size()));
      }
      const Eigen::Vector3d flip(1.0, -1.0, -1.0);
      const Eigen::Matrix3d turned = flip.asDiagonal() * R;
      camera.cam_from_world = {Eigen::Quaterniond(turned).normalized(), flip.cwiseProduct(t)};
    }
    cameras.push_back(camera);
  }
  return cameras;
}

}  // namespace

Dataset ReadOneDSfM(const fs::path& folder, const DatasetOptions& options) {
  Dataset dataset;
  dataset.scene = NameOfFolder(folder);
  dataset.unit = "unknown";
  dataset.pose_source = "Bundler (a reference, not a measured truth)";
  dataset.notes = {"The unit of the poses is arbitrary.",
                   "Most of the photographs have no pose: they are no part of the reference."};
  const fs::path list = NeededFile(folder / "list.txt", "the names of photographs");
  const std::vector<TextRow> rows = ReadRows(list);
  const fs::path bundle = folder / "gt_bundle.out";
  const std::vector<BundlerCamera> cameras = ReadBundler(bundle);
  if (cameras.size() != rows.size()) {
    throw InputError(bundle, fmt::format("expected the {} cameras of list.txt, found {}",
                                         rows.size(), cameras.size()));
  }
  TruthBuilder builder(&dataset);
  for (size_t i = 0; i < rows.size(); i += static_cast<size_t>(options.stride)) {
    const std::string name = fs::path(rows[i].words[0]).filename().string();
    const fs::path beside = folder / rows[i].words[0];
    const fs::path source =
        NeededFile(fs::is_regular_file(beside) ? beside : folder / "images" / name,
                   "a photograph that list.txt has");
    const PhotographHeader header = ReadPhotographHeader(source);
    const double w = static_cast<double>(header.width), h = static_cast<double>(header.height);
    const BundlerCamera& camera = cameras[i];
    const bool has_pose = camera.focal_px > 0.0;
    double focal_px = camera.focal_px;
    if (!has_pose && rows[i].words.size() > 2)
      focal_px = NumberIn(rows[i], 2, "a focal length", list);
    if (!(focal_px > 0.0)) focal_px = kFocalOfLongerSide * std::max(w, h);
    const camera_t camera_id = builder.AddCamera(MakeCamera(
        "RADIAL", header.width, header.height,
        {focal_px, 0.5 * w, 0.5 * h, has_pose ? camera.k1 : 0.0, has_pose ? camera.k2 : 0.0}));
    builder.AddImage(name, source, camera_id,
                     has_pose ? std::optional<Rigid3d>(camera.cam_from_world) : std::nullopt);
  }
  builder.Finish(bundle);
  return dataset;
}

}  // namespace holba
