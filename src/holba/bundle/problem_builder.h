// SPDX-License-Identifier: BSD-3-Clause
// Builds one problem. Each Add* is one kind of block or term; build_cameras.cc, build_features.cc,
// build_groups.cc and build_wireframe.cc hold them. Used by BuildProblem only.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "holba/bundle/bundle_problem.h"
#include "holba/bundle/flat_index.h"
#include "holba/bundle/losses.h"
#include "holba/residual/line.h"
#include "holba/residual/point.h"
#include "holba/residual/with_sensor_pose.h"

namespace holba {

class ProblemBuilder {
 public:
  ProblemBuilder(const Reconstruction& model, const BundleOptions& options,
                 const BundleSelection& selection, const AssociationFilter& filter,
                 BundleProblem* out)
      : model_(model),
        options_(options),
        selection_(selection),
        filter_(filter),
        out_(*out),
        problem_(out->problem) {}

  void Build(std::span<const GroupMeasurement> measurements);

 private:
  // What a residual needs of an image.
  struct ImageBlocks {
    image_t image_id;
    BlockId pose, camera;
    BlockId sensor_block;      // kNoBlock: the pose of its sensor is held
    const SensorPose* sensor;  // null: the reference, or one with a block
    const CameraModel* model;
    const double* params;
    bool observations_move;
    const Image* image;
    // Of its camera model, once there is one.
    KernelBatch<PointResidual>* points = nullptr;
    KernelBatch<PointResidual>* structure_points = nullptr;
  };
  // A feature that takes part.
  template <typename Record>
  struct Feature {
    BlockId block;
    const Record* record;
  };

  // build_cameras.cc
  void AddPosesAndCameras();
  BlockId AddPoseBlock(std::string_view kind, BlockRole role, const Rigid3d& pose);
  BlockId AddSensorBlock(const Frame& frame, const Image& image);
  const SensorPose* AddSensorPose(const Frame& frame, const Image& image);
  void HoldIntrinsics(const CameraModel& model, bool constant, ParameterBlock* block) const;
  void HoldGauge();
  void AddPriors();
  // build_features.cc
  void AddPoints();
  size_t NumPointObservations() const;
  void AddLines();
  bool LinesAreKept() const;
  SegmentDatum DatumOf(const ImageBlocks& image, const LineObservation& observation) const;
  // build_groups.cc
  void AddGroups();
  void AddGroupTerms();
  void AddGroupPoint(const GroupType& type, BlockId group, const Feature<Point3D>& point);
  void AddGroupLine(const GroupType& type, BlockId group, const Feature<Line3D>& line);
  void AddRelations();
  void AddMeasurements(std::span<const GroupMeasurement> measurements);
  // build_wireframe.cc
  void AddWireframe();
  void AddEdge3d(const Feature<Point3D>& point, const Feature<Line3D>& line);
  void AddEdge2d(const Feature<Point3D>& point, const Feature<Line3D>& line);

  // Null: the image takes no part.
  ImageBlocks* ImageOf(image_t id) {
    const uint32_t idx = image_idx_.Find(id);
    return idx == FlatIndex::kNone ? nullptr : &images_[idx];
  }
  // Null: the feature takes no part.
  const Feature<Point3D>* PointOf(point3D_t id) const {
    const uint32_t idx = point_idx_.Find(id);
    return idx == FlatIndex::kNone ? nullptr : &points_[idx];
  }
  const Feature<Line3D>* LineOf(line3D_t id) const {
    const uint32_t idx = line_idx_.Find(id);
    return idx == FlatIndex::kNone ? nullptr : &lines_[idx];
  }

  // Calls visit(image, observation) for the observations of a track in the images that take part.
  template <typename Track, typename Visitor>
  void ForEachObservation(const Track& track, const Visitor& visit) {
    for (const auto& observation : track) {
      if (ImageBlocks* image = ImageOf(observation.image_id)) visit(*image, observation);
    }
  }
  // What is known, or what the images say something about.
  template <typename Track>
  bool TakesPart(bool constant, const Track& track) const {
    return constant || SeenInTwoImages(track, image_idx_);
  }

