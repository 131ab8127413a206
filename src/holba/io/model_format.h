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

// The elements (image, index) of a track, each of which must be a 2D feature of the model that
// names `id`. `features_of(image)`: the image's 2D features; `id_of(feature)`: the 3D feature that
// it names.
template <typename In, typename Observation, typename Features, typename IdOf>
void ReadObservation(In& in, const Reconstruction& model, const char* kind, const char* idx_name,
                     uint64_t id, Features features_of, IdOf id_of,
                     std::vector<Observation>* track) {
  const image_t image_id = in.Index("IMAGE_ID");
  const Image* image = model.images.Find(image_id);
  if (image == nullptr) {
    in.Fail(fmt::format("{} {} names image {}, which is not in the model", kind, id, image_id));
  }
  const uint32_t idx = in.Index(idx_name);
  const auto& features = features_of(*image);
  if (idx >= features.size()) {
    in.Fail(fmt::format("{} {} names {} {} of image {}, expected less than {}", kind, id, idx_name,
                        idx, image_id, features.size()));
  }
  const uint64_t named = id_of(features[idx]);
  if (named != id) {
    in.Fail(fmt::format("{} {} names {} {} of image {}, which names {}", kind, id, idx_name, idx,
                        image_id,
                        named == kNoId ? std::string("none") : fmt::format("{} {}", kind, named)));
  }
  track->push_back({image_id, idx});
}

}  // namespace holba
