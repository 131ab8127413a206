// SPDX-License-Identifier: BSD-3-Clause
#include "holba/view/view_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <unordered_map>
#include <utility>
#include <vector>

#include "holba/base/check.h"
#include "holba/estimation/points/point_uncertainty.h"
#include "holba/scene/main_directions.h"
#include "holba/scene/views.h"
#include "holba/view/array_bundle.h"
#include "holba/view/camera_grid.h"
#include "holba/view/view_observations.h"

namespace holba {
namespace {

using nlohmann::json;

constexpr uint32_t kNone = 0xffffffff;
// Amid a cell of a camera's grid; what is seen lies beside its image by this at most.
constexpr double kMaxGridErrorPx = 0.1;
// Shares of points for the extent of a scene: those farthest out are often wrong.
constexpr double kLowShare = 0.02, kHighShare = 0.98;
// Covariances of more points would be the larger part of a page.
constexpr size_t kMaxNumCovariances = 300'000;

json ToJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

// JSON has no infinity, and single precision no more than this.
float Single(double value) {
  constexpr double kGreatest = 1e30;
  if (std::isnan(value)) return 0.0f;
  return static_cast<float>(std::clamp(value, -kGreatest, kGreatest));
}

double Quantile(std::vector<double>* values, double share) {
  const auto nth =
      values->begin() + static_cast<ptrdiff_t>(share * static_cast<double>(values->size() - 1));
  std::nth_element(values->begin(), nth, values->end());
  return *nth;
}

// Of all positions along one axis.
std::vector<double> Coordinates(const Reconstruction& model, int axis) {
  std::vector<double> values;
  for (const auto& [id, point] : model.points3D) values.push_back(point.xyz[axis]);
  for (const auto& [id, line] : model.lines3D) {
    values.push_back(line.start[axis]);
    values.push_back(line.end[axis]);
  }
  if (values.empty()) {
    for (const auto& [id, image] : model.images)
      values.push_back(image.cam_from_world.OriginInA()[axis]);
  }
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  return values;
}

class ModelWriter {
 public:
  ModelWriter(const Reconstruction& model, const ViewModelOptions& options,
              const Eigen::Vector3d& origin)
      : model_(model), options_(options), origin_(origin), views_(model) {}

  ViewModel Write() {
    const auto sigma_px = MeasurePointSigmaPx(model_, views_);
    sigma_px_ = sigma_px && *sigma_px > 0.0 ? *sigma_px : 1.0;
    meta_ = {{"version", 1},
             {"title", options_.title},
             {"report", options_.report},
             {"origin", ToJson(origin_)},
             {"sigma_px", sigma_px_}};
    WriteExtent();
    WriteCameras();
    WriteImages();
    WritePoints();
    WriteLines();
    WriteGroups();
    WriteWireframe();
    ViewModel result;
    result.has_observed_positions = WritePositions();
    meta_["has_positions"] = result.has_observed_positions;
    result.bytes = bundle_.ToBytes(std::move(meta_));
    return result;
  }

 private:
  void AppendPosition(const Eigen::Vector3d& X, std::vector<float>* values) const {
    for (int k = 0; k < 3; ++k) values->push_back(Single(X[k] - origin_[k]));
  }

  // Ids as differences: of ascending ids mostly ones. High halves are zeros in nearly every model.
  template <typename Records>
  void WriteIds(const std::string& name, const Records& records) {
    std::vector<uint32_t> steps, high;
    uint32_t last = 0;
    for (const auto& [id, record] : records) {
      const auto low = static_cast<uint32_t>(id);
      steps.push_back(low - last);
      high.push_back(static_cast<uint32_t>(static_cast<uint64_t>(id) >> 32));
      last = low;
    }
    bundle_.Add(name + "_id_steps", steps);
    bundle_.Add(name + "_id_high", high);
  }

  void WriteExtent() {
    Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = low;
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<double> values = Coordinates(model_, axis);
      if (values.empty()) continue;
      low[axis] = Single(Quantile(&values, kLowShare) - origin_[axis]);
      high[axis] = Single(Quantile(&values, kHighShare) - origin_[axis]);
    }
    const Eigen::Vector3d down = EstimateDown(model_);
    meta_["low"] = ToJson(low);
    meta_["high"] = ToJson(high);
    meta_["down"] = ToJson(down);
    meta_["right"] = ToJson(EstimatePlanAxes(model_, down).right);
  }

  void WriteCameras() {
    json cameras = json::array();
    std::vector<float> rays;
    for (const auto& [id, camera] : model_.cameras) {
      camera_idx_[id] = cameras.size();
      const CameraGrid grid = MakeCameraGrid(camera, kMaxGridErrorPx);
      json params = json::array();
      for (const double value : camera.params) params.push_back(Single(value));
      cameras.push_back({{"id", id},
                         {"model", std::string(camera.model->name)},
                         {"names", std::string(camera.model->param_names)},
                         {"width", camera.width},
                         {"height", camera.height},
                         {"params", std::move(params)},
                         {"columns", grid.columns},
                         {"rows", grid.rows},
                         {"planar", grid.is_planar},
                         {"ray", rays.size()}});
      for (const float value : grid.rays) rays.push_back(std::isfinite(value) ? value : 0.0f);
    }
    meta_["cameras"] = std::move(cameras);
    bundle_.Add("camera_rays", rays);
  }

