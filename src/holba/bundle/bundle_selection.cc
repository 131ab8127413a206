// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/bundle_selection.h"

#include <algorithm>
#include <bit>
#include <iterator>
#include <optional>
#include <tuple>
#include <utility>

#include "holba/bundle/bundle_options.h"
#include "holba/bundle/flat_index.h"

namespace holba {
namespace {

// Calls visit(image id, image) for each image of a frame that the model holds.
template <typename Visitor>
void ForEachImage(const Reconstruction& model, frame_t frame_id, const Visitor& visit) {
  for (const Frame::Data& data : model.frames.at(frame_id).data) {
    if (data.sensor.type != SensorType::kCamera || data.data_id >= kInvalidId32) continue;
    const image_t image_id = static_cast<image_t>(data.data_id);
    if (const Image* image = model.images.Find(image_id)) visit(image_id, *image);
  }
}

// Equations that an intrinsic parameter needs, beyond those that the poses take up.
constexpr size_t kMinEquationsPerIntrinsic = 5;

bool HoldsCameras(const BundleOptions& options) {
  return !options.refine_focal_length && !options.refine_principal_point &&
         !options.refine_extra_params;
}

// All features but some of them, which stand in the order of the model.
template <typename Id, typename T>
void SelectOthers(const IdMap<Id, T>& features, const std::vector<SeenOnce<Id>>& left_out,
                  bool constant, std::vector<Selected<Id>>* selected) {
  selected->reserve(features.size() - left_out.size());
  auto next = left_out.begin();
  for (const auto& [id, feature] : features) {
    if (next != left_out.end() && next->id == id) {
      ++next;
    } else {
      selected->push_back({id, constant});
    }
  }
}

// Selects the part around some frames; each Add* is one kind of element.
class AroundSelector {
 public:
  AroundSelector(const Reconstruction& model, const BundleOptions& options,
                 const AroundOptions& around)
      : model_(model), options_(options), around_(around) {}

  BundleSelection Select(std::span<const image_t> image_ids) {
    for (const image_t id : image_ids) AddFrame(model_.images.at(id).frame_id, options_.fix_poses);
    const std::vector<const Image*> centre = images_;
    auto points = SeenBy(centre, &Image::points2D, &Point2D::point3D_id, model_.points3D);
    decltype(SeenBy(centre, &Image::lines2D, &Line2D::line3D_id, model_.lines3D)) lines;
    if (options_.config >= BundleConfig::kPointLine)
      lines = SeenBy(centre, &Image::lines2D, &Line2D::line3D_id, model_.lines3D);
    if (around_.surroundings) {
      AddSurroundings(points);
      AddSurroundings(lines);
    }
    AddFeatures(&points, options_.fix_points, &result_.points);
    AddFeatures(&lines, options_.fix_lines, &result_.lines);
    if (options_.config >= BundleConfig::kGroups) AddGroups();
    if (options_.config >= BundleConfig::kHolistic) AddWireframe();
    if (!around_.hold_cameras) SelectSensors(model_, options_, &result_);
    result_.SetGauges(ChooseGaugesOfParts(model_, options_, result_));
    return std::move(result_);
  }

 private:
  void AddFrame(frame_t frame_id, bool constant) {
    if (!frame_idx_.Add(frame_id).second) return;
    result_.frames.push_back({frame_id, constant});
    ForEachImage(model_, frame_id, [&](image_t image_id, const Image& image) {
      image_idx_.Add(image_id);
      images_.push_back(&image);
      if (camera_idx_.Add(image.camera_id).second) {
        result_.cameras.push_back(
            {image.camera_id, around_.hold_cameras || HoldsCameras(options_)});
      }
    });
  }

  // A 3D feature that some images see.
  template <typename Record>
  struct Seen {
    uint32_t position;  // in the order of the model
    uint64_t id;
    const Record* record;
  };

