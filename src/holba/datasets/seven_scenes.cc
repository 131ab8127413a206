// SPDX-License-Identifier: BSD-3-Clause
// 7Scenes: seq-NN/frame-NNNNNN.color.png with frame-NNNNNN.pose.txt (4 x 4, camera to world,
// metres), TrainSplit.txt and TestSplit.txt with lines "sequence1". Source:
// https://www.microsoft.com/en-us/research/project/rgb-d-dataset-7-scenes/.
#include <fmt/format.h>

#include <algorithm>

#include "holba/base/error.h"
#include "holba/datasets/dataset.h"
#include "holba/datasets/dataset_files.h"

namespace holba {
namespace fs = std::filesystem;

namespace {

// The colour camera was not calibrated. 525 px is the Kinect's nominal focal length, as used for
// these photographs by the work on localisation.
constexpr double kFocalPx = 525.0;
constexpr std::string_view kColour = ".color.png";

// "sequence1" -> "seq-01".
std::vector<std::string> ReadSplit(const fs::path& path) {
  std::vector<std::string> sequences;
  for (const TextRow& row : ReadRows(NeededFile(path, "the sequences of a split"))) {
    const std::string& word = row.words[0];
    const size_t digits = word.find_first_of("0123456789");
    if (!word.starts_with("sequence") || digits != 8) {
      throw InputError::AtLine(path, row.line,
                               "expected a line 'sequence1', found '" + word.substr(0, 40) + "'");
    }
    sequences.push_back(fmt::format("seq-{:0>2}", word.substr(digits)));
  }
  return sequences;
}

// Sequences to read, as folders with the prefix that their images' names get.
std::vector<std::string> SequencesOf(const fs::path& folder, const std::string& part) {
  if (part == "train") return ReadSplit(folder / "TrainSplit.txt");
  if (part == "test") return ReadSplit(folder / "TestSplit.txt");
  if (!part.empty()) {
    NeededFolder(folder / part, "the frames of a sequence");
    return {part};
  }
  const std::vector<std::string> sequences = FoldersIn(folder, "seq-");
  return sequences.empty() ? std::vector<std::string>{""} : sequences;
}

Rigid3d ReadPose(const fs::path& path) {
  std::vector<double> rows;
  for (const TextRow& row : ReadRows(NeededFile(path, "the pose of a frame"))) {
    for (size_t i = 0; i < row.words.size(); ++i) {
      rows.push_back(NumberIn(row, i, "an element of a 4 x 4 matrix", path));
    }
  }
  const std::optional<Rigid3d> world_from_cam = RigidFromRows(rows);
  if (!world_from_cam)
    throw InputError(path, "expected 16 numbers, a rotation and a translation, found others");
  return world_from_cam->Inverse();
}

}  // namespace

Dataset ReadSevenScenes(const fs::path& folder, const DatasetOptions& options) {
  Dataset dataset;
  dataset.scene = NameOfFolder(folder);
  dataset.part = options.part.empty() ? "all" : options.part;
  dataset.pose_source = "KinectFusion";
  dataset.notes = {
      "The poses are those of a depth camera's tracking, of some centimetres and tenths of "
      "degrees: "
      "no truth for AUC below 5 degrees.",
      "The colour camera was not calibrated; its focal length is taken as 525 px."};
  TruthBuilder builder(&dataset);
  camera_t camera_id = 0;
  fs::path pose_path = folder;
  size_t position = 0;
  for (const std::string& sequence : SequencesOf(folder, options.part)) {
    for (const std::string& name : PhotographsIn(folder / sequence)) {
      if (!name.ends_with(kColour) || position++ % static_cast<size_t>(options.stride) != 0)
        continue;
      const fs::path source = folder / sequence / name;
      if (camera_id == 0) {
        Camera camera = CameraOfPhotograph("SIMPLE_PINHOLE", source, {kFocalPx, 0.0, 0.0});
        camera.params[1] = 0.5 * static_cast<double>(camera.width);
        camera.params[2] = 0.5 * static_cast<double>(camera.height);
        camera_id = builder.AddCamera(std::move(camera));
      }
      const std::string stem = name.substr(0, name.size() - kColour.size());
      pose_path = folder / sequence / (stem + ".pose.txt");
      builder.AddImage(sequence.empty() ? name : sequence + "/" + name, source, camera_id,
                       ReadPose(pose_path));
    }
  }
  builder.Finish(pose_path);
  return dataset;
}

}  // namespace holba
