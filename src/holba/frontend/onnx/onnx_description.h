// SPDX-License-Identifier: BSD-3-Clause
// The JSON file that says what the inputs and outputs of a user's ONNX model are (docs/onnx.md).
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace holba {

enum class OnnxKind { kPoints, kSegments, kMatcher };

struct OnnxDescription {
  OnnxKind kind = OnnxKind::kPoints;
  std::filesystem::path model;    // beside the JSON file, unless its path is absolute
  std::filesystem::path library;  // of the ONNX Runtime; empty: the one that is found
  // By what they are for: "image", "keypoints1", "descriptors", ...: the model's names.
  std::map<std::string, std::string> inputs, outputs;

  // Of models that see a photograph.
  int channels = 1;           // 1: grey, 3: RGB
  int max_image_size = 1024;  // larger photographs are scaled down to this width or height
  int multiple_of = 1;        // black is added at the right and below up to such a size
  double range = 1.0;         // white is this; black 0
  std::vector<double> mean, deviation;  // of each channel, subtracted and divided by; empty: not
  // Coordinate of the centre of the first pixel in the model's outputs (inputs of a matcher).
  double first_pixel = 0.0;
  int max_num = 8192;      // features that are kept, those of the highest scores
  double min_score = 0.0;  // of features, or of matches
  // Descriptors (and keypoints) are columns, (D, N), not rows, (N, D).
  bool are_columns = false;
  // Matchers: key points come as (x - w/2, y - h/2) / (longer side / 2).
  bool are_normalised = true;
  // Matchers: for each point of the first image that of the second one or -1; else pairs.
  bool is_of_first = false;
};

// Throws InputError with file, key and what was expected: unknown keys, wrong types, missing names.
OnnxDescription ReadOnnxDescription(const std::filesystem::path& path, OnnxKind kind);

}  // namespace holba
