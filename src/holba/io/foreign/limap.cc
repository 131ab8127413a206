// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/foreign/limap.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/base/words.h"
#include "holba/io/binary_io.h"
#include "holba/io/foreign/limap_database.h"
#include "holba/io/foreign/limap_groups.h"
#include "holba/io/foreign/limap_words.h"
#include "holba/io/model_format.h"
#include "holba/io/model_io.h"
#include "holba/io/record_faults.h"
#include "holba/scene/validity.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

constexpr const char* kFolder = "structures";
constexpr const char* kDatabase = "structure_database.db";
constexpr const char* kNames[] = {"structures2d", "lines3D", "groups3D", "wireframe3D"};
constexpr double kUnset = -1.0;  // scores, uncertainties

template <typename In>
std::vector<uint32_t> ReadMembers2D(In& in, size_t count) {
  std::vector<uint32_t> members;
  for (size_t i = 0; i < count; ++i) {
    members.push_back(in.Index("IDX"));
    in.Real("WEIGHT");
  }
  return members;
}
template <typename In>
std::vector<uint64_t> ReadMembers3D(In& in, size_t count) {
  std::vector<uint64_t> members;
  for (size_t i = 0; i < count; ++i) {
    members.push_back(in.Number("ID"));
    in.Real("WEIGHT");
  }
  return members;
}
template <typename Observation, typename In>
std::vector<Observation> ReadTrack(In& in) {
  const size_t count = in.Count("TRACK_LENGTH", 8);
  std::vector<Observation> track;
  for (size_t i = 0; i < count; ++i) {
    const image_t image_id = in.Index("IMAGE_ID");
    track.push_back({image_id, in.Index("IDX")});
  }
  return track;
}

template <typename In>
const GroupType& ReadType(In& in) {
  const int32_t code = in.Int32("TYPE");
  const GroupType* const type = GroupTypeOfLimap(code);
  if (type == nullptr) in.Fail(fmt::format("expected TYPE (0 to 6), found {}", code));
  return *type;
}

template <typename In>
Group2D ReadGroup2D(In& in) {
  Group2D group{.type = &ReadType(in)};
  if constexpr (In::kBinary) {
    group.point2D_idxs = ReadMembers2D(in, in.Count("NUM_POINTS", 12));
    group.line2D_idxs = ReadMembers2D(in, in.Count("NUM_LINES", 12));
    group.group3D_id = in.Number("GROUP3D_ID");
  } else {
    const size_t num_points = in.Count("NUM_POINTS", 12), num_lines = in.Count("NUM_LINES", 12);
    group.group3D_id = in.Number("GROUP3D_ID");
    group.point2D_idxs = ReadMembers2D(in, num_points);
    group.line2D_idxs = ReadMembers2D(in, num_lines);
  }
  return group;
}

template <typename In>
LimapStructure2d ReadStructure2d(In& in) {
  LimapStructure2d structure;
  structure.num_points = in.Index("NUM_POINTS");
  size_t num_lines = in.Count("NUM_LINES", 48), num_groups = 0;
  if constexpr (!In::kBinary) {
    num_groups = in.Count("NUM_GROUPS", 28);
    in.Count("NUM_EDGES", 16);
  }
  for (size_t i = 0; i < num_lines; ++i) {
    Line2D line;
    line.segment.start.x() = in.Real("X1");
    line.segment.start.y() = in.Real("Y1");
    line.segment.end.x() = in.Real("X2");
    line.segment.end.y() = in.Real("Y2");
    in.Real("SCORE");
    if constexpr (In::kBinary) line.line3D_id = in.Number("LINE3D_ID");
    structure.lines.push_back(line);
  }
  if constexpr (In::kBinary) num_groups = in.Count("NUM_GROUPS", 28);
  for (size_t i = 0; i < num_groups; ++i) structure.groups.push_back(ReadGroup2D(in));
  const size_t num_edges = in.Count("NUM_EDGES", 16);
  for (size_t i = 0; i < num_edges; ++i) {
    const point2D_t point2D_idx = in.Index("POINT2D_IDX");
    const line2D_t line2D_idx = in.Index("LINE2D_IDX");
    structure.edges.push_back({point2D_idx, line2D_idx, in.Real("WEIGHT")});
  }
  return structure;
}

