// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/bundle_problem.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>
#include <unordered_map>

#include "holba/base/check.h"
#include "holba/residual/group_line.h"
#include "holba/residual/group_line_3d.h"
#include "holba/residual/group_measurement.h"
#include "holba/residual/group_point.h"
#include "holba/residual/group_point_3d.h"
#include "holba/residual/line.h"
#include "holba/residual/point.h"
#include "holba/residual/relation.h"
#include "holba/residual/vanishing_point.h"
#include "holba/residual/wireframe_3d.h"
#include "holba/residual/wireframe_line.h"
#include "holba/residual/wireframe_point.h"

namespace holba {
namespace {

Loss ToLoss(const TermSettings& settings) {
  switch (settings.loss.value_or(LossChoice::kTrivial)) {
    case LossChoice::kTrivial:
      return {LossType::kTrivial, settings.loss_scale};
    case LossChoice::kHuber:
      return {LossType::kHuber, settings.loss_scale};
    case LossChoice::kSoftL1:
      return {LossType::kSoftL1, settings.loss_scale};
    case LossChoice::kCauchy:
    case LossChoice::kAuto:
      return {LossType::kCauchy, settings.loss_scale};
  }
  return {};
}

// Builds one problem; each Add* is one kind of block or term.
class Builder {
 public:
  Builder(const Reconstruction& model, const BundleOptions& options,
          const AssociationFilter& filter, BundleProblem* out)
      : model_(model), options_(options), filter_(filter), out_(*out), problem_(out->problem) {}

  void Build(std::span<const GroupMeasurement> measurements) {
    out_.points_of_structure = options_.points_of_structure;
    AddPosesAndCameras();
    AddPoints();
    if (options_.config >= BundleConfig::kPointLine) AddLines();
    if (options_.config >= BundleConfig::kGroups) {
      AddGroups();
      AddGroupTerms();
      AddRelations();
      AddMeasurements(measurements);
    }
    if (options_.config >= BundleConfig::kHolistic) AddWireframe();
    for (auto& [key, batch] : batches_) problem_.AddBatch(std::move(batch));
    FixGauge();
  }

 private:
  // What a residual needs of an image.
  struct ImageBlocks {
    BlockId pose, camera;
    const SensorPose* sensor;
    const CameraModel* model;
    const double* params;
    bool observations_move;
    const Image* image;
    KernelBatch<PointResidual>* points = nullptr;  // of its camera model, once there is one
    KernelBatch<PointResidual>* structure_points = nullptr;
  };

