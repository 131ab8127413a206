// SPDX-License-Identifier: BSD-3-Clause
// Gauges of a selection whose parts share nothing.
#include <algorithm>
#include <map>
#include <utility>

#include "holba/base/union_find.h"
#include "holba/bundle/bundle_options.h"
#include "holba/bundle/bundle_selection.h"
#include "holba/bundle/flat_index.h"
#include "holba/bundle/gauge.h"

namespace holba {
namespace {

// Joins the variable frames that see a variable feature, and through groups the frames that see
// their members. What is held joins nothing: it ties each part to itself.
class PartFinder {
 public:
  PartFinder(const Reconstruction& model, const BundleOptions& options,
             const BundleSelection& selection)
      : model_(model),
        options_(options),
        selection_(selection),
        num_frames_(static_cast<uint32_t>(selection.frames.size())),
        num_sets_(selection.frames.size()),
        sets_(selection.frames.size() + selection.groups.size()),
        sees_(selection.frames.size(), 0) {
    FlatIndex frame_idx(selection.frames.size());
    for (const auto& frame : selection.frames) {
      frame_idx.Add(frame.id);
      num_sets_ -= frame.constant;
    }
    for (const auto& [id, image] : ImagesOf(model, selection)) {
      image_idx_.Add(id);
      frame_of_image_.push_back(frame_idx.Find(image->frame_id));
    }
  }

  // The frames of each part, by their numbers in the selection; empty: there is one part at most.
  std::vector<std::vector<uint32_t>> Find() {
    if (num_sets_ < 2 || JoinByFeatures()) return {};
    if (options_.config >= BundleConfig::kGroups) JoinByGroups();
    if (options_.config >= BundleConfig::kHolistic) JoinByWireframe();
    std::map<uint32_t, std::vector<uint32_t>> of_root;
    std::vector<uint32_t> roots;  // in the order of the frames
    for (uint32_t frame = 0; frame < num_frames_; ++frame) {
      if (!sees_[frame]) continue;
      std::vector<uint32_t>& part = of_root[sets_.Root(frame)];
      if (part.empty()) roots.push_back(sets_.Root(frame));
      part.push_back(frame);
    }
    std::vector<std::vector<uint32_t>> parts;
    for (const uint32_t root : roots) parts.push_back(std::move(of_root[root]));
    if (parts.size() < 2) parts.clear();
    return parts;
  }

  // A variable frame that sees a feature; FlatIndex::kNone: none.
  template <typename Track>
  uint32_t FrameOf(const Track& track) const {
    for (const auto& observation : track) {
      const uint32_t image = image_idx_.Find(observation.image_id);
      if (image == FlatIndex::kNone) continue;
      if (!selection_.frames[frame_of_image_[image]].constant) return frame_of_image_[image];
    }
    return FlatIndex::kNone;
  }

 private:
  // True: all variable frames are one set, nothing is left to find.
  template <typename Track>
  bool Join(const Track& track) {
    uint32_t first = FlatIndex::kNone;
    for (const auto& observation : track) {
      const uint32_t image = image_idx_.Find(observation.image_id);
      if (image == FlatIndex::kNone) continue;
      const uint32_t frame = frame_of_image_[image];
      if (selection_.frames[frame].constant) continue;
      sees_[frame] = 1;
      if (first == FlatIndex::kNone) first = frame;
      if (sets_.Root(first) == sets_.Root(frame)) continue;
      sets_.Join(first, frame);
      if (--num_sets_ == 1) return true;
    }
    return false;
  }

  bool JoinByFeatures() {
    for (const auto& point : selection_.points) {
      if (!point.constant && Join(model_.points3D.at(point.id).track)) return true;
    }
    if (options_.config < BundleConfig::kPointLine) return false;
    for (const auto& line : selection_.lines) {
      if (!line.constant && Join(model_.lines3D.at(line.id).track)) return true;
    }
    return false;
  }