// Fills a model from the four files, in their order.
class StructureReader {
 public:
  StructureReader(const fs::path& folder, Reconstruction* model)
      : folder_(folder / kFolder), model_(*model) {}

  void Read() {
    const std::string extension = fs::exists(folder_ / "lines3D.bin") ? ".bin" : ".txt";
    const auto read = [&](const char* name, auto member) {
      const fs::path path = folder_ / (name + extension);
      const std::string bytes = ReadFileBytes(path);
      if (extension == ".bin") {
        BinaryIn in(bytes, path);
        member(in);
        in.Finish();
      } else {
        WordsIn in(bytes, path);
        member(in);
        in.Finish();
      }
    };
    read(kNames[0], [&](auto& in) { Structures2d(in); });
    read(kNames[1], [&](auto& in) { Lines3D(in); });
    read(kNames[2], [&](auto& in) { Groups3D(in); });
    read(kNames[3], [&](auto& in) { Wireframe(in); });
    Report();
  }

 private:
  static constexpr group2D_t kLeftOut = kInvalidId32;

  template <typename In>
  void Structures2d(In& in) {
    const size_t count = in.Count("the number of images", 32);
    for (size_t i = 0; i < count; ++i) {
      const image_t image_id = in.Index("IMAGE_ID");
      LimapStructure2d structure = ReadStructure2d(in);
      Image* const image = model_.FindImage(image_id);
      if (image == nullptr) {
        ++dropped_["images that the model lacks"];
        continue;
      }
      if (!image->lines2D.empty() || !new_idx_[image_id].empty())
        in.Fail(ThereTwice(fmt::format("the structure of image {}", image_id)));
      const bool is_registered = model_.IsRegistered(image_id);
      for (Line2D& line : structure.lines) {
        if (!is_registered) line.line3D_id = kNoId;
        image->lines2D.push_back(line);
      }
      for (Group2D& group : structure.groups) AddGroup2D(image_id, is_registered, &group, image);
      for (const LimapStructure2d::Edge& edge : structure.edges) {
        if (edge.point2D_idx >= image->points2D.size() ||
            edge.line2D_idx >= image->lines2D.size()) {
          in.Fail(
              fmt::format("expected an edge of image {} between its {} points and {} lines, "
                          "found one of point {} and line {}",
                          image_id, image->points2D.size(), image->lines2D.size(), edge.point2D_idx,
                          edge.line2D_idx));
        }
        edges_of_image_[image_id].push_back(edge);
      }
    }
  }

  // Keeps what a 2D group of its type can hold.
  void AddGroup2D(image_t image_id, bool is_registered, Group2D* group, Image* image) {
    if (!group->type->TakesPoints()) group->point2D_idxs.clear();
    if (!group->type->TakesLines()) group->line2D_idxs.clear();
    KeepKnown(image->points2D.size(), &group->point2D_idxs);
    KeepKnown(image->lines2D.size(), &group->line2D_idxs);
    if (!is_registered) group->group3D_id = kNoId;
    std::vector<group2D_t>& new_idx = new_idx_[image_id];
    if (FindFault(*group)) {
      ++dropped_["2D groups without features"];
      new_idx.push_back(kLeftOut);
      return;
    }
    new_idx.push_back(static_cast<group2D_t>(image->groups2D.size()));
    image->groups2D.push_back(std::move(*group));
  }

  // Without what is twice or not there.
  template <typename Index>
  static void KeepKnown(size_t size, std::vector<Index>* indices) {
    std::set<Index> seen;
    std::erase_if(*indices, [&](Index idx) { return idx >= size || !seen.insert(idx).second; });
  }