  void AddPosesAndCameras() {
    std::unordered_map<camera_t, BlockId> camera_blocks;
    std::unordered_map<frame_t, BlockId> pose_blocks;
    std::map<std::pair<rig_t, camera_t>, const SensorPose*> sensors;
    for (const auto& [image_id, image] : model_.images) {
      const Frame& frame = model_.frames.at(image.frame_id);
      const auto [pose, new_pose] = pose_blocks.try_emplace(image.frame_id, 0);
      if (new_pose) {
        const Eigen::Quaterniond q = frame.rig_from_world.rotation.normalized();
        const Eigen::Vector3d& t = frame.rig_from_world.translation;
        const double values[7] = {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
        pose->second = problem_.AddBlock("pose", OpsOf<PoseManifold>(), BlockRole::kPose, values);
        problem_.block(pose->second).constant = options_.fix_poses;
        out_.poses.emplace_back(image.frame_id, pose->second);
      }
      const Camera& camera = model_.cameras.at(image.camera_id);
      const auto [intrinsics, new_camera] = camera_blocks.try_emplace(image.camera_id, 0);
      if (new_camera) {
        intrinsics->second = problem_.AddBlock("camera", EuclideanOps(camera.model->num_params),
                                               BlockRole::kIntrinsics, camera.params);
        HoldIntrinsics(*camera.model, &problem_.block(intrinsics->second));
        out_.cameras.emplace_back(image.camera_id, intrinsics->second);
      }
      const auto [sensor, new_sensor] =
          sensors.try_emplace({frame.rig_id, image.camera_id}, nullptr);
      if (new_sensor && !IsReferenceSensor(frame, image)) {
        const Rigid3d& pose_in_rig = model_.SensorFromRig(image);
        out_.sensor_poses.push_back(std::make_unique<SensorPose>(
            SensorPose{pose_in_rig.RotationMatrix(), pose_in_rig.translation}));
        sensor->second = out_.sensor_poses.back().get();
      }
      images_[image_id] = {
          pose->second,
          intrinsics->second,
          sensor->second,
          camera.model,
          camera.params.data(),
          !camera.model->is_pinhole && problem_.block(intrinsics->second).FreeTangent() > 0,
          &image};
    }
  }

  bool IsReferenceSensor(const Frame& frame, const Image& image) const {
    const Rig& rig = model_.rigs.at(frame.rig_id);
    return rig.ref_sensor && *rig.ref_sensor == SensorId{SensorType::kCamera, image.camera_id};
  }

  void HoldIntrinsics(const CameraModel& model, ParameterBlock* block) const {
    uint32_t free = 0;
    const auto release = [&](std::span<const int> idxs) {
      for (int idx : idxs) free |= uint32_t{1} << idx;
    };
    if (options_.refine_focal_length) release(model.focal_idxs);
    if (options_.refine_principal_point) release(model.principal_point_idxs);
    if (options_.refine_extra_params) release(model.extra_idxs);
    block->held = ~free & ((uint32_t{1} << model.num_params) - 1);
    block->constant = free == 0;
  }

  // One batch for each (term, camera model, group type, whether observations move), and each weight
  // (weight_halvings_): its kernel is made on first use.
  template <typename Kernel, typename MakeKernel>
  KernelBatch<Kernel>& BatchOf(std::string_view term, std::initializer_list<int> tangents,
                               std::tuple<int, int, int> key, const MakeKernel& make) {
    const TermFamily family = FamilyOf(term);
    std::unique_ptr<ResidualBatch>& batch =
        batches_[{static_cast<int>(family), term, key, weight_halvings_}];
    if (!batch) {
      auto made = std::make_unique<KernelBatch<Kernel>>(std::string(term), Kernel::kDim,
                                                        std::vector<int>(tangents), make());
      made->loss = ToLoss(options_[family]);
      made->weight = std::ldexp(options_[family].weight, -weight_halvings_);
      made->angular = IsAngular(family);
      batch = std::move(made);
    }
    return static_cast<KernelBatch<Kernel>&>(*batch);
  }

  // A feature seen in a single image has no depth of its own: it stays as it is.
  template <typename Track>
  static bool SeenInTwoImages(const Track& track) {
    return std::any_of(track.begin(), track.end(), [&](const auto& element) {
      return element.image_id != track.front().image_id;
    });
  }

  BlockId PointBlock(point3D_t id) const { return out_.points[model_.points3D.IndexOf(id)].second; }

  void AddPoints() {
    problem_.Reserve(problem_.num_blocks() + model_.points3D.size(),
                     problem_.state().size() + 3 * model_.points3D.size());
    out_.points.reserve(model_.points3D.size());
    size_t num_observations = 0;
    for (const auto& [id, point] : model_.points3D) num_observations += point.track.size();
    const bool one_model = std::all_of(images_.begin(), images_.end(), [&](const auto& image) {
      return image.second.model == images_.begin()->second.model;
    });
    for (const auto& [id, point] : model_.points3D) {
      const bool of_structure = options_.points_of_structure.contains(id);
      const BlockId block = problem_.AddBlock("point", OpsOf<Euclidean<3>>(), BlockRole::kFeature,
                                              {point.xyz.data(), 3});
      problem_.block(block).constant = options_.fix_points || !SeenInTwoImages(point.track);
      out_.points.emplace_back(id, block);
      for (const PointObservation& observation : point.track) {
        ImageBlocks& image = images_.at(observation.image_id);
        auto*& batch = of_structure ? image.structure_points : image.points;
        if (batch == nullptr) {
          batch = &BatchOf<PointResidual>(of_structure ? "structure_point" : "point",
                                          {3, 6, image.model->num_params}, {image.model->id, -1, 0},
                                          [&] { return PointResidual{image.model}; });
          if (one_model && !of_structure) batch->Reserve(num_observations);
        }
        batch->Add(std::array{block, image.pose, image.camera},
                   {image.image->points2D[observation.point2D_idx].xy, image.sensor});
      }
    }
  }

  SegmentDatum DatumOf(const LineObservation& observation) const {
    const ImageBlocks& image = images_.at(observation.image_id);
    const LineSegment2d& segment = SegmentOf(observation);
    return {IdealObservation(*image.model, image.params, segment.start),
            IdealObservation(*image.model, image.params, segment.end), image.sensor};
  }
  const LineSegment2d& SegmentOf(const LineObservation& observation) const {
    return model_.images.at(observation.image_id).lines2D[observation.line2D_idx].segment;
  }

  // Whether the lines with incidences leave the eliminated features (3D form only: it couples two
  // features).
  bool LinesAreKept() const {
    return options_.config >= BundleConfig::kHolistic &&
           options_.wireframe_form == StructureForm::k3d;
  }

  void AddLines() {
    std::set<line3D_t> in_wireframe;
    if (LinesAreKept()) {
      for (const WireframeEdge& edge : model_.wireframe) in_wireframe.insert(edge.line3D_id);
    }
    for (const auto& [id, line] : model_.lines3D) {
      // The anchor in the middle of the seen part keeps direction and position uncorrelated.
      const Eigen::Vector3d anchor = line.line.ClosestPoint(0.5 * (line.start + line.end));
      double values[6];
      Eigen::Map<Eigen::Vector3d>{values} = line.line.direction.normalized();
      Eigen::Map<Eigen::Vector3d>{values + 3} = anchor;
      const BlockRole role = in_wireframe.contains(id) ? BlockRole::kGroup : BlockRole::kFeature;
      const BlockId block = problem_.AddBlock("line", OpsOf<LineManifold>(), role, values);
      problem_.block(block).constant = options_.fix_lines || !SeenInTwoImages(line.track);
      lines_[id] = block;
      out_.lines.emplace_back(id, block);
      for (const LineObservation& observation : line.track) {
        const ImageBlocks& image = images_.at(observation.image_id);
        auto& batch =
            BatchOf<LineResidual>("line", {4, 6, image.model->num_params},
                                  {image.model->id, -1, image.observations_move}, [&] {
                                    return LineResidual{{image.model, image.observations_move}};
                                  });
        batch.Add(std::array{block, image.pose, image.camera}, DatumOf(observation));
      }
    }
  }

  void AddGroups() {
    for (const auto& [id, group] : model_.groups3D) {
      double values[kMaxGroupParams];
      HOLBA_CHECK_MSG(group.type->from_file(group.params.data(), values),
                      "invalid group " + std::to_string(id));
      const BlockId block =
          problem_.AddBlock(group.type->name, *group.type->manifold, BlockRole::kGroup,
                            {values, static_cast<size_t>(group.type->manifold->ambient)});
      problem_.block(block).constant = options_.fix_groups;
      groups_[id] = block;
      out_.groups.emplace_back(id, block);
    }
  }

  void AddGroupTerms() {
    for (const auto& [id, group] : model_.groups3D) {
      const GroupType* type = group.type;
      const BlockId group_block = groups_.at(id);
      if (filter_.groups.contains(id)) continue;
      const auto halvings = filter_.halvings.find(id);
      weight_halvings_ = halvings != filter_.halvings.end() ? halvings->second : 0;
      for (point3D_t point_id : group.point3D_ids) {
        if (!filter_.points.contains({id, point_id})) AddGroupPoint(*type, group_block, point_id);
      }
      for (line3D_t line_id : group.line3D_ids) {
        if (!filter_.lines.contains({id, line_id})) AddGroupLine(*type, group_block, line_id);
      }
    }
    weight_halvings_ = 0;
  }

  void AddGroupPoint(const GroupType& type, BlockId group, point3D_t point_id) {
    if (options_.group_form == StructureForm::k3d) {
      auto& batch = BatchOf<GroupPoint3dResidual>("group_point_3d", {3, type.manifold->tangent},
                                                  {-1, type.code, 0},
                                                  [&] { return GroupPoint3dResidual{&type}; });
      Use3dWeight(options_.group_3d_weight, &batch);
      batch.Add(std::array{PointBlock(point_id), group}, {});
      return;
    }
    for (const PointObservation& observation : model_.points3D.at(point_id).track) {
      const ImageBlocks& image = images_.at(observation.image_id);
      auto& batch = BatchOf<GroupPointResidual>(
          "group_point", {3, 6, image.model->num_params, type.manifold->tangent},
          {image.model->id, type.code, 0}, [&] {
            return GroupPointResidual{image.model, &type};
          });
      batch.Add(std::array{PointBlock(point_id), image.pose, image.camera, group}, {image.sensor});
    }
  }

  void AddGroupLine(const GroupType& type, BlockId group, line3D_t line_id) {
    const BlockId line = lines_.at(line_id);
    if (type.IsParallelism()) {
      auto& batch =
          BatchOf<VanishingPointResidual>("vp", {4, type.manifold->tangent}, {-1, type.code, 0},
                                          [&] { return VanishingPointResidual{&type}; });
      batch.Add(std::array{line, group}, {});
      return;
    }
    const Line3D& line3D = model_.lines3D.at(line_id);
    if (options_.group_form == StructureForm::k3d) {
      auto& batch = BatchOf<GroupLine3dResidual>("group_line_3d", {4, type.manifold->tangent},
                                                 {-1, type.code, 0},
                                                 [&] { return GroupLine3dResidual{&type}; });
      Use3dWeight(options_.group_3d_weight, &batch);
      const double* values = problem_.values(line);
      const Eigen::Map<const Eigen::Vector3d> d(values), p(values + 3);
      batch.Add(std::array{line, group}, {{d.dot(line3D.start - p), d.dot(line3D.end - p)}});
      return;
    }
    for (const LineObservation& observation : line3D.track) {
      const ImageBlocks& image = images_.at(observation.image_id);
      auto& batch = BatchOf<GroupLineResidual>(
          "group_line", {4, 6, image.model->num_params, type.manifold->tangent},
          {image.model->id, type.code, image.observations_move}, [&] {
            return GroupLineResidual{{image.model, image.observations_move}, &type};
          });
      batch.Add(std::array{line, image.pose, image.camera, group}, DatumOf(observation));
    }
  }

  static void Use3dWeight(double weight, ResidualBatch* batch) {
    batch->weight = weight;
    batch->loss.type =
        LossType::kTrivial;  // a loss scale in model units would be one more thing to tune
  }

  void AddRelations() {
    for (const Relation& relation : model_.relations) {
      if (filter_.groups.contains(relation.group3D_id1) ||
          filter_.groups.contains(relation.group3D_id2))
        continue;
      const GroupType* a = model_.groups3D.at(relation.group3D_id1).type;
      const GroupType* b = model_.groups3D.at(relation.group3D_id2).type;
      const std::array blocks{groups_.at(relation.group3D_id1), groups_.at(relation.group3D_id2)};
      const std::initializer_list<int> tangents{a->manifold->tangent, b->manifold->tangent};
      if (relation.type == RelationType::kOrthogonal) {
        BatchOf<OrthogonalResidual>("relation", tangents, {0, a->code, b->code}, [&] {
          return OrthogonalResidual{{a, b}};
        }).Add(blocks, {});
      } else {
        BatchOf<ParallelResidual>("relation", tangents, {1, a->code, b->code}, [&] {
          return ParallelResidual{{a, b}};
        }).Add(blocks, {});
      }
    }
  }

  void AddMeasurements(std::span<const GroupMeasurement> measurements) {
    for (const GroupMeasurement& measurement : measurements) {
      const ImageBlocks& image = images_.at(measurement.image_id);
      const GroupType* type = model_.groups3D.at(measurement.group3D_id).type;
      auto& batch = BatchOf<GroupMeasurementResidual>(
          "group_measurement", {type->manifold->tangent, 6}, {-1, type->code, 0},
          [&] { return GroupMeasurementResidual{type}; });
      batch.Add(std::array{groups_.at(measurement.group3D_id), image.pose},
                {measurement.direction_in_cam.normalized(), measurement.sigma_deg * M_PI / 180.0,
                 image.sensor});
    }
  }

  void AddWireframe() {
    for (const WireframeEdge& edge : model_.wireframe) {
      if (filter_.edges.contains({edge.point3D_id, edge.line3D_id})) continue;
      const BlockId point = PointBlock(edge.point3D_id), line = lines_.at(edge.line3D_id);
      if (options_.wireframe_form == StructureForm::k3d) {
        auto& batch = BatchOf<Wireframe3dResidual>("wireframe_3d", {3, 4}, {-1, -1, 0},
                                                   [] { return Wireframe3dResidual{}; });
        Use3dWeight(options_.wireframe_3d_weight, &batch);
        batch.Add(std::array{point, line}, {});
        continue;
      }
      const auto& point_track = model_.points3D.at(edge.point3D_id).track;
      const auto& line_track = model_.lines3D.at(edge.line3D_id).track;
      const auto observes = [](const auto& track, image_t image_id) {
        return std::any_of(track.begin(), track.end(),
                           [&](const auto& e) { return e.image_id == image_id; });
      };
      for (const LineObservation& observation : line_track) {
        if (observes(point_track, observation.image_id)) continue;
        const ImageBlocks& image = images_.at(observation.image_id);
        auto& batch = BatchOf<WireframePointResidual>(
            "wireframe_point", {3, 6, image.model->num_params},
            {image.model->id, -1, image.observations_move}, [&] {
              return WireframePointResidual{{image.model, image.observations_move}};
            });
        batch.Add(std::array{point, image.pose, image.camera}, DatumOf(observation));
      }
      for (const PointObservation& observation : point_track) {
        if (observes(line_track, observation.image_id)) continue;
        const ImageBlocks& image = images_.at(observation.image_id);
        auto& batch = BatchOf<WireframeLineResidual>(
            "wireframe_line", {4, 6, image.model->num_params},
            {image.model->id, -1, image.observations_move}, [&] {
              return WireframeLineResidual{{image.model, image.observations_move}};
            });
        const Eigen::Vector2d& xy = image.image->points2D[observation.point2D_idx].xy;
        batch.Add(std::array{line, image.pose, image.camera},
                  {IdealObservation(*image.model, image.params, xy), image.sensor});
      }
    }
  }

  void FixGauge() {
    if (options_.gauge == Gauge::kFree || options_.fix_poses || out_.poses.empty()) return;
    if (options_.fix_points && !out_.points.empty()) return;  // held points fix it
    problem_.block(out_.poses[0].second).constant = true;
    const auto has_baseline = [](const auto& sensor) { return sensor->translation.norm() > 0.0; };
    if (std::any_of(out_.sensor_poses.begin(), out_.sensor_poses.end(), has_baseline)) return;
    const Eigen::Vector3d origin = model_.frames.at(out_.poses[0].first).rig_from_world.OriginInA();
    double farthest = 0.0;
    BlockId second = out_.poses[0].second;
    int coordinate = 0;
    for (const auto& [frame_id, block] : out_.poses) {
      const Rigid3d& pose = model_.frames.at(frame_id).rig_from_world;
      // Scaling the scene about the first camera moves this translation along R (c - origin).
      const Eigen::Vector3d move = pose.RotationMatrix() * (pose.OriginInA() - origin);
      if (move.norm() <= farthest) continue;
      farthest = move.norm();
      second = block;
      move.cwiseAbs().maxCoeff(&coordinate);
    }
    if (farthest > 0.0) problem_.block(second).held |= uint32_t{1} << (3 + coordinate);
  }

  using BatchKey = std::tuple<int, std::string_view, std::tuple<int, int, int>, int>;

  const Reconstruction& model_;
  const BundleOptions& options_;
  const AssociationFilter& filter_;
  BundleProblem& out_;
  Problem& problem_;
  std::unordered_map<image_t, ImageBlocks> images_;
  std::unordered_map<line3D_t, BlockId> lines_;
  std::unordered_map<group3D_t, BlockId> groups_;
  std::map<BatchKey, std::unique_ptr<ResidualBatch>> batches_;
  int weight_halvings_ = 0;  // of the group whose members are being added
};

}  // namespace

BundleProblem BuildProblem(const Reconstruction& model, const BundleOptions& options,
                           std::span<const GroupMeasurement> measurements,
                           const AssociationFilter* filter) {
  BundleProblem bundle;
  const AssociationFilter none;
  Builder(model, options, filter ? *filter : none, &bundle).Build(measurements);
  return bundle;
}

}  // namespace holba