  // Each once.
  template <typename Feature2D, typename Record>
  std::vector<Seen<Record>> SeenBy(const std::vector<const Image*>& images,
                                   std::vector<Feature2D> Image::*features,
                                   uint64_t Feature2D::*feature_id,
                                   const IdMap<uint64_t, Record>& records) const {
    std::vector<Seen<Record>> seen;
    FlatIndex known;
    for (const Image* image : images) {
      for (const Feature2D& feature : image->*features) {
        const uint64_t id = feature.*feature_id;
        if (id != kNoId && known.Add(id).second) seen.push_back({0, id, nullptr});
      }
    }
    // Records are far from each other in a large model. Here none waits for the one before, so that
    // the memory is read for many at a time; their tracks are on the way when they are looked at.
    for (Seen<Record>& feature : seen) {
      const Record& record = records.at(feature.id);
      feature.record = &record;
      feature.position = static_cast<uint32_t>(records.IndexOf(feature.id));
      __builtin_prefetch(record.track.data());
    }
    return seen;
  }

  template <typename Record>
  void AddSurroundings(const std::vector<Seen<Record>>& seen) {
    for (const Seen<Record>& feature : seen) {
      for (const auto& observation : feature.record->track) {
        if (!image_idx_.contains(observation.image_id))
          AddFrame(model_.images.at(observation.image_id).frame_id, true);
      }
    }
  }

  // Those that two images of the selection see.
  template <typename Record, typename Id>
  void AddFeatures(std::vector<Seen<Record>>* seen, bool constant,
                   std::vector<Selected<Id>>* selected) const {
    std::erase_if(*seen,
                  [&](const auto& feature) { return !SeenInTwoImages(feature.record->track, image_idx_); });
    std::sort(seen->begin(), seen->end(),
              [](const auto& a, const auto& b) { return a.position < b.position; });
    selected->reserve(seen->size());
    for (const auto& feature : *seen) selected->push_back({feature.id, constant});
  }

  void AddGroups() {
    FlatIndex point_idx(result_.points.size()), line_idx(result_.lines.size()), group_idx;
    std::vector<std::pair<size_t, group3D_t>> groups;
    const auto add = [&](uint64_t feature, std::span<const group3D_t> of_feature, FlatIndex* idx) {
      idx->Add(feature);
      for (const group3D_t id : of_feature) {
        if (group_idx.Add(id).second) groups.emplace_back(model_.groups3D.IndexOf(id), id);
      }
    };
    for (const auto& point : result_.points)
      add(point.id, model_.GroupsOfPoint(point.id), &point_idx);
    for (const auto& line : result_.lines) add(line.id, model_.GroupsOfLine(line.id), &line_idx);
    std::sort(groups.begin(), groups.end());
    for (const auto& [position, id] : groups) {
      const Group3D& group = model_.groups3D.at(id);
      SelectedGroup& selected = result_.groups.emplace_back();
      selected.id = id;
      std::copy_if(group.point3D_ids.begin(), group.point3D_ids.end(),
                   std::back_inserter(selected.point3D_ids),
                   [&](point3D_t member) { return point_idx.contains(member); });
      std::copy_if(group.line3D_ids.begin(), group.line3D_ids.end(),
                   std::back_inserter(selected.line3D_ids),
                   [&](line3D_t member) { return line_idx.contains(member); });
      selected.constant = options_.fix_groups || selected.point3D_ids != group.point3D_ids ||
                          selected.line3D_ids != group.line3D_ids;
    }
    std::copy_if(model_.relations.begin(), model_.relations.end(),
                 std::back_inserter(result_.relations), [&](const Relation& relation) {
                   return group_idx.contains(relation.group3D_id1) &&
                          group_idx.contains(relation.group3D_id2);
                 });
  }

  void AddWireframe() {
    FlatIndex line_idx(result_.lines.size());
    for (const auto& line : result_.lines) line_idx.Add(line.id);
    std::vector<size_t> edges;
    for (const auto& point : result_.points) {
      for (const line3D_t line : model_.LinesThrough(point.id)) {
        if (line_idx.contains(line)) edges.push_back(*model_.PositionOfEdge(point.id, line));
      }
    }
    std::sort(edges.begin(), edges.end());
    for (const size_t position : edges) result_.wireframe.push_back(model_.wireframe[position]);
  }