  template <typename In>
  void Lines3D(In& in) {
    const size_t count = in.Count("the number of lines", 72);
    for (size_t i = 0; i < count; ++i) {
      const line3D_t line3D_id = in.Number("LINE3D_ID");
      Line3D line;
      line.start = ReadVector3(in, "X1", "Y1", "Z1");
      line.end = ReadVector3(in, "X2", "Y2", "Z2");
      line.track = ReadTrack<LineObservation>(in);
      in.Real("UNCERTAINTY");
      if (line3D_id == kNoId || model_.lines3D.contains(line3D_id))
        in.Fail(ThereTwice(fmt::format("3D line {}", line3D_id)));
      if (line.start == line.end) {
        ++dropped_["3D lines without extent"];
        continue;
      }
      line.line = PlueckerLine::FromPoints(line.start, line.end);
      if (FindFault(line)) {
        ++dropped_["3D lines without extent"];
        continue;
      }
      // The text does not say at the segments what they observe.
      for (const LineObservation& observation : line.track) {
        Image* const image = In::kBinary ? nullptr : model_.images.Find(observation.image_id);
        if (image != nullptr && observation.line2D_idx < image->lines2D.size())
          image->lines2D[observation.line2D_idx].line3D_id = line3D_id;
      }
      model_.lines3D.Add(line3D_id, std::move(line));
    }
  }

  template <typename In>
  void Groups3D(In& in) {
    const size_t count = in.Count("the number of groups", 44);
    for (size_t i = 0; i < count; ++i) {
      const group3D_t group3D_id = in.Number("GROUP3D_ID");
      Group3D group{.type = &ReadType(in)};
      if constexpr (In::kBinary) {
        group.point3D_ids = ReadMembers3D(in, in.Count("NUM_POINTS", 16));
        group.line3D_ids = ReadMembers3D(in, in.Count("NUM_LINES", 16));
      } else {
        const size_t num_points = in.Count("NUM_POINTS", 16), num_lines = in.Count("NUM_LINES", 16);
        group.point3D_ids = ReadMembers3D(in, num_points);
        group.line3D_ids = ReadMembers3D(in, num_lines);
      }
      std::vector<GroupObservation> track = ReadTrack<GroupObservation>(in);
      const size_t num_params = in.Count("NUM_PARAMS", 8);
      std::vector<double> params;
      for (size_t k = 0; k < num_params; ++k) params.push_back(in.Real("PARAM"));
      if (num_params != NumLimapParams(*group.type)) {
        in.Fail(fmt::format("expected NUM_PARAMS {} of a {}, found {}", NumLimapParams(*group.type),
                            group.type->name, num_params));
      }
      if (group3D_id == kNoId || model_.groups3D.contains(group3D_id))
        in.Fail(ThereTwice(fmt::format("3D group {}", group3D_id)));
      AddGroup3D(group3D_id, params, track, &group);
    }
  }

  void AddGroup3D(group3D_t group3D_id, const std::vector<double>& params,
                  const std::vector<GroupObservation>& track, Group3D* group) {
    const size_t num_members = group->point3D_ids.size() + group->line3D_ids.size();
    KeepMembers(model_.points3D, group->type->TakesPoints(), &group->point3D_ids);
    KeepMembers(model_.lines3D, group->type->TakesLines(), &group->line3D_ids);
    const size_t num_lost = num_members - group->point3D_ids.size() - group->line3D_ids.size();
    if (num_lost > 0) dropped_["members that the model or the type of the group lacks"] += num_lost;
    std::vector<Eigen::Vector3d> members;
    for (const point3D_t id : group->point3D_ids) members.push_back(model_.points3D.at(id).xyz);
    const auto plain = ParamsFromLimap(*group->type, params, members);
    if (!plain) {
      ++dropped_["3D groups whose parameters are none"];
      return;
    }
    group->params = *plain;
    for (GroupObservation observation : track) {
      const auto new_idx = new_idx_.find(observation.image_id);
      if (new_idx == new_idx_.end() || observation.group2D_idx >= new_idx->second.size()) continue;
      observation.group2D_idx = new_idx->second[observation.group2D_idx];
      const Image* const image = model_.images.Find(observation.image_id);
      if (observation.group2D_idx == kLeftOut || image == nullptr ||
          image->groups2D[observation.group2D_idx].type != group->type)
        continue;
      group->observations.push_back(observation);
    }
    model_.groups3D.Add(group3D_id, std::move(*group));
  }

