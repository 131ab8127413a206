// SPDX-License-Identifier: BSD-3-Clause
// The values that an adjustment of a selection may change, to take it back. Costs what the
// selection costs.
#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "holba/bundle/bundle_selection.h"
#include "holba/scene/reconstruction.h"

namespace holba {

class SelectionBackup {
 public:
  SelectionBackup(const Reconstruction& model, const BundleSelection& selection) {
    for (const auto& frame : selection.frames)
      frames_.emplace_back(frame.id, model.frames.at(frame.id).rig_from_world);
    for (const auto& camera : selection.cameras)
      cameras_.emplace_back(camera.id, model.cameras.at(camera.id).params);
    for (const auto& frame : selection.frames) {
      const rig_t rig_id = model.frames.at(frame.id).rig_id;
      if (rigs_.empty() || rigs_.back().first != rig_id)
        rigs_.emplace_back(rig_id, model.rigs.at(rig_id));
    }
    for (const auto& point : selection.points)
      points_.emplace_back(point.id, model.points3D.at(point.id).xyz);
    for (const auto& line : selection.lines) {
      const Line3D& record = model.lines3D.at(line.id);
      lines_.push_back({line.id, record.line, record.start, record.end});
    }
    for (const auto& group : selection.groups)
      groups_.emplace_back(group.id, model.groups3D.at(group.id).params);
  }

  void Restore(Reconstruction* model) const {
    for (const auto& [id, rig] : rigs_) model->rigs.at(id) = rig;
    for (const auto& [id, pose] : frames_) model->SetFramePose(id, pose);
    for (const auto& [id, params] : cameras_) model->cameras.at(id).params = params;
    for (const auto& [id, xyz] : points_) model->points3D.at(id).xyz = xyz;
    for (const LineGeometry& line : lines_) {
      Line3D& record = model->lines3D.at(line.id);
      record.line = line.line;
      record.start = line.start;
      record.end = line.end;
    }
    for (const auto& [id, params] : groups_) model->groups3D.at(id).params = params;
  }

 private:
  struct LineGeometry {
    line3D_t id;
    PlueckerLine line;
    Eigen::Vector3d start, end;
  };
  std::vector<std::pair<rig_t, Rig>> rigs_;
  std::vector<std::pair<frame_t, Rigid3d>> frames_;
  std::vector<std::pair<camera_t, std::vector<double>>> cameras_;
  std::vector<std::pair<point3D_t, Eigen::Vector3d>> points_;
  std::vector<LineGeometry> lines_;
  std::vector<std::pair<group3D_t, std::vector<double>>> groups_;
};

}  // namespace holba
