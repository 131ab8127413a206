// SPDX-License-Identifier: BSD-3-Clause
// Hypersim: a scene ai_VVV_NNN with _detail/cam_XX/camera_keyframe_{positions,orientations}.hdf5
// (asset units; camera to world, x right, y up, z backwards), images/scene_cam_XX_final_preview,
// and _detail/metadata_scene.csv with metres per asset unit; the mesh, where it was bought and
// exported, in _detail/mesh. Source: https://github.com/apple/ml-hypersim.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "holba/base/error.h"
#include "holba/datasets/dataset.h"
#include "holba/datasets/dataset_files.h"
#include "holba/frontend/importers/hdf5_file.h"

namespace holba {
namespace fs = std::filesystem;

namespace {

// Of all images, by the authors.
constexpr double kHorizontalFieldOfViewRad = std::numbers::pi / 3.0;

// The array "dataset" of a file, of rows of `row_size` numbers.
std::vector<double> ReadArray(const fs::path& path, size_t row_size) {
  NeededFile(path, "an array of the scene");
  const auto arrays = ReadHdf5(path, [](std::string_view name) { return name == "dataset"; });
  const auto found = arrays.find("dataset");
  if (found == arrays.end()) throw InputError(path, "expected the array 'dataset', found none");
  if (found->second.size() % row_size != 0) {
    throw InputError(path, fmt::format("expected rows of {} numbers, found an array of {}",
                                       row_size, found->second.ShapeText()));
  }
  return found->second.Values<double>();
}

double MetresPerUnit(const fs::path& path) {
  for (const TextRow& row : ReadRows(NeededFile(path, "the scale of the scene"))) {
    if (row.words[0] != "meters_per_asset_unit") continue;
    const double metres = NumberIn(row, 1, "metres per asset unit", path);
    if (metres > 0.0) return metres;
  }
  throw InputError(path, "expected a positive meters_per_asset_unit, found none");
}

// Some scenes have a shifted or tilted image plane: a table of the authors' repository has the
// projection of each. Empty: the table is not there.
fs::path FindCameraTable(const fs::path& folder) {
  const fs::path whole = fs::weakly_canonical(folder);
  for (const fs::path& place : {whole, whole.parent_path(), whole.parent_path().parent_path()}) {
    const fs::path path = place / "metadata_camera_parameters.csv";
    if (fs::is_regular_file(path)) return path;
  }
  return {};
}

// Of the scene's projection matrix (OpenGL's), in pixels of the photograph.
Camera CameraOfTable(const fs::path& table, const std::string& scene, uint64_t width,
                     uint64_t height) {
  const std::vector<TextRow> rows = ReadRows(table);
  std::map<std::string, size_t> column;
  for (size_t i = 0; !rows.empty() && i < rows[0].words.size(); ++i) column[rows[0].words[i]] = i;
  const auto row = std::find_if(rows.begin(), rows.end(), [&](const TextRow& candidate) {
    return candidate.words[0] == scene;
  });
  if (row == rows.end()) throw InputError(table, "expected a row of " + scene + ", found none");
  const auto element = [&](int i, int j) {
    const std::string name = fmt::format("M_proj_{}{}", i, j);
    const auto at = column.find(name);
    if (at == column.end()) throw InputError(table, "expected a column " + name + ", found none");
    return NumberIn(*row, at->second, name, table);
  };
  for (const auto& [i, j] : {std::pair{0, 1}, {1, 0}, {3, 0}, {3, 1}}) {
    if (std::abs(element(i, j)) > 1e-6) {
      throw InputError(table, "the image plane of " + scene +
                                  " is tilted, which no camera model has; use another scene");
    }
  }
  const double w = 0.5 * static_cast<double>(width), h = 0.5 * static_cast<double>(height);
  return MakeCamera(
      "PINHOLE", width, height,
      {w * element(0, 0), h * element(1, 1), w * (1.0 - element(0, 2)), h * (1.0 + element(1, 2))});
}

Camera CameraOf(const fs::path& folder, const fs::path& photograph, Dataset* dataset) {
  Camera camera = CameraOfPhotograph("PINHOLE", photograph, {1.0, 1.0, 0.0, 0.0});
  if (const fs::path table = FindCameraTable(folder); !table.empty())
    return CameraOfTable(table, dataset->scene, camera.width, camera.height);
  const double w = 0.5 * static_cast<double>(camera.width);
  const double focal_px = w / std::tan(0.5 * kHorizontalFieldOfViewRad);
  camera.params = {focal_px, focal_px, w, 0.5 * static_cast<double>(camera.height)};
  dataset->notes.push_back(
      "metadata_camera_parameters.csv of the authors' repository was not found beside the scene: a "
      "field of view of 60 degrees is taken, which is not right for scenes with a shifted image "
      "plane.");
  return camera;
}

// "frame.0012.tonemap.jpg" -> 12. Empty: another name.
std::optional<size_t> FrameNumber(const std::string& name) {
  if (!name.starts_with("frame.") || name.size() < 11) return std::nullopt;
  const std::string digits = name.substr(6, 4);
  if (!std::all_of(digits.begin(), digits.end(), [](char c) { return c >= '0' && c <= '9'; }))
    return std::nullopt;
  return std::stoul(digits);
}

struct Trajectory {
  std::vector<double> position, orientation;  // 3 and 9 for each key frame
  std::map<size_t, size_t> row_of_frame;      // empty: the frame's own number
};

Trajectory ReadCameraTrajectory(const fs::path& folder) {
  Trajectory trajectory;
  trajectory.position = ReadArray(folder / "camera_keyframe_positions.hdf5", 3);
  trajectory.orientation = ReadArray(folder / "camera_keyframe_orientations.hdf5", 9);
  if (trajectory.position.size() / 3 != trajectory.orientation.size() / 9) {
    throw InputError(folder,
                     "expected as many camera_keyframe_positions as camera_keyframe_orientations, "
                     "found different numbers");
  }
  const fs::path indices = folder / "camera_keyframe_frame_indices.hdf5";
  if (fs::is_regular_file(indices)) {
    const std::vector<double> frames = ReadArray(indices, 1);
    for (size_t i = 0; i < frames.size(); ++i) {
      trajectory.row_of_frame[static_cast<size_t>(frames[i])] = i;
    }
  }
  return trajectory;
}

// Empty: the trajectory has no such frame.
std::optional<Rigid3d> CamFromWorld(const Trajectory& trajectory, size_t frame,
                                    double metres_per_unit) {
  size_t row = frame;
  if (!trajectory.row_of_frame.empty()) {
    const auto found = trajectory.row_of_frame.find(frame);
    if (found == trajectory.row_of_frame.end()) return std::nullopt;
    row = found->second;
  }
  if (3 * row + 3 > trajectory.position.size()) return std::nullopt;
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(
      trajectory.orientation.data() + 9 * row);
  const Eigen::Vector3d centre(trajectory.position.data() + 3 * row);
  // Their camera looks along -z with y up.
  const Eigen::Matrix3d world_from_cam = R * Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  return Rigid3d(Eigen::Quaterniond(world_from_cam).normalized(), metres_per_unit * centre)
      .Inverse();
}

void AddMesh(const fs::path& folder, double metres_per_unit, Dataset* dataset) {
  const fs::path vertices_path = folder / "mesh_vertices.hdf5";
  const fs::path faces_path = folder / "mesh_faces_vi.hdf5";
  if (!fs::is_regular_file(vertices_path) || !fs::is_regular_file(faces_path)) {
    dataset->notes.push_back(
        "The mesh is not part of the download: with _detail/mesh/mesh_vertices.hdf5 and "
        "mesh_faces_vi.hdf5 (or a mesh in asset units and --metres_per_unit) geometry can be "
        "evaluated.");
    return;
  }
  const std::vector<double> xyz = ReadArray(vertices_path, 3), corners = ReadArray(faces_path, 3);
  FileGeometry mesh;
  for (size_t i = 0; i < xyz.size(); i += 3) {
    mesh.vertices.push_back(metres_per_unit * Eigen::Vector3d(xyz.data() + i));
  }
  for (size_t i = 0; i < corners.size(); i += 3) {
    std::array<uint32_t, 3> triangle;
    for (int k = 0; k < 3; ++k) {
      if (!(corners[i + k] >= 0.0 && corners[i + k] < static_cast<double>(mesh.vertices.size()))) {
        throw InputError(faces_path, fmt::format("expected indices of {} vertices, found {}",
                                                 mesh.vertices.size(), corners[i + k]));
      }
      triangle[k] = static_cast<uint32_t>(corners[i + k]);
    }
    mesh.triangles.push_back(triangle);
  }
  dataset->mesh = std::move(mesh);
  dataset->mesh_name = "mesh.ply";
}

}  // namespace

Dataset ReadHypersim(const fs::path& folder, const DatasetOptions& options) {
  const fs::path detail = NeededFolder(folder / "_detail", "cameras of a scene");
  Dataset dataset;
  dataset.scene = NameOfFolder(folder);
  dataset.pose_source = "exact (rendered)";
  const std::vector<std::string> cameras = FoldersIn(detail, "cam_");
  if (cameras.empty()) throw InputError(detail, "expected folders cam_00, .., found none");
  dataset.part = options.part.empty() ? cameras.front() : options.part;
  const double metres_per_unit = MetresPerUnit(detail / "metadata_scene.csv");
  const Trajectory trajectory =
      ReadCameraTrajectory(NeededFolder(detail / dataset.part, "the trajectory of a camera"));
  const fs::path images = folder / "images" / ("scene_" + dataset.part + "_final_preview");

  // Tone mapped ones, if there are any, else the plain ones.
  std::vector<std::string> names;
  for (const char* ending : {".tonemap.jpg", ".color.jpg"}) {
    for (const std::string& name : PhotographsIn(images)) {
      if (name.ends_with(ending) && FrameNumber(name)) names.push_back(name);
    }
    if (!names.empty()) break;
  }
  if (names.empty()) {
    throw InputError(images,
                     "expected photographs frame.0000.tonemap.jpg or frame.0000.color.jpg, found "
                     "others");
  }
  TruthBuilder builder(&dataset);
  camera_t camera_id = 0;
  for (size_t i = 0; i < names.size(); i += static_cast<size_t>(options.stride)) {
    if (camera_id == 0)
      camera_id = builder.AddCamera(CameraOf(folder, images / names[i], &dataset));
    builder.AddImage(names[i], images / names[i], camera_id,
                     CamFromWorld(trajectory, *FrameNumber(names[i]), metres_per_unit));
  }
  builder.Finish(detail / dataset.part / "camera_keyframe_positions.hdf5");
  AddMesh(detail / "mesh", metres_per_unit, &dataset);
  return dataset;
}

}  // namespace holba