  template <typename Records>
  static void KeepMembers(const Records& records, bool takes, std::vector<uint64_t>* ids) {
    std::set<uint64_t> seen;
    std::erase_if(*ids, [&](uint64_t id) {
      return !takes || !records.contains(id) || !seen.insert(id).second;
    });
  }

  template <typename In>
  void Wireframe(In& in) {
    // In how many images both are seen to meet.
    std::map<std::pair<point3D_t, line3D_t>, uint64_t> num_images;
    for (const auto& [image_id, edges] : edges_of_image_) {
      const Image& image = *model_.FindImage(image_id);
      std::set<std::pair<point3D_t, line3D_t>> of_image;
      for (const LimapStructure2d::Edge& edge : edges) {
        of_image.emplace(image.points2D[edge.point2D_idx].point3D_id,
                         image.lines2D[edge.line2D_idx].line3D_id);
      }
      for (const auto& ends : of_image) ++num_images[ends];
    }
    const size_t count = in.Count("the number of edges", 24);
    std::set<std::pair<point3D_t, line3D_t>> added;
    for (size_t i = 0; i < count; ++i) {
      const point3D_t point3D_id = in.Number("POINT3D_ID");
      const line3D_t line3D_id = in.Number("LINE3D_ID");
      in.Real("WEIGHT");
      if (!model_.points3D.contains(point3D_id) || !model_.lines3D.contains(line3D_id)) {
        ++dropped_["edges of what the model lacks"];
        continue;
      }
      if (!added.emplace(point3D_id, line3D_id).second) continue;
      const auto seen = num_images.find({point3D_id, line3D_id});
      model_.wireframe.push_back(
          {point3D_id, line3D_id, seen == num_images.end() ? 1 : seen->second});
    }
  }

  void Report() const {
    if (dropped_.empty()) return;
    std::string list;
    for (const auto& [what, count] : dropped_)
      list += fmt::format("{}{}: {}", list.empty() ? "" : ", ", what, count);
    LogWarning("{}: left out what this model cannot hold ({}); the rest is used", folder_.string(),
               list);
  }

  const fs::path folder_;
  Reconstruction& model_;
  std::map<image_t, std::vector<group2D_t>> new_idx_;  // of a 2D group, by LIMAP's
  std::map<image_t, std::vector<LimapStructure2d::Edge>> edges_of_image_;
  std::map<std::string, size_t> dropped_;
};

template <typename Index>
void WriteMembers2D(BinaryOut& out, const std::vector<Index>& members) {
  out.Count(members.size());
  for (const Index idx : members) {
    out.Index(idx);
    out.Real(1.0);
  }
}

void WriteMembers3D(BinaryOut& out, const std::vector<uint64_t>& members) {
  out.Count(members.size());
  for (const uint64_t id : members) {
    out.Number(id);
    out.Real(1.0);
  }
}

void WriteStructures2d(const Reconstruction& model, BinaryOut& out) {
  std::vector<image_t> ids;
  for (const auto& [image_id, image] : model.images) ids.push_back(image_id);
  std::sort(ids.begin(), ids.end());
  out.Begin(ids.size());
  for (const image_t image_id : ids) {
    const LimapStructure2d structure = LimapStructureOf(model, image_id);
    out.Index(image_id);
    out.Index(static_cast<uint32_t>(structure.num_points));
    out.Count(structure.lines.size());
    for (const Line2D& line : structure.lines) {
      for (const Eigen::Vector2d& end : {line.segment.start, line.segment.end}) {
        out.Real(end.x());
        out.Real(end.y());
      }
      out.Real(kUnset);
      out.Number(line.line3D_id);
    }
    out.Count(structure.groups.size());
    for (const Group2D& group : structure.groups) {
      out.Int32(LimapCodeOf(*group.type));
      WriteMembers2D(out, group.point2D_idxs);
      WriteMembers2D(out, group.line2D_idxs);
      out.Number(group.group3D_id);
    }
    out.Count(structure.edges.size());
    for (const LimapStructure2d::Edge& edge : structure.edges) {
      out.Index(edge.point2D_idx);
      out.Index(edge.line2D_idx);
      out.Real(edge.weight);
    }
    out.EndRecord();
  }
}