  // Two frames are joined through a group that both hold a member of, or through a relation.
  void JoinByGroups() {
    FlatIndex group_idx(selection_.groups.size());
    const auto join = [&](uint32_t group, uint32_t frame) {
      if (frame == FlatIndex::kNone) return;
      sets_.Join(num_frames_ + group, frame);
    };
    for (uint32_t g = 0; g < selection_.groups.size(); ++g) {
      const SelectedGroup& group = selection_.groups[g];
      group_idx.Add(group.id);
      if (group.constant) continue;
      for (const point3D_t id : group.point3D_ids) join(g, FrameOf(model_.points3D.at(id).track));
      for (const line3D_t id : group.line3D_ids) join(g, FrameOf(model_.lines3D.at(id).track));
    }
    for (const Relation& relation : selection_.relations) {
      const uint32_t first = group_idx.Find(relation.group3D_id1),
                     second = group_idx.Find(relation.group3D_id2);
      if (first == FlatIndex::kNone || second == FlatIndex::kNone) continue;
      if (selection_.groups[first].constant || selection_.groups[second].constant) continue;
      sets_.Join(num_frames_ + first, num_frames_ + second);
    }
  }

  void JoinByWireframe() {
    for (const WireframeEdge& edge : selection_.wireframe) {
      const uint32_t first = FrameOf(model_.points3D.at(edge.point3D_id).track),
                     second = FrameOf(model_.lines3D.at(edge.line3D_id).track);
      if (first != FlatIndex::kNone && second != FlatIndex::kNone) sets_.Join(first, second);
    }
  }

  const Reconstruction& model_;
  const BundleOptions& options_;
  const BundleSelection& selection_;
  const uint32_t num_frames_;
  size_t num_sets_;
  UnionFind sets_;  // of the frames, then of the groups
  std::vector<char> sees_;
  FlatIndex image_idx_;
  std::vector<uint32_t> frame_of_image_;
};

// The part with all that is held: what is not of the part ties nothing of it.
BundleSelection PartOf(const Reconstruction& model, const BundleSelection& selection,
                       const std::vector<uint32_t>& frames, const PartFinder& finder) {
  std::vector<char> is_of_part(selection.frames.size(), 0);
  for (const uint32_t frame : frames) is_of_part[frame] = 1;
  const auto is_elsewhere = [&](const auto& track) {
    const uint32_t frame = finder.FrameOf(track);
    return frame == FlatIndex::kNone || !is_of_part[frame];
  };
  BundleSelection part = selection;
  part.frames.clear();
  for (uint32_t i = 0; i < selection.frames.size(); ++i) {
    if (is_of_part[i] || selection.frames[i].constant) part.frames.push_back(selection.frames[i]);
  }
  std::erase_if(part.points, [&](const auto& point) {
    return !point.constant && is_elsewhere(model.points3D.at(point.id).track);
  });
  std::erase_if(part.lines, [&](const auto& line) {
    return !line.constant && is_elsewhere(model.lines3D.at(line.id).track);
  });
  return part;
}

std::vector<rig_t> RigsWithVariableSensors(const Reconstruction& model,
                                           const BundleSelection& selection) {
  std::vector<rig_t> rigs;
  if (selection.sensors.empty()) return rigs;
  FlatIndex of_frames;
  for (const auto& frame : selection.frames) {
    if (!frame.constant) of_frames.Add(model.frames.at(frame.id).rig_id);
  }
  for (const SelectedSensor& sensor : selection.sensors) {
    if (!sensor.constant && of_frames.contains(sensor.rig_id)) rigs.push_back(sensor.rig_id);
  }
  return rigs;
}

}  // namespace

std::vector<FixedGauge> ChooseGaugesOfParts(const Reconstruction& model,
                                            const BundleOptions& options,
                                            const BundleSelection& selection) {
  if (options.gauge == Gauge::kFree || !selection.HasVariableFrame())
    return std::vector<FixedGauge>(1);
  PartFinder finder(model, options, selection);
  const std::vector<std::vector<uint32_t>> parts = finder.Find();
  if (parts.empty()) return {ChooseGauge(model, options, selection)};
  std::vector<FixedGauge> gauges;
  FlatIndex rigs_with_scale;  // whose sensors are adjusted, of the parts so far
  for (const auto& frames : parts) {
    const BundleSelection part = PartOf(model, selection, frames, finder);
    const std::vector<rig_t> rigs = RigsWithVariableSensors(model, part);
    const bool scale_is_known = std::any_of(
        rigs.begin(), rigs.end(), [&](rig_t rig) { return rigs_with_scale.contains(rig); });
    gauges.push_back(ChooseGauge(model, options, part, scale_is_known));
    for (const rig_t rig : rigs) rigs_with_scale.Add(rig);
  }
  for (const FixedGauge& gauge : gauges) gauges.front().needs_structure |= gauge.needs_structure;
  return gauges;
}

}  // namespace holba