  void WriteImages() {
    json images = json::array();
    std::vector<float> centres;
    for (const auto& [id, image] : model_.images) {
      const Eigen::Quaterniond q = image.cam_from_world.rotation.normalized();
      images.push_back({{"id", id},
                        {"name", image.name},
                        {"camera", camera_idx_.at(image.camera_id)},
                        {"q", {q.w(), q.x(), q.y(), q.z()}},
                        {"points", image.points2D.size()},
                        {"lines", image.lines2D.size()}});
      AppendPosition(image.cam_from_world.OriginInA(), &centres);
    }
    meta_["images"] = std::move(images);
    bundle_.Add("image_centre", centres);
    json waiting = json::array();
    for (const auto& [id, image] : model_.unregistered_images) waiting.push_back(image.name);
    meta_["unregistered"] = std::move(waiting);
  }

  void AddObservations(const std::string& name, const ViewObservations& seen) {
    bundle_.Add(name + "_obs_length", seen.length);
    // Half the size, as most models have fewer images.
    if (model_.images.size() <= 0xffff) {
      bundle_.Add(name + "_obs_image", std::vector<uint16_t>(seen.image.begin(), seen.image.end()));
    } else {
      bundle_.Add(name + "_obs_image", seen.image);
    }
    bundle_.AddHalf(name + "_obs_error", seen.error_px);
    // Relative to the scene, as halves reach from 6e-8 to 65504 only.
    const double size = ScaleOfSigma();
    std::vector<float> sigma;
    for (const float value : seen.sigma) sigma.push_back(Single(value / size));
    bundle_.AddHalf(name + "_sigma", sigma);
  }

  // Sigmas of the page are in thousandths of the scene's extent.
  double ScaleOfSigma() {
    if (sigma_scale_ == 0.0) {
      double extent = 0.0;
      for (int k = 0; k < 3; ++k)
        extent = std::max<double>(extent,
                                  meta_["high"][k].get<double>() - meta_["low"][k].get<double>());
      sigma_scale_ = extent > 0.0 ? 1e-3 * extent : 1.0;
      meta_["sigma_scale"] = sigma_scale_;
    }
    return sigma_scale_;
  }

  void WritePoints() {
    std::vector<float> xyz, error;
    std::vector<uint8_t> rgb, origin;
    for (const auto& [id, point] : model_.points3D) {
      point_idx_[id] = static_cast<uint32_t>(origin.size());
      AppendPosition(point.xyz, &xyz);
      rgb.insert(rgb.end(), point.rgb.begin(), point.rgb.end());
      error.push_back(Single(point.error));
      origin.push_back(static_cast<uint8_t>(point.origin));
    }
    WriteIds("point", model_.points3D);
    bundle_.Add("point_xyz", xyz);
    bundle_.Add("point_rgb", rgb);
    bundle_.AddHalf("point_error", error);
    bundle_.Add("point_origin", origin);
    std::vector<int16_t> covariances;
    ViewObservations seen =
        ObservationsOfPoints(model_, views_, sigma_px_, options_.num_threads, &covariances);
    AddObservations("point", seen);
    if (model_.points3D.size() <= kMaxNumCovariances) bundle_.Add("point_covariance", covariances);
    point_positions_ = std::move(seen.positions);
  }

  void WriteLines() {
    std::vector<float> ends, error;
    std::vector<uint8_t> rgb;
    for (const auto& [id, line] : model_.lines3D) {
      line_idx_[id] = static_cast<uint32_t>(error.size());
      AppendPosition(line.start, &ends);
      AppendPosition(line.end, &ends);
      rgb.insert(rgb.end(), line.rgb.begin(), line.rgb.end());
      error.push_back(Single(line.error));
    }
    WriteIds("line", model_.lines3D);
    bundle_.Add("line_ends", ends);
    bundle_.Add("line_rgb", rgb);
    bundle_.AddHalf("line_error", error);
    ViewObservations seen = ObservationsOfLines(model_, views_, sigma_px_, options_.num_threads);
    AddObservations("line", seen);
    line_positions_ = std::move(seen.positions);
  }