void WriteLines3D(const Reconstruction& model, BinaryOut& out) {
  out.Begin(model.lines3D.size());
  for (const auto& [line3D_id, line] : model.lines3D) {
    // On the line itself; LIMAP's line is the one through its ends.
    Eigen::Vector3d start = line.line.ClosestPoint(line.start);
    Eigen::Vector3d end = line.line.ClosestPoint(line.end);
    if ((end - start).norm() <= 1e-9 * (1.0 + start.norm())) end = start + line.line.direction;
    out.Number(line3D_id);
    WriteVector3(out, start);
    WriteVector3(out, end);
    out.Count(line.track.size());
    for (const LineObservation& observation : line.track) {
      out.Index(observation.image_id);
      out.Index(observation.line2D_idx);
    }
    out.Real(kUnset);
    out.EndRecord();
  }
}

void WriteGroups3D(const Reconstruction& model, BinaryOut& out) {
  out.Begin(model.groups3D.size());
  for (const auto& [group3D_id, group] : model.groups3D) {
    out.Number(group3D_id);
    out.Int32(LimapCodeOf(*group.type));
    WriteMembers3D(out, group.point3D_ids);
    WriteMembers3D(out, group.line3D_ids);
    out.Count(group.observations.size());
    for (const GroupObservation& observation : group.observations) {
      out.Index(observation.image_id);
      out.Index(observation.group2D_idx);
    }
    const std::vector<double> params = ParamsToLimap(*group.type, group.params);
    out.Count(params.size());
    for (const double param : params) out.Real(param);
    out.EndRecord();
  }
}

void WriteWireframe(const Reconstruction& model, BinaryOut& out) {
  // The weight of an edge is the sum of those of its images.
  std::map<std::pair<point3D_t, line3D_t>, double> weight;
  for (const auto& [image_id, image] : model.images) {
    for (const LimapStructure2d::Edge& edge : LimapStructureOf(model, image_id).edges) {
      weight[{image.points2D[edge.point2D_idx].point3D_id,
              image.lines2D[edge.line2D_idx].line3D_id}] += edge.weight;
    }
  }
  out.Begin(model.wireframe.size());
  for (const WireframeEdge& edge : model.wireframe) {
    const auto found = weight.find({edge.point3D_id, edge.line3D_id});
    out.Number(edge.point3D_id);
    out.Number(edge.line3D_id);
    out.Real(found != weight.end() ? found->second : static_cast<double>(edge.num_images));
    out.EndRecord();
  }
}

// The model without its structure: what the COLMAP files hold.
Reconstruction WithoutStructure(Reconstruction model) {
  model.lines3D = {};
  model.groups3D = {};
  model.wireframe.clear();
  model.relations.clear();
  for (auto* images : {&model.images, &model.unregistered_images}) {
    for (auto& [image_id, image] : *images) {
      image.lines2D.clear();
      image.groups2D.clear();
    }
  }
  return model;
}

bool IsWrittenFile(std::string_view name) {
  return IsModelFile(name) || IsLimapFile(name) || name == kDatabase;
}

}  // namespace

bool HoldsLimapStructures(const fs::path& folder) {
  for (const char* extension : {".bin", ".txt"}) {
    if (std::all_of(std::begin(kNames), std::end(kNames), [&](const char* name) {
          return fs::exists(folder / kFolder / (std::string(name) + extension));
        }))
      return true;
  }
  return false;
}

