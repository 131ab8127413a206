// SPDX-License-Identifier: BSD-3-Clause
// holba transform: a similarity of everything in a model, given or found by normalisation.
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/command.h"
#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/geometry/rigid3d.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"
#include "holba/scene/local_frame.h"
#include "holba/scene/reconstruction.h"

namespace holba {
namespace {

// x_new = scale * R(rotation) * x_old + translation, as plain numbers of options and files.
struct Similarity {
  double scale = 1.0;
  std::vector<double> rotation = {1, 0, 0, 0};  // qw qx qy qz
  std::vector<double> translation = {0, 0, 0};

  friend bool operator==(const Similarity&, const Similarity&) = default;
};

// `source` names the option or file for messages.
Sim3d ToSim3d(const Similarity& s, const std::string& source) {
  if (!(s.scale > 0) || !std::isfinite(s.scale)) {
    throw InputError(source + ": the scale must be a number greater than 0");
  }
  if (s.rotation.size() != 4) {
    throw InputError(source + ": expected 4 numbers qw,qx,qy,qz of a rotation, found " +
                     std::to_string(s.rotation.size()));
  }
  if (s.translation.size() != 3) {
    throw InputError(source + ": expected 3 numbers x,y,z of a translation, found " +
                     std::to_string(s.translation.size()));
  }
  Sim3d sim;
  sim.scale = s.scale;
  sim.rotation = Eigen::Quaterniond(s.rotation[0], s.rotation[1], s.rotation[2], s.rotation[3]);
  const double norm = sim.rotation.norm();
  if (!(norm > 0) || !std::isfinite(norm)) {
    throw InputError(source + ": the rotation must not be the zero quaternion");
  }
  sim.rotation.normalize();
  sim.translation = Eigen::Vector3d(s.translation.data());
  if (!sim.translation.allFinite()) throw InputError(source + ": the translation must be finite");
  return sim;
}

Sim3d ReadSimilarity(const std::string& path) {
  constexpr const char* kExpectedJson =
      "expected {\"scale\": s, \"rotation\": [qw, qx, qy, qz], \"translation\": [x, y, z]}";
  const std::string bytes = ReadFileBytes(path);
  Similarity s;
  try {
    const nlohmann::json json = nlohmann::json::parse(bytes);
    if (!json.is_object()) throw InputError(path, kExpectedJson);
    for (const auto& [key, value] : json.items()) {
      if (key == "scale") {
        s.scale = value.get<double>();
      } else if (key == "rotation") {
        s.rotation = value.get<std::vector<double>>();
      } else if (key == "translation") {
        s.translation = value.get<std::vector<double>>();
      } else {
        throw InputError(path, "expected scale, rotation or translation, found '" + key + "'");
      }
    }
  } catch (const nlohmann::json::exception& error) {
    throw InputError(path, fmt::format("{} ({})", kExpectedJson, error.what()));
  }
  return ToSim3d(s, path);
}

// c_from_a = c_from_b * b_from_a
Sim3d Compose(const Sim3d& c_from_b, const Sim3d& b_from_a) {
  Sim3d c_from_a;
  c_from_a.scale = c_from_b.scale * b_from_a.scale;
  c_from_a.rotation = (c_from_b.rotation * b_from_a.rotation).normalized();
  c_from_a.translation = c_from_b * b_from_a.translation;
  return c_from_a;
}

class TransformJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table->Field("input_path", &input_path_, "Model: a folder, or a file of another program.")
        .Required();
    table->Field("output_path", &output_path_, "Model folder; may be that of the input.")
        .Required();
    table->Choice("output_type", &output_type_,
                  {{"txt", ModelFormat::kText}, {"bin", ModelFormat::kBinary}},
                  "Format of the output.");
    table->Field("normalize", &normalize_,
                 "Centre and scale the cameras as COLMAP does, before what the other options say.");
    table->Field("scale", &similarity_.scale, GreaterThan(0), "Scale of the similarity.");
    table->Field("rotation", &similarity_.rotation, AnyValue(),
                 "Rotation of the similarity, a quaternion qw,qx,qy,qz of any length but 0.");
    table->Field("translation", &similarity_.translation, AnyValue(),
                 "Translation x,y,z of the similarity, in units of the output.");
    table->Field("transform_path", &transform_path_,
                 "JSON file with scale, rotation and translation, instead of these options.");
    read_.Describe(table);
  }

  void ProbeOutputs(const Invocation& invocation) const override {
    ProbeModelFolder(output_path_);
    if (invocation.json) ProbeResult();
  }

  void Run(const Invocation& invocation) override {
    const bool has_options = similarity_ != Similarity{};
    if (has_options && !transform_path_.empty()) {
      throw InputError(
          "--transform_path cannot go with --scale, --rotation or --translation; give the file or "
          "the options");
    }
    Sim3d new_from_old = transform_path_.empty()
                             ? ToSim3d(similarity_, "--scale, --rotation, --translation")
                             : ReadSimilarity(transform_path_);
    Reconstruction model = ReadModel(input_path_, read_);
    if (normalize_) {
      const auto normalised_from_old = NormalisedFromWorld(model);
      if (!normalised_from_old) {
        throw InputError(input_path_,
                         "has no images to normalise by; give --scale, --rotation or --translation "
                         "instead of --normalize");
      }
      new_from_old = Compose(new_from_old, *normalised_from_old);
    }
    model.Transform(new_from_old);
    WriteModel(model, output_path_, output_type_);
    if (invocation.json) PrintResult(ToJson(new_from_old));
    LogInfo("Wrote the transformed model to {}", output_path_);
  }

 private:
  // As --transform_path takes it.
  static std::string ToJson(const Sim3d& sim) {
    const Eigen::Quaterniond& q = sim.rotation;
    const nlohmann::json json = {
        {"scale", sim.scale},
        {"rotation", {q.w(), q.x(), q.y(), q.z()}},
        {"translation", {sim.translation.x(), sim.translation.y(), sim.translation.z()}}};
    return JsonText(json);
  }

  std::string input_path_;
  std::string output_path_;
  ModelFormat output_type_ = ModelFormat::kBinary;
  bool normalize_ = false;
  Similarity similarity_;
  std::string transform_path_;
  ReadModelOptions read_;
};

}  // namespace

Command TransformCommand() {
  return {.name = "transform",
          .summary = "Move, turn and scale a model with everything in it",
          .details =
              "x_new = scale * R(rotation) * x_old + translation. With --json, the similarity "
              "that was applied, as --transform_path takes it.",
          .supports_json = true,
          .make_job = [] { return std::make_unique<TransformJob>(); }};
}

}  // namespace holba