  const Reconstruction& model_;
  const BundleOptions& options_;
  const AroundOptions& around_;
  BundleSelection result_;
  FlatIndex frame_idx_, image_idx_, camera_idx_;
  std::vector<const Image*> images_;
};

BundleSelection EverythingWithoutGauge(const Reconstruction& model, const BundleOptions& options) {
  BundleSelection all;
  FlatIndex frame_idx(model.frames.size());
  for (const auto& [id, image] : model.images) {
    if (frame_idx.Add(image.frame_id).second)
      all.frames.push_back({image.frame_id, options.fix_poses});
  }
  for (const auto& [id, camera] : model.cameras) all.cameras.push_back({id, HoldsCameras(options)});
  // What is held is known, and says something about each camera that sees it.
  if (!options.fix_points) all.points_seen_once = PointsSeenOnce(model);
  if (!options.fix_lines) all.lines_seen_once = LinesSeenOnce(model);
  SelectOthers(model.points3D, all.points_seen_once, options.fix_points, &all.points);
  SelectOthers(model.lines3D, all.lines_seen_once, options.fix_lines, &all.lines);
  all.groups.reserve(model.groups3D.size());
  for (const auto& [id, group] : model.groups3D)
    all.groups.push_back({id, options.fix_groups, group.point3D_ids, group.line3D_ids});
  all.wireframe = model.wireframe;
  all.relations = model.relations;
  return all;
}

}  // namespace

BundleSelection BundleSelection::Everything(const Reconstruction& model,
                                            const BundleOptions& options) {
  BundleSelection all = EverythingWithoutGauge(model, options);
  SelectSensors(model, options, &all);
  all.SetGauges(ChooseGaugesOfParts(model, options, all));
  return all;
}

BundleSelection BundleSelection::OfFeatures(const Reconstruction& model,
                                            const BundleOptions& options,
                                            const std::function<bool(point3D_t)>& keep_point,
                                            const std::function<bool(line3D_t)>& keep_line,
                                            size_t min_members) {
  BundleSelection part = EverythingWithoutGauge(model, options);
  std::erase_if(part.points, [&](const auto& point) { return !keep_point(point.id); });
  std::erase_if(part.lines, [&](const auto& line) { return !keep_line(line.id); });
  std::erase_if(part.groups, [&](SelectedGroup& group) {
    std::erase_if(group.point3D_ids, [&](point3D_t id) { return !keep_point(id); });
    std::erase_if(group.line3D_ids, [&](line3D_t id) { return !keep_line(id); });
    return group.point3D_ids.size() + group.line3D_ids.size() < min_members;
  });
  FlatIndex group_idx(part.groups.size());
  for (const SelectedGroup& group : part.groups) group_idx.Add(group.id);
  std::erase_if(part.relations, [&](const Relation& relation) {
    return !group_idx.contains(relation.group3D_id1) || !group_idx.contains(relation.group3D_id2);
  });
  std::erase_if(part.wireframe, [&](const WireframeEdge& edge) {
    return !keep_point(edge.point3D_id) || !keep_line(edge.line3D_id);
  });
  std::erase_if(part.points_seen_once, [&](const auto& point) { return !keep_point(point.id); });
  std::erase_if(part.lines_seen_once, [&](const auto& line) { return !keep_line(line.id); });
  SelectSensors(model, options, &part);
  part.SetGauges(ChooseGaugesOfParts(model, options, part));
  return part;
}

BundleSelection BundleSelection::Around(const Reconstruction& model, const BundleOptions& options,
                                        std::span<const image_t> image_ids,
                                        const AroundOptions& around) {
  return AroundSelector(model, options, around).Select(image_ids);
}

void BundleSelection::HoldCameras() {
  for (auto& frame : frames) frame.constant = true;
  for (auto& camera : cameras) camera.constant = true;
  for (auto& sensor : sensors) sensor.constant = true;
  SetGauges(std::vector<FixedGauge>(1));
}

void BundleSelection::SetGauges(std::vector<FixedGauge> gauges) {
  gauge = gauges.front();
  gauges.erase(gauges.begin());
  gauges_of_other_parts = std::move(gauges);
}

std::vector<HeldIntrinsics> BundleSelection::HoldUncertainIntrinsics(const Reconstruction& model,
                                                                     const BundleOptions& options) {
  // Two equations each; those beyond the six unknowns of a pose are left for the intrinsics.
  struct Count {
    size_t observations = 0, equations = 0, needed = 0;
  };
  FlatIndex camera_idx, frame_idx, image_idx;
  std::vector<Count> of_camera;
  for (const auto& camera : cameras) {
    camera_idx.Add(camera.id);
    const int free = std::popcount(FreeIntrinsics(*model.cameras.at(camera.id).model, options));
    of_camera.push_back({0, 0, camera.constant ? 0 : kMinEquationsPerIntrinsic * free});
  }
  size_t num_open = std::count_if(of_camera.begin(), of_camera.end(),
                                  [](const Count& count) { return count.needed > 0; });
  if (num_open == 0) return {};
  struct View {
    uint32_t camera;
    size_t unknowns;  // of its pose that no equation has been counted for
  };
  std::vector<View> views;
  for (const auto& frame : frames) frame_idx.Add(frame.id);
  for (const auto& [id, image] : ImagesOf(model, *this)) {
    image_idx.Add(id);
    const bool is_held = frames[frame_idx.Find(image->frame_id)].constant;
    views.push_back({camera_idx.Find(image->camera_id), is_held ? size_t{0} : size_t{6}});
  }
  // Stops where all cameras have enough: after a small part of the observations.
  const auto count = [&](const auto& track) {
    for (const auto& observation : track) {
      const uint32_t idx = image_idx.Find(observation.image_id);
      if (idx == FlatIndex::kNone || views[idx].camera == FlatIndex::kNone) continue;
      Count& camera = of_camera[views[idx].camera];
      ++camera.observations;
      const size_t for_pose = std::min<size_t>(2, views[idx].unknowns);
      views[idx].unknowns -= for_pose;
      const bool had_enough = camera.equations >= camera.needed;
      camera.equations += 2 - for_pose;
      if (!had_enough && camera.equations >= camera.needed) --num_open;
    }
    return num_open > 0;
  };
  bool go_on = true;
  for (size_t i = 0; go_on && i < points.size(); ++i)
    go_on = count(model.points3D.at(points[i].id).track);
  if (options.config >= BundleConfig::kPointLine) {
    for (size_t i = 0; go_on && i < lines.size(); ++i)
      go_on = count(model.lines3D.at(lines[i].id).track);
  }
  std::vector<HeldIntrinsics> held;
  if (!go_on) return held;
  for (size_t i = 0; i < cameras.size(); ++i) {
    const Count& counted = of_camera[i];
    // Without any, nothing moves them.
    if (counted.equations >= counted.needed || counted.observations == 0) continue;
    cameras[i].constant = true;
    held.push_back({cameras[i].id, counted.observations});
  }
  return held;
}

void BundleSelection::HoldPoints() {
  for (auto& point : points) point.constant = true;
}

void BundleSelection::HoldLines() {
  for (auto& line : lines) line.constant = true;
}

bool BundleSelection::HasVariableFrame() const {
  return std::any_of(frames.begin(), frames.end(), [](const auto& f) { return !f.constant; });
}

BundleSelection WithoutPointsOfStructure(const Reconstruction& model, BundleSelection selection) {
  std::erase_if(selection.points, [&](const auto& point) {
    return IsOfStructure(model.points3D.at(point.id).origin);
  });
  return selection;
}

std::vector<std::pair<image_t, const Image*>> ImagesOf(const Reconstruction& model,
                                                       const BundleSelection& selection) {
  std::vector<size_t> positions;
  positions.reserve(selection.frames.size());
  for (const auto& frame : selection.frames) {
    ForEachImage(model, frame.id, [&](image_t image_id, const Image&) {
      positions.push_back(model.images.IndexOf(image_id));
    });
  }
  std::sort(positions.begin(), positions.end());
  std::vector<std::pair<image_t, const Image*>> images;
  images.reserve(positions.size());
  for (const size_t position : positions) {
    const auto& [image_id, image] = *(model.images.begin() + position);
    images.emplace_back(image_id, &image);
  }
  return images;
}

}  // namespace holba
