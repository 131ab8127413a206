// SPDX-License-Identifier: BSD-3-Clause
// Parameters of plausible cameras, at least two of every model: for tests of whatever must hold for
// all models. Distorted ones are injective at least up to 40 degrees from the axis (the whole
// sphere: EQUIRECTANGULAR).
#pragma once

#include <string_view>
#include <vector>

namespace holba {

struct CameraExamples {
  std::string_view model_name;
  std::vector<std::vector<double>> params;
};

inline const std::vector<CameraExamples>& AllCameraExamples() {
  static const std::vector<CameraExamples> examples = {
      {"SIMPLE_PINHOLE", {{655.123, 386.123, 511.123}, {1200.0, 960.0, 540.0}}},
      {"PINHOLE", {{651.123, 655.123, 386.123, 511.123}, {1180.0, 1210.0, 955.5, 544.25}}},
      {"SIMPLE_RADIAL", {{651.123, 386.123, 511.123, 0.1}, {1280.0, 512.0, 384.0, -0.12}}},
      {"RADIAL", {{651.123, 386.123, 511.123, 0.1, 0.05}, {1280.0, 512.0, 384.0, -0.21, 0.06}}},
      {"OPENCV",
       {{651.123, 655.123, 386.123, 511.123, -0.1, 0.02, 0.001, -0.002},
        {1000.0, 1010.0, 640.0, 360.0, -0.28, 0.09, 0.0007, 0.0004}}},
      {"OPENCV_FISHEYE",
       {{351.123, 355.123, 386.123, 511.123, -0.05, 0.02, -0.006, 0.001},
        {600.0, 602.0, 640.0, 480.0, 0.03, -0.008, 0.004, -0.0009}}},
      {"FULL_OPENCV",
       {{651.123, 655.123, 386.123, 511.123, -0.1, 0.02, 0.001, -0.002, 0.004, 0.06, -0.01, 0.003},
        {900.0, 905.0, 640.0, 360.0, 0.4, -0.1, 0.0003, -0.0006, 0.02, 0.7, 0.05, -0.01}}},
      {"FOV",
       {{651.123, 655.123, 386.123, 511.123, 0.9},
        {500.0, 505.0, 640.0, 480.0, 0.35},
        {500.0, 505.0, 640.0, 480.0, 1.4}}},
      {"SIMPLE_RADIAL_FISHEYE", {{351.123, 386.123, 511.123, 0.02}, {600.0, 640.0, 480.0, -0.04}}},
      {"RADIAL_FISHEYE",
       {{351.123, 386.123, 511.123, 0.02, 0.01}, {600.0, 640.0, 480.0, -0.04, 0.008}}},
      {"THIN_PRISM_FISHEYE",
       {{351.123, 355.123, 386.123, 511.123, -0.05, 0.02, 0.001, -0.002, -0.004, 0.001, 0.0015,
         -0.0008},
        {540.0, 541.0, 480.0, 310.0, 0.22, -0.18, 0.0004, 0.0002, 0.25, -0.11, -0.0003, 0.0006}}},
      {"RAD_TAN_THIN_PRISM_FISHEYE",
       {{611.0, 613.0, 704.0, 710.0, 0.41, -0.48, 0.13, 1.1, -1.6, 0.64, -0.0003, 0.0005, 0.0007,
         -0.0001, 0.0009, 0.0002},
        {241.0, 243.0, 319.0, 237.0, -0.025, 0.1, -0.07, 0.012, 0.002, -0.0006, 0.0006, -0.0002,
         -0.001, -9e-05, 0.0002, 4e-05}}},
      {"SIMPLE_DIVISION", {{651.123, 386.123, 511.123, -0.15}, {600.0, 640.0, 480.0, 0.08}}},
      {"DIVISION",
       {{651.123, 655.123, 386.123, 511.123, -0.15}, {600.0, 602.0, 640.0, 480.0, 0.08}}},
      {"SIMPLE_FISHEYE", {{351.123, 386.123, 511.123}, {600.0, 640.0, 480.0}}},
      {"FISHEYE", {{351.123, 355.123, 386.123, 511.123}, {600.0, 602.0, 640.0, 480.0}}},
      {"EUCM",
       {{651.123, 655.123, 386.123, 511.123, 0.6, 1.2},
        {300.0, 302.0, 640.0, 480.0, 0.3, 0.8},
        {300.0, 302.0, 640.0, 480.0, 0.0, 1.0}}},
      {"EQUIRECTANGULAR", {{1000.0, 500.0}, {4096.0, 2048.0}}},
  };
  return examples;
}

// Empty: no such model.
inline std::vector<std::vector<double>> ExampleCameraParams(std::string_view model_name) {
  for (const CameraExamples& examples : AllCameraExamples()) {
    if (examples.model_name == model_name) return examples.params;
  }
  return {};
}

}  // namespace holba