bool IsLimapFile(std::string_view name) {
  return std::any_of(std::begin(kNames), std::end(kNames), [&](const char* stem) {
    const std::string path = fmt::format("{}/{}", kFolder, stem);
    return name == path + ".bin" || name == path + ".txt";
  });
}

void ReadLimapStructures(const fs::path& folder, Reconstruction* model) {
  StructureReader(folder, model).Read();
}

size_t DeleteTypesUnknownToLimap(Reconstruction* model) {
  const size_t before = model->groups3D.size();
  model->DeleteGroups3D(
      [](group3D_t, const Group3D& group) { return LimapCodeOf(*group.type) < 0; });
  for (auto* images : {&model->images, &model->unregistered_images}) {
    for (auto& [image_id, image] : *images) {
      model->RemoveGroups2D(image_id, [&image = image](group2D_t idx) {
        return LimapCodeOf(*image.groups2D[idx].type) < 0;
      });
    }
  }
  return before - model->groups3D.size();
}

LimapStructure2d LimapStructureOf(const Reconstruction& model, image_t image_id) {
  // LIMAP's weights of edges: exp(-(d / 2 px)^2 / 2), of at least 1e-6.
  constexpr double kSigmaPx = 2.0, kMinWeight = 1e-6;
  const Image& image = *model.FindImage(image_id);
  LimapStructure2d structure{
      .num_points = image.points2D.size(), .lines = image.lines2D, .groups = image.groups2D};
  std::map<point3D_t, std::vector<point2D_t>> points_of;
  for (point2D_t idx = 0; idx < image.points2D.size(); ++idx) {
    if (image.points2D[idx].point3D_id != kNoId)
      points_of[image.points2D[idx].point3D_id].push_back(idx);
  }
  for (line2D_t line_idx = 0; line_idx < image.lines2D.size(); ++line_idx) {
    const Line2D& line = image.lines2D[line_idx];
    if (line.line3D_id == kNoId || line.segment.Length() == 0.0) continue;
    for (const point3D_t point3D_id : model.PointsOn(line.line3D_id)) {
      const auto points = points_of.find(point3D_id);
      if (points == points_of.end()) continue;
      for (const point2D_t point_idx : points->second) {
        const double d = line.segment.Line().dot(image.points2D[point_idx].xy.homogeneous());
        const double weight = std::exp(-0.5 * d * d / (kSigmaPx * kSigmaPx));
        if (weight > kMinWeight) structure.edges.push_back({point_idx, line_idx, weight});
      }
    }
  }
  return structure;
}

void WriteLimap(const Reconstruction& input, const fs::path& folder) {
  Reconstruction model = input;
  if (const size_t num_dropped = DeleteTypesUnknownToLimap(&model); num_dropped > 0)
    LogWarning("Left out {} of types that LIMAP does not have", Counted(num_dropped, "group"));
  if (!model.relations.empty()) {
    LogInfo("Left out {}, which LIMAP finds anew when it adjusts",
            Counted(model.relations.size(), "relation"));
  }
  StagedFolder stage(folder);
  StageModel(WithoutStructure(model), ModelFormat::kBinary, "", &stage);
  using Writer = void (*)(const Reconstruction&, BinaryOut&);
  constexpr Writer kWriters[] = {WriteStructures2d, WriteLines3D, WriteGroups3D, WriteWireframe};
  for (size_t i = 0; i < std::size(kNames); ++i) {
    stage.Write(fmt::format("{}/{}.bin", kFolder, kNames[i]), [&](std::ostream* stream) {
      BinaryOut out(stream);
      kWriters[i](model, out);
    });
  }
  stage.Write(kDatabase,
              [&](std::ostream* stream) { FormatLimapDatabase(LimapDatabaseOf(model), stream); });
  stage.Commit(IsWrittenFile);
}

void ProbeLimap(const fs::path& folder) { ProbeFolder(folder, IsWrittenFile); }

}  // namespace holba