  void WriteGroups() {
    json groups = json::array();
    std::vector<uint32_t> points, lines, images, triangles;
    std::vector<float> vertices;
    std::unordered_map<group3D_t, size_t> group_idx;
    for (const auto& [id, group] : model_.groups3D) {
      group_idx[id] = groups.size();
      json params = json::array();
      for (const double value : group.params) params.push_back(std::isfinite(value) ? value : 0.0);
      json record = {{"id", std::to_string(id)},
                     {"type", std::string(group.type->name)},
                     {"names", std::string(group.type->file_params)},
                     {"params", std::move(params)},
                     {"points", group.point3D_ids.size()},
                     {"lines", group.line3D_ids.size()},
                     {"observations", group.observations.size()}};
      std::vector<Eigen::Vector3d> members;
      for (const point3D_t point : group.point3D_ids) {
        points.push_back(point_idx_.at(point));
        members.push_back(model_.points3D.at(point).xyz);
      }
      for (const line3D_t line : group.line3D_ids) {
        lines.push_back(line_idx_.at(line));
        members.push_back(model_.lines3D.at(line).start);
        members.push_back(model_.lines3D.at(line).end);
      }
      for (const GroupObservation& observation : group.observations)
        images.push_back(views_.IndexOf(observation.image_id));
      double g[kMaxGroupParams];
      HOLBA_CHECK(group.type->from_file(group.params.data(), g));
      if (group.type->HasDirection()) {
        Eigen::Vector3d direction;
        group.type->direction(g, &direction, nullptr);
        record["direction"] = ToJson(direction);
      }
      record["parallelism"] = group.type->IsParallelism();
      const GroupMesh mesh = group.type->mesh(g, members);
      record["vertices"] = mesh.vertices.size();
      record["triangles"] = mesh.triangles.size();
      for (const Eigen::Vector3d& vertex : mesh.vertices) AppendPosition(vertex, &vertices);
      for (const auto& triangle : mesh.triangles)
        triangles.insert(triangles.end(), triangle.begin(), triangle.end());
      groups.push_back(std::move(record));
    }
    meta_["groups"] = std::move(groups);
    bundle_.Add("group_points", points);
    bundle_.Add("group_lines", lines);
    bundle_.Add("group_images", images);
    bundle_.Add("group_vertices", vertices);
    bundle_.Add("group_triangles", triangles);
    json relations = json::array();
    for (const Relation& relation : model_.relations) {
      relations.push_back({group_idx.at(relation.group3D_id1), group_idx.at(relation.group3D_id2),
                           static_cast<int>(relation.type)});
    }
    meta_["relations"] = std::move(relations);
  }

  void WriteWireframe() {
    std::vector<uint32_t> edges;  // point, line, number of images
    for (const WireframeEdge& edge : model_.wireframe) {
      edges.push_back(point_idx_.at(edge.point3D_id));
      edges.push_back(line_idx_.at(edge.line3D_id));
      edges.push_back(static_cast<uint32_t>(std::min<uint64_t>(edge.num_images, kNone)));
    }
    bundle_.Add("wireframe", edges);
  }

  // False: they would be too much.
  bool WritePositions() {
    size_t num_segments = 0;
    for (const auto& [id, image] : model_.images) num_segments += image.lines2D.size();
    const size_t num_bytes =
        2 * (point_positions_.size() + line_positions_.size()) + 12 * num_segments;
    if (bundle_.NumBytes() + num_bytes > options_.max_num_bytes) return false;
    bundle_.Add("point_obs_position", point_positions_);
    bundle_.Add("line_obs_position", line_positions_);
    // Segments that no line was made of.
    std::vector<uint16_t> positions;
    std::vector<uint32_t> counts;
    for (const auto& [id, image] : model_.images) {
      const Camera& camera = model_.cameras.at(image.camera_id);
      uint32_t count = 0;
      for (const Line2D& line : image.lines2D) {
        if (line.line3D_id != kNoId) continue;
        ++count;
        for (const Eigen::Vector2d& end : {line.segment.start, line.segment.end}) {
          for (int c = 0; c < 2; ++c) positions.push_back(PositionOfView(end[c], camera));
        }
      }
      counts.push_back(count);
    }
    bundle_.Add("image_segment_count", counts);
    bundle_.Add("image_segments", positions);
    return true;
  }

  const Reconstruction& model_;
  const ViewModelOptions& options_;
  Eigen::Vector3d origin_;
  ViewMap views_;
  double sigma_px_ = 1.0, sigma_scale_ = 0.0;
  json meta_;
  ArrayBundle bundle_;
  std::unordered_map<camera_t, size_t> camera_idx_;
  std::unordered_map<point3D_t, uint32_t> point_idx_;
  std::unordered_map<line3D_t, uint32_t> line_idx_;
  std::vector<uint16_t> point_positions_, line_positions_;
};

}  // namespace

Eigen::Vector3d OriginOfView(const Reconstruction& model) {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values = Coordinates(model, axis);
    if (!values.empty()) origin[axis] = Quantile(&values, 0.5);
  }
  return origin;
}

ViewModel MakeViewModel(const Reconstruction& model, const ViewModelOptions& options,
                        const std::optional<Eigen::Vector3d>& origin) {
  return ModelWriter(model, options, origin.value_or(OriginOfView(model))).Write();
}

}  // namespace holba
