// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/glb.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "holba/io/files.h"
#include "holba/io/shapes.h"
#include "holba/scene/main_directions.h"

namespace holba {
namespace {

using nlohmann::json;
using Rgb = std::array<uint8_t, 3>;

// Names of glTF's numbers.
constexpr int kFloat = 5126, kUint = 5125, kByte = 5121;
constexpr int kModePoints = 0, kModeLines = 1, kModeTriangles = 4;
constexpr int kArrayBuffer = 34962, kElementArrayBuffer = 34963;
constexpr double kSurfaceOpacity = 0.35;

class GlbWriter {
 public:
  explicit GlbWriter(const Reconstruction& model) : model_(model), origin_(Origin(model)) {}

  void Write(std::ostream* stream) {
    std::vector<size_t> children;
    AddPoints(&children);
    AddLines(&children);
    AddGroups(&children);
    AddCameras(&children);
    const Eigen::Vector3d down = EstimateDown(model_);
    const PlanAxes axes = EstimatePlanAxes(model_, down);
    Eigen::Matrix3d upright;  // right, up, towards the viewer
    upright << axes.right.transpose(), -down.transpose(), axes.below.transpose();
    const Eigen::Quaterniond q(upright);
    const Eigen::Vector3d at = upright * origin_;
    json root = {{"name", "model"},
                 {"rotation", {q.x(), q.y(), q.z(), q.w()}},
                 {"translation", {at.x(), at.y(), at.z()}}};
    if (!children.empty()) root["children"] = children;
    nodes_.push_back(std::move(root));
    json gltf = {{"asset", {{"version", "2.0"}, {"generator", "holba"}}},
                 {"scene", 0},
                 {"scenes", {{{"nodes", {nodes_.size() - 1}}}}},
                 {"nodes", nodes_}};
    // Empty lists are not allowed.
    const auto add = [&](const char* name, const json& list) {
      if (!list.empty()) gltf[name] = list;
    };
    add("meshes", meshes_);
    add("materials", materials_);
    add("accessors", accessors_);
    add("bufferViews", views_);
    add("cameras", cameras_);
    if (!bytes_.empty()) gltf["buffers"] = {{{"byteLength", bytes_.size()}}};
    WriteChunks(gltf.dump(-1, ' ', true, json::error_handler_t::replace), stream);
  }

 private:
  // The mean of the camera centres, or of the points: single precision is enough from there.
  static Eigen::Vector3d Origin(const Reconstruction& model) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    size_t count = 0;
    const auto add = [&](const Eigen::Vector3d& X) {
      sum += X;
      ++count;
    };
    for (const auto& [id, image] : model.images) add(image.cam_from_world.OriginInA());
    if (count == 0) {
      for (const auto& [id, point] : model.points3D) add(point.xyz);
    }
    if (count == 0 || !sum.allFinite()) return Eigen::Vector3d::Zero();
    return sum / static_cast<double>(count);
  }

  void WriteChunks(std::string text, std::ostream* stream) {
    text.append((4 - text.size() % 4) % 4, ' ');
    const auto number = [&](size_t value) {
      const auto word = static_cast<uint32_t>(value);
      stream->write(reinterpret_cast<const char*>(&word), 4);
    };
    const size_t total = 12 + 8 + text.size() + (bytes_.empty() ? 0 : 8 + bytes_.size());
    *stream << "glTF";
    number(2);
    number(total);
    number(text.size());
    *stream << "JSON" << text;
    if (bytes_.empty()) return;
    number(bytes_.size());
    stream->write("BIN\0", 4);
    stream->write(bytes_.data(), static_cast<std::streamsize>(bytes_.size()));
  }

  template <typename T>
  size_t AddAccessor(std::span<const T> values, int component, const char* type, size_t width,
                     int target) {
    views_.push_back({{"buffer", 0},
                      {"byteOffset", bytes_.size()},
                      {"byteLength", values.size_bytes()},
                      {"target", target}});
    bytes_.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
    bytes_.append((4 - bytes_.size() % 4) % 4, '\0');
    accessors_.push_back({{"bufferView", views_.size() - 1},
                          {"componentType", component},
                          {"count", values.size() / width},
                          {"type", type}});
    return accessors_.size() - 1;
  }

  size_t AddPositions(std::span<const Eigen::Vector3d> positions) {
    std::vector<float> values;
    Eigen::Vector3f low = Eigen::Vector3f::Constant(INFINITY), high = -low;
    for (const Eigen::Vector3d& X : positions) {
      const Eigen::Vector3f x = (X - origin_).cast<float>();
      values.insert(values.end(), x.data(), x.data() + 3);
      low = low.cwiseMin(x);
      high = high.cwiseMax(x);
    }
    const size_t accessor = AddAccessor<float>(values, kFloat, "VEC3", 3, kArrayBuffer);
    accessors_[accessor]["min"] = {low.x(), low.y(), low.z()};
    accessors_[accessor]["max"] = {high.x(), high.y(), high.z()};
    return accessor;
  }

  size_t AddMaterial(const Rgb& rgb, double opacity) {
    json material = {
        {"doubleSided", true},
        {"pbrMetallicRoughness",
         {{"baseColorFactor", {Linear(rgb[0]), Linear(rgb[1]), Linear(rgb[2]), opacity}},
          {"metallicFactor", 0.0},
          {"roughnessFactor", 0.9}}}};
    if (opacity < 1.0) material["alphaMode"] = "BLEND";
    materials_.push_back(std::move(material));
    return materials_.size() - 1;
  }
  // glTF's factors are linear, our colours are those of a screen (sRGB).
  static double Linear(uint8_t value) {
    const double v = value / 255.0;
    return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
  }