  // One batch for each (term, camera model, group type, whether observations move), each weight
  // (weight_halvings_) and whether the poses of sensors are blocks: its kernel is made on first
  // use.
  template <typename Kernel, typename MakeKernel>
  KernelBatch<Kernel>& BatchOf(std::string_view term, std::vector<int> tangents,
                               std::tuple<int, int, int> key, const MakeKernel& make,
                               bool with_sensor = false) {
    const TermFamily family = FamilyOf(term);
    std::unique_ptr<ResidualBatch>& batch =
        batches_[{static_cast<int>(family), term, key, weight_halvings_, with_sensor}];
    if (!batch) {
      auto made = std::make_unique<KernelBatch<Kernel>>(std::string(term), Kernel::kDim,
                                                        std::move(tangents), make());
      made->loss = ToLoss(options_[family]);
      made->weight = std::ldexp(options_[family].weight, -weight_halvings_);
      made->angular = IsAngular(family);
      batch = std::move(made);
    }
    return static_cast<KernelBatch<Kernel>&>(*batch);
  }
  // A batch of BatchOf.
  template <typename Kernel>
  struct BatchOfKernel {
    std::string_view term;
    std::vector<int> tangents;
    std::tuple<int, int, int> key;
    Kernel kernel;
  };
  // Adds residuals to the batches of their images. The batch of the last image serves the next one,
  // too, if their cameras are of one model: most observations need no look-up.
  template <typename Kernel>
  class BatchOfImages {
   public:
    explicit BatchOfImages(ProblemBuilder* builder) : builder_(*builder) {}

    // Blocks but that of the sensor; of(): the BatchOfKernel of the image.
    template <size_t kNumSlots, typename Of>
    void Add(const ImageBlocks& image, const std::array<BlockId, kNumSlots>& blocks,
             const typename Kernel::Datum& datum, const Of& of) {
      static_assert(kNumSlots == Kernel::kNumSlots);
      if (image.sensor_block != kNoBlock) {
        std::array<BlockId, kNumSlots + 1> with_sensor;
        std::copy(blocks.begin(), blocks.end(), with_sensor.begin());
        with_sensor[kNumSlots] = image.sensor_block;
        WithSensor(of()).Add(with_sensor, datum);
        return;
      }
      if (batch_ == nullptr || image.model != model_ || image.observations_move != moves_) {
        model_ = image.model;
        moves_ = image.observations_move;
        const BatchOfKernel<Kernel> batch = of();
        batch_ = &builder_.BatchOf<Kernel>(batch.term, batch.tangents, batch.key,
                                           [&] { return batch.kernel; });
      }
      batch_->Add(blocks, datum);
    }

   private:
    KernelBatch<WithSensorPose<Kernel>>& WithSensor(BatchOfKernel<Kernel> batch) {
      batch.tangents.push_back(PoseManifold::kTangent);
      return builder_.BatchOf<WithSensorPose<Kernel>>(
          batch.term, batch.tangents, batch.key,
          [&] { return WithSensorPose<Kernel>{batch.kernel}; }, true);
    }

    ProblemBuilder& builder_;
    const CameraModel* model_ = nullptr;
    bool moves_ = false;
    KernelBatch<Kernel>* batch_ = nullptr;
  };

  static void Use3dWeight(double weight, ResidualBatch* batch) {
    batch->weight = weight;
    batch->loss.type =
        LossType::kTrivial;  // a loss scale in model units would be one more thing to tune
  }

  static constexpr BlockId kNoBlock = ~BlockId{0};
  using BatchKey = std::tuple<int, std::string_view, std::tuple<int, int, int>, int, bool>;

  const Reconstruction& model_;
  const BundleOptions& options_;
  const BundleSelection& selection_;
  const AssociationFilter& filter_;
  BundleProblem& out_;
  Problem& problem_;
  // By the numbers of the indices.
  FlatIndex image_idx_, point_idx_, line_idx_, group_idx_, sensor_idx_;
  FlatIndex variable_sensor_idx_;       // of selection_.sensors
  std::vector<BlockId> sensor_blocks_;  // by its numbers
  std::vector<ImageBlocks> images_;
  std::vector<Feature<Point3D>> points_;
  std::vector<Feature<Line3D>> lines_;
  std::vector<Feature<Group3D>> groups_;
  std::map<BatchKey, std::unique_ptr<ResidualBatch>> batches_;
  int weight_halvings_ = 0;  // of the group whose members are being added
};

}  // namespace holba
