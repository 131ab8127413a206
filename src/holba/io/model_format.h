// SPDX-License-Identifier: BSD-3-Clause
// The two forms of a model's files, and the bits that their readers share.
#pragma once

#include <cstdint>
#include <fmt/format.h>

#include <string>

#include "holba/io/binary_io.h"
#include "holba/io/text_io.h"
#include "holba/scene/reconstruction.h"
#include "holba/scene/validity.h"

namespace holba {

enum class ModelFormat { kText, kBinary };

// ".txt", ".bin".
inline const char* Extension(ModelFormat format) {
  return format == ModelFormat::kText ? ".txt" : ".bin";
}

// Calls function(in) with the reader of the format.
template <typename Function>
void WithInput(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
               Function function) {
  if (format == ModelFormat::kText) {
    TextIn in(bytes, path);
    function(in);
    in.Finish();
  } else {
    BinaryIn in(bytes, path);
    function(in);
    in.Finish();
  }
}

template <typename Function>
void WithOutput(ModelFormat format, std::ostream* stream, Function function) {
  if (format == ModelFormat::kText) {
    TextOut out(stream);
    function(out);
  } else {
    BinaryOut out(stream);
    function(out);
  }
}

template <typename In>
Eigen::Vector3d ReadVector3(In& in, const char* x, const char* y, const char* z) {
  const double vx = in.Real(x), vy = in.Real(y), vz = in.Real(z);
  return {vx, vy, vz};
}
template <typename Out>
void WriteVector3(Out& out, const Eigen::Vector3d& v) {
  for (int i = 0; i < 3; ++i) out.Real(v[i]);
}

// An element (image, index) of a track. Whether the 2D feature is there and names the 3D feature is
// looked at when all files are read (scene/one_sided_links.h): a reader cannot tell which end is
// wrong.
template <typename Observation, typename In>
Observation ReadObservation(In& in, const char* idx_name) {
  const image_t image_id = in.Index("IMAGE_ID");
  return {image_id, in.Index(idx_name)};
}

}  // namespace holba
