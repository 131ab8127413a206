// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/holistic_json.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "holba/base/error.h"
#include "holba/io/text_io.h"

namespace holba {
namespace {

constexpr int64_t kFormatVersion = 1;
constexpr double kMaxFrameDifference = 0.01;  // of the spread
// Rounding of centroids, for models whose spread is 0 (one image).
constexpr double kMaxRounding = 1e-9;
constexpr const char* kExpected =
    R"(expected {"format": 1, "frame": {"num_images": N, "centroid": [x, y, z], "spread": s}})";

std::string ToText(const Eigen::Vector3d& v) {
  return fmt::format("({:.6g}, {:.6g}, {:.6g})", v.x(), v.y(), v.z());
}

}  // namespace

ModelFrame FrameOf(const Reconstruction& model) {
  ModelFrame frame;
  frame.num_images = model.images.size();
  if (model.images.empty()) return frame;
  const auto n = static_cast<double>(model.images.size());
  for (const auto& [image_id, image] : model.images) {
    frame.centroid += image.cam_from_world.OriginInA() / n;
  }
  double sum_squares = 0.0;
  for (const auto& [image_id, image] : model.images) {
    sum_squares += (image.cam_from_world.OriginInA() - frame.centroid).squaredNorm();
  }
  frame.spread = std::sqrt(sum_squares / n);
  return frame;
}

ModelFrame ParseHolisticJson(std::string_view bytes, const std::filesystem::path& path) {
  ModelFrame frame;
  try {
    const nlohmann::json json = nlohmann::json::parse(bytes.begin(), bytes.end());
    const nlohmann::json& version = json.at("format");
    if (!version.is_number_integer() || version != kFormatVersion) {
      throw InputError(path, fmt::format("expected \"format\": {}, found {}; use the version of "
                                         "this program that wrote the model",
                                         kFormatVersion, version.dump().substr(0, 40)));
    }
    const nlohmann::json& stated = json.at("frame");
    const nlohmann::json& num_images = stated.at("num_images");
    const nlohmann::json& centroid = stated.at("centroid");
    const nlohmann::json& spread = stated.at("spread");
    if (!num_images.is_number_unsigned() || !spread.is_number() || !centroid.is_array() ||
        centroid.size() != 3) {
      throw InputError(path, kExpected);
    }
    frame.num_images = num_images.get<uint64_t>();
    for (int i = 0; i < 3; ++i) frame.centroid[i] = centroid.at(i).get<double>();
    frame.spread = spread.get<double>();
  } catch (const nlohmann::json::parse_error& error) {
    throw InputError::AtByte(path, error.byte, std::string(kExpected) + ", found no valid JSON");
  } catch (const nlohmann::json::exception& error) {
    throw InputError(path, std::string(kExpected) + ": " + error.what());
  }
  if (!frame.centroid.allFinite() || !std::isfinite(frame.spread) || frame.spread < 0.0) {
    throw InputError(path, std::string(kExpected) + " with a spread of 0 or more");
  }
  return frame;
}

std::string HolisticJson(const ModelFrame& frame) {
  return fmt::format(
      "{{\"format\": {}, \"frame\": {{\"num_images\": {}, \"centroid\": [{}, {}, {}], "
      "\"spread\": {}}}}}\n",
      kFormatVersion, frame.num_images, RealToText(frame.centroid.x()),
      RealToText(frame.centroid.y()), RealToText(frame.centroid.z()), RealToText(frame.spread));
}

void CheckFrame(const ModelFrame& stated, const ModelFrame& actual,
                const std::filesystem::path& path) {
  if (stated.num_images != actual.num_images) {
    throw InputError(
        path, fmt::format("the side files belong to a model of {} images, this one has {}: {}",
                          stated.num_images, actual.num_images, kSideFilesRemedy));
  }
  const double allowed =
      kMaxFrameDifference * stated.spread + kMaxRounding * (1.0 + stated.centroid.norm());
  const double moved = (stated.centroid - actual.centroid).norm();
  const double scaled = std::abs(stated.spread - actual.spread);
  if (moved <= allowed && scaled <= allowed) return;
  throw InputError(
      path,
      fmt::format("the side files belong to camera centres with centroid {} and spread {:.6g}, "
                  "those of this model have centroid {} and spread {:.6g}, which is more than 1 % "
                  "of the spread off: {}",
                  ToText(stated.centroid), stated.spread, ToText(actual.centroid), actual.spread,
                  kSideFilesRemedy));
}

}  // namespace holba