  size_t AddNode(const std::string& name, json primitive) {
    meshes_.push_back({{"name", name}, {"primitives", {std::move(primitive)}}});
    nodes_.push_back({{"name", name}, {"mesh", meshes_.size() - 1}});
    return nodes_.size() - 1;
  }
  void AddParent(const std::string& name, const std::vector<size_t>& children,
                 std::vector<size_t>* roots) {
    if (children.empty()) return;
    nodes_.push_back({{"name", name}, {"children", children}});
    roots->push_back(nodes_.size() - 1);
  }

  void AddPoints(std::vector<size_t>* roots) {
    if (model_.points3D.empty()) return;
    std::vector<Eigen::Vector3d> positions;
    std::vector<uint8_t> colours;
    for (const auto& [id, point] : model_.points3D) {
      positions.push_back(point.xyz);
      for (const uint8_t channel : point.rgb) {
        colours.push_back(static_cast<uint8_t>(std::lround(255.0 * Linear(channel))));
      }
      colours.push_back(255);
    }
    const size_t position = AddPositions(positions);
    const size_t colour = AddAccessor<uint8_t>(colours, kByte, "VEC4", 4, kArrayBuffer);
    accessors_[colour]["normalized"] = true;
    roots->push_back(AddNode(
        "points",
        {{"mode", kModePoints}, {"attributes", {{"POSITION", position}, {"COLOR_0", colour}}}}));
  }

  void AddLines(std::vector<size_t>* roots) {
    std::vector<size_t> children;
    for (const LineLayer& layer : LineLayers(model_)) {
      std::vector<Eigen::Vector3d> ends;
      for (const line3D_t id : layer.line3D_ids) {
        ends.push_back(model_.lines3D.at(id).start);
        ends.push_back(model_.lines3D.at(id).end);
      }
      children.push_back(AddNode(layer.name, {{"mode", kModeLines},
                                              {"attributes", {{"POSITION", AddPositions(ends)}}},
                                              {"material", AddMaterial(layer.rgb, 1.0)}}));
    }
    AddParent("lines", children, roots);
  }

  void AddGroups(std::vector<size_t>* roots) {
    std::vector<size_t> children;
    for (const GroupShape& shape : GroupShapes(model_)) {
      if (shape.mesh.triangles.empty()) continue;
      std::vector<uint32_t> corners;
      for (const auto& triangle : shape.mesh.triangles)
        corners.insert(corners.end(), triangle.begin(), triangle.end());
      const size_t position = AddPositions(shape.mesh.vertices);
      children.push_back(AddNode(
          shape.name,
          {{"mode", kModeTriangles},
           {"attributes", {{"POSITION", position}}},
           {"indices", AddAccessor<uint32_t>(corners, kUint, "SCALAR", 1, kElementArrayBuffer)},
           {"material", AddMaterial(shape.rgb, kSurfaceOpacity)}}));
    }
    AddParent("groups", children, roots);
  }

  void AddCameras(std::vector<size_t>* roots) {
    std::vector<size_t> children;
    for (const auto& [id, image] : model_.images) {
      const Camera& camera = model_.cameras.at(image.camera_id);
      if (camera.width == 0 || camera.height == 0) continue;
      const IdealCalibration ideal = camera.model->ideal_calibration(camera.params.data());
      if (!(ideal.fx > 0.0) || !(ideal.fy > 0.0)) continue;
      const double height = static_cast<double>(camera.height),
                   width = static_cast<double>(camera.width);
      cameras_.push_back({{"type", "perspective"},
                          {"perspective",
                           {{"yfov", 2.0 * std::atan(0.5 * height / ideal.fy)},
                            {"aspectRatio", width / ideal.fx / (height / ideal.fy)},
                            {"znear", 0.01}}}});
      // COLMAP's cameras look along +z with y down, glTF's along -z with y up: half a turn about x.
      const Eigen::Quaterniond q =
          image.cam_from_world.rotation.normalized().conjugate() * Eigen::Quaterniond(0, 1, 0, 0);
      const Eigen::Vector3d centre = image.cam_from_world.OriginInA() - origin_;
      nodes_.push_back({{"name", image.name},
                        {"camera", cameras_.size() - 1},
                        {"rotation", {q.x(), q.y(), q.z(), q.w()}},
                        {"translation", {centre.x(), centre.y(), centre.z()}}});
      children.push_back(nodes_.size() - 1);
    }
    AddParent("cameras", children, roots);
  }

  const Reconstruction& model_;
  Eigen::Vector3d origin_;
  json nodes_ = json::array(), meshes_ = json::array(), materials_ = json::array(),
       accessors_ = json::array(), views_ = json::array(), cameras_ = json::array();
  std::string bytes_;
};

}  // namespace

void WriteGlb(const Reconstruction& model, const std::filesystem::path& path) {
  WriteFileWhole(path, [&](std::ostream* stream) { FormatGlb(model, stream); });
}

void FormatGlb(const Reconstruction& model, std::ostream* stream) {
  GlbWriter(model).Write(stream);
}

}  // namespace holba
