// SPDX-License-Identifier: BSD-3-Clause
// What the mapper knows while it works: the model that grows, the graph of matches it grows along,
// what has been tried, and what changed since it was last looked at. Stages change the model
// through the verbs here, which are Reconstruction's with the book-keeping.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "holba/scene/correspondence_graph.h"
#include "holba/scene/ideal_view.h"
#include "holba/scene/mapping_input.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// How well an image without a pose sees the model.
struct ImageVisibility {
  size_t num_points = 0;  // keypoints with a match that has a 3D point
  size_t num_lines = 0;   // segments with a match that has a 3D line
  // COLMAP's pyramid: the more, and the more evenly spread over the image, the greater.
  size_t score = 0;
};

class MapperState {
 public:
  // `scene`: cameras, rigs, frames, and all images of the graph with their keypoints as points2D
  // and their segments as lines2D; those with poses are the start. The input must outlive the
  // state.
  MapperState(const MappingInput& input, Reconstruction scene);

  const MappingInput& input() const { return *input_; }
  const CorrespondenceGraph& graph() const { return input_->graph; }
  const Reconstruction& model() const { return model_; }
  // For adjustments and what else changes values only.
  Reconstruction* mutable_model() { return &model_; }

  // --- Verbs.
  void RegisterFrame(frame_t frame_id, const Rigid3d& rig_from_world);
  // With its observations.
  void DeregisterFrame(frame_t frame_id);
  point3D_t AddPoint(const Eigen::Vector3d& xyz, std::span<const PointObservation> track);
  void Observe(point3D_t point3D_id, const PointObservation& observation);
  // A point with fewer than two observations left goes; false then.
  bool Forget(const PointObservation& observation);
  void DeletePoint(point3D_t point3D_id);
  void MergePoints(point3D_t id, point3D_t other);
  line3D_t AddLine(const PlueckerLine& line, const Eigen::Vector3d& start,
                   const Eigen::Vector3d& end, std::span<const LineObservation> track);
  void Observe(line3D_t line3D_id, const LineObservation& observation);
  bool Forget(const LineObservation& observation);
  void DeleteLine(line3D_t line3D_id);
  void MergeLines(line3D_t id, line3D_t other);

  // The same model with other cameras and values.
  void TakeCameras(Reconstruction model);

  // --- Points whose tracks changed since they were last taken, ascending; some may be gone.
  std::vector<point3D_t> TakeModifiedPoints();

  // --- Snapshots (snapshot_archive.h): all that decides how a run goes on.
  template <typename Archive>
  void Visit(Archive* archive) {
    (*archive)(model_, modified_points_, num_registration_trials, registration_failures,
               num_initial_trials, tried_initial_pairs, failed_initial_pairs, num_retriangulations,
               images_of_earlier_models, existing_frames, given_params, line_merges_tried,
               contradicted);
    if constexpr (Archive::kReads) ForgetCounts();
  }
  // Gives up what the model keeps beside its records and makes anew when it is asked for: a run
  // that goes on is then where one that reads its snapshot is, also in the order of associations.
  void RenewIndices() { model_ = Reconstruction(model_); }

  // --- Visibility of an image without a pose; counted anew only where something changed in images
  // that it has matches with.
  const ImageVisibility& VisibilityOf(image_t image_id);

  // Images of the frame of an image, registered or not.
  std::vector<image_t> ImagesOfFrame(image_t image_id) const;
  bool IsFocalLengthKnown(camera_t camera_id) const;
  // Number of registered images of a camera.
  size_t NumRegistered(camera_t camera_id) const;

  // --- What has been tried; stages keep it. A new field joins Visit's list.
  std::map<image_t, int> num_registration_trials;        // failed ones
  std::map<image_t, std::string> registration_failures;  // why the last one failed
  std::map<image_t, int> num_initial_trials;             // as first image
  std::set<ImagePair> tried_initial_pairs;
  std::set<ImagePair> failed_initial_pairs;  // models that began with them came to nothing
  std::map<ImagePair, int> num_retriangulations;
  // Pairs of lines that are not one, by the joint length of their tracks then.
  std::map<std::pair<line3D_t, line3D_t>, size_t> line_merges_tried;
  // Lost their pose because matches are missing (contradictions.h).
  std::set<image_t> contradicted;
  std::set<image_t> images_of_earlier_models;
  std::set<frame_t> existing_frames;  // came with poses
  // Parameters of the cameras as they were given: where an image that was registered goes again.
  std::map<camera_t, std::vector<double>> given_params;

 private:
  void ForgetCounts();           // they are made anew from the model
  void Touch(image_t image_id);  // its features became, or are no longer, seen in 3D
  void TouchTrack(const Point3D& point);
  void TouchTrack(const Line3D& line);
  ImageVisibility Count(image_t image_id) const;

  const MappingInput* input_;
  Reconstruction model_;
  std::set<point3D_t> modified_points_;
  std::unordered_map<image_t, ImageVisibility> visibility_;
  std::unordered_set<image_t> touched_;  // since visibility was last asked for
  std::unordered_set<image_t> stale_;    // visibility to be counted anew
  std::unordered_map<camera_t, size_t> num_registered_;
};

// Views of registered images, made when asked for; valid as long as no pose or camera changes.
class ViewCache {
 public:
  explicit ViewCache(const Reconstruction& model) : model_(model) {}
  const IdealView& Of(image_t image_id) {
    const auto found = views_.find(image_id);
    if (found != views_.end()) return found->second;
    return views_.emplace(image_id, IdealView(model_, image_id)).first->second;
  }

 private:
  const Reconstruction& model_;
  std::unordered_map<image_t, IdealView> views_;  // references stay valid
};

}  // namespace holba
