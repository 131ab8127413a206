// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/ground_truth.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "holba/evaluation/group_comparison.h"
#include "holba/geometry/angle.h"
#include "holba/group/known_types.h"

namespace holba {
namespace {

Eigen::Vector3d Midpoint(const Line3D& line) {
  const Eigen::Vector3d middle = 0.5 * (line.start + line.end);
  return line.line.ClosestPoint(middle);
}

// Collects the errors of one model.
class Comparison {
 public:
  Comparison(const Reconstruction& model, const Reconstruction& truth, const ImagePairing& pairing,
             const Sim3d& sim)
      : model_(model), truth_(truth), pairing_(pairing), sim_(sim) {}

  GroundTruthErrors Run() {
    GroundTruthErrors errors;
    CompareCameras(&errors);
    if (pairing_.features_have_same_ids) {
      CompareFeatures(&errors);
      CompareGroups(&errors);
    }
    return errors;
  }

 private:
  void CompareCameras(GroundTruthErrors* errors) const {
    std::vector<double> rotations, positions;
    for (const auto& [id, image] : truth_.images) {
      const auto other = pairing_.model_id_of_truth.find(id);
      if (other == pairing_.model_id_of_truth.end()) continue;
      const Rigid3d pose = sim_.TransformPose(model_.images.at(other->second).cam_from_world);
      const Rigid3d error = pose * image.cam_from_world.Inverse();
      rotations.push_back(kDegPerRad * LogRotation(error.rotation).norm());
      positions.push_back((pose.OriginInA() - image.cam_from_world.OriginInA()).norm());
    }
    errors->rotation_deg = Summarise(rotations);
    errors->position = Summarise(positions);
  }

  void CompareFeatures(GroundTruthErrors* errors) const {
    std::vector<double> points, directions, distances;
    for (const auto& [id, point] : truth_.points3D) {
      const Point3D* other = model_.points3D.Find(id);
      if (other != nullptr) points.push_back((sim_ * other->xyz - point.xyz).norm());
    }
    for (const auto& [id, line] : truth_.lines3D) {
      const Line3D* other = model_.lines3D.Find(id);
      if (other == nullptr) continue;
      const PlueckerLine moved = Transform(sim_, other->line);
      directions.push_back(UnsignedAngleDeg(moved.direction, line.line.direction));
      distances.push_back(moved.Distance(Midpoint(line)));
    }
    errors->point = Summarise(points);
    errors->line_direction_deg = Summarise(directions);
    errors->line_distance = Summarise(distances);
  }

  void CompareGroups(GroundTruthErrors* errors) {
    std::vector<double> normals, offsets;
    for (const auto& [id, group] : truth_.groups3D) {
      const Group3D* other = model_.groups3D.Find(id);
      if (other == nullptr || other->type != group.type) continue;
      const auto moved = MoveGroup(*other, sim_);
      const auto exact = MoveGroup(group, Sim3d());
      if (!moved || !exact) continue;
      const auto named = ParameterErrors(*group.type, *moved, *exact, MemberPoints(truth_, group));
      if (IsPlane(*group.type)) {
        for (const auto& [name, error] : named) {
          (name == "offset" ? offsets : normals).push_back(error);
        }
        continue;
      }
      for (const auto& [name, error] : named) AddGroupError(*group.type, name, error);
      AddSurfaceErrors(group, *moved);
    }
    errors->plane_normal_deg = Summarise(normals);
    errors->plane_offset = Summarise(offsets);
    for (const auto& [name, values] : group_errors_) errors->groups[name] = *Summarise(values);
  }

  void AddGroupError(const GroupType& type, const std::string& quantity, double error) {
    group_errors_[std::string(type.name) + " " + quantity].push_back(error);
  }

  void AddSurfaceErrors(const Group3D& group, const MovedGroup& moved) {
    if (group.type->project_point == nullptr) return;
    for (const point3D_t id : group.point3D_ids) {
      const Eigen::Vector3d& X = truth_.points3D.at(id).xyz;
      Eigen::Vector3d projected;
      if (group.type->project_point(moved.memory.data(), X, &projected)) {
        AddGroupError(*group.type, "surface", (projected - X).norm());
      }
    }
  }

  const Reconstruction& model_;
  const Reconstruction& truth_;
  const ImagePairing& pairing_;
  const Sim3d sim_;
  std::map<std::string, std::vector<double>> group_errors_;
};

}  // namespace

GroundTruthErrors CompareToTruth(const Reconstruction& model, const Reconstruction& truth,
                                 const Sim3d& truth_from_model) {
  GroundTruthErrors errors =
      Comparison(model, truth, PairImages(model, truth), truth_from_model).Run();
  errors.alignment.truth_from_model = truth_from_model;
  return errors;
}

std::optional<GroundTruthErrors> CompareToTruth(const Reconstruction& model,
                                                const Reconstruction& truth, AlignmentBasis basis) {
  return CompareToTruth(model, truth, PairImages(model, truth), basis);
}

std::optional<GroundTruthErrors> CompareToTruth(const Reconstruction& model,
                                                const Reconstruction& truth,
                                                const ImagePairing& pairing, AlignmentBasis basis) {
  const std::optional<Alignment> alignment = AlignReconstructions(model, truth, pairing, basis);
  if (!alignment) return std::nullopt;
  GroundTruthErrors errors = Comparison(model, truth, pairing, alignment->truth_from_model).Run();
  errors.alignment = *alignment;
  return errors;
}

std::vector<std::pair<std::string, double>> GroundTruthErrors::Named() const {
  std::vector<std::pair<std::string, double>> named;
  const auto add = [&](std::string name, const std::optional<ErrorStats>& stats) {
    if (!stats) return;
    std::string unit;
    if (name.ends_with("_deg")) {
      unit = "_deg";
      name.resize(name.size() - unit.size());
    }
    named.emplace_back(name + "_rms" + unit, stats->rms);
    named.emplace_back(name + "_median" + unit, stats->median);
  };
  add("rotation_deg", rotation_deg);
  add("position", position);
  add("point", point);
  add("line_direction_deg", line_direction_deg);
  add("line_distance", line_distance);
  add("plane_normal_deg", plane_normal_deg);
  add("plane_offset", plane_offset);
  for (const auto& [name, stats] : groups) add(name, stats);
  return named;
}

}  // namespace holba
