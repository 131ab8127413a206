// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/side_files.h"

#include <algorithm>
#include <tuple>
#include <unordered_set>

#include "holba/io/holistic_json.h"
#include "holba/io/record_faults.h"

namespace holba {
namespace {

template <typename In>
const GroupType* ReadGroupType(In& in) {
  const GroupType* type;
  std::string found;
  if constexpr (In::kBinary) {
    const uint8_t code = in.Byte("TYPE");
    type = FindGroupType(code);
    found = fmt::format("code {}", code);
  } else {
    const std::string_view name = in.Word("TYPE", "a group type");
    type = FindGroupType(name);
    found = fmt::format("'{}'", name.substr(0, 40));
  }
  if (type == nullptr) {
    in.Fail(
        fmt::format("expected TYPE (one of {1}), found {0}; use a newer version of this program, "
                    "or remove the groups of that type",
                    found, GroupTypeNames()));
  }
  return type;
}

template <typename Out>
void WriteGroupType(Out& out, const GroupType* type) {
  if constexpr (Out::kBinary) {
    out.Byte(static_cast<uint8_t>(type->code));
  } else {
    out.Word(type->name);
  }
}

// By PointOrigin.
constexpr std::string_view kOriginNames[] = {"DETECTED", "IMPORTED", "JUNCTION", "CORNER"};

template <typename In>
Image* ReadImageId(In& in, Reconstruction* model, image_t* image_id) {
  *image_id = in.Index("IMAGE_ID");
  Image* image = model->FindImage(*image_id);
  if (image == nullptr) {
    in.Fail(fmt::format("expected IMAGE_ID of an image of the model, found {}: {}", *image_id,
                        kSideFilesRemedy));
  }
  return image;
}

template <typename In>
void ReadLine2DRecords(In& in, Reconstruction* model) {
  std::unordered_set<image_t> seen;
  in.Begin("the number of images", 12);
  while (in.NextRecord()) {
    image_t image_id;
    Image* image = ReadImageId(in, model, &image_id);
    if (!seen.insert(image_id).second) {
      in.Fail(ThereTwice(fmt::format("the list of lines of image {}", image_id)));
    }
    const size_t num_lines = in.Count("NUM_LINES", 40);
    image->lines2D.reserve(num_lines);
    for (size_t i = 0; i < num_lines; ++i) {
      Line2D line;
      line.segment.start.x() = in.Real("X1");
      line.segment.start.y() = in.Real("Y1");
      line.segment.end.x() = in.Real("X2");
      line.segment.end.y() = in.Real("Y2");
      line.line3D_id = in.Id("LINE3D_ID");
      image->lines2D.push_back(line);
    }
    in.EndRecord();
  }
}

template <typename In>
void ReadLine3DRecords(In& in, Reconstruction* model) {
  in.Begin("the number of lines", 123);
  model->lines3D.Reserve(in.NumRecordsAtMost());
  while (in.NextRecord()) {
    const line3D_t line3D_id = in.Key("LINE3D_ID");
    Line3D line;
    line.line.direction = ReadVector3(in, "DX", "DY", "DZ");
    line.line.moment = ReadVector3(in, "MX", "MY", "MZ");
    line.start = ReadVector3(in, "X1", "Y1", "Z1");
    line.end = ReadVector3(in, "X2", "Y2", "Z2");
    line.rgb[0] = in.Byte("R");
    line.rgb[1] = in.Byte("G");
    line.rgb[2] = in.Byte("B");
    line.error = in.Real("ERROR");
    for (size_t list = in.List("TRACK_LENGTH", 8); in.More(&list);) {
      line.track.push_back(ReadObservation<LineObservation>(in, "LINE2D_IDX"));
    }
    in.EndRecord();
    if (const Fault fault = FindFault(line)) {
      in.FailRecord(FaultOf(fmt::format("3D line {}", line3D_id), *fault));
    }
    if (!model->lines3D.Add(line3D_id, std::move(line))) {
      in.FailRecord(ThereTwice(fmt::format("3D line {}", line3D_id)));
    }
  }
}

// NUM IDX*, each less than `size`.
template <typename In>
std::vector<uint32_t> ReadIndices(In& in, const char* num, const char* idx_name, size_t size) {
  const size_t count = in.Count(num, 4);
  std::vector<uint32_t> idxs;
  idxs.reserve(count);
  for (size_t i = 0; i < count; ++i) {
    const uint32_t idx = in.Index(idx_name);
    if (idx >= size) {
      in.Fail(fmt::format("expected {} below {} (what the image has), found {}: {}", idx_name, size,
                          idx, kSideFilesRemedy));
    }
    idxs.push_back(idx);
  }
  return idxs;
}

// NUM ID*, each in `map`.
template <typename In, typename Map>
std::vector<uint64_t> ReadIds(In& in, const char* num, const char* id_name, const Map& map) {
  const size_t count = in.Count(num, 8);
  std::vector<uint64_t> ids;
  ids.reserve(std::min<size_t>(count, map.size()));
  for (size_t i = 0; i < count; ++i) {
    const uint64_t id = in.Key(id_name);
    if (!map.contains(id)) {
      in.Fail(IdNotInModel(id_name, id));
    }
    ids.push_back(id);
  }
  return ids;
}

template <typename In>
void ReadGroup2DRecords(In& in, Reconstruction* model) {
  struct Record {
    image_t image_id;
    group2D_t idx;
    uint64_t place;
    Group2D group;
  };
  std::vector<Record> records;
  in.Begin("the number of groups", 33);
  while (in.NextRecord()) {
    Record record;
    const Image* image = ReadImageId(in, model, &record.image_id);
    record.place = in.Place();
    record.idx = in.Index("GROUP2D_IDX");
    record.group.type = ReadGroupType(in);
    record.group.group3D_id = in.Id("GROUP3D_ID");
    record.group.point2D_idxs =
        ReadIndices(in, "NUM_POINTS", "POINT2D_IDX", image->points2D.size());
    record.group.line2D_idxs = ReadIndices(in, "NUM_LINES", "LINE2D_IDX", image->lines2D.size());
    in.EndRecord();
    if (const Fault fault = FindFault(record.group)) {
      in.FailRecord(
          FaultOf(fmt::format("group {} of image {}", record.idx, record.image_id), *fault));
    }
    records.push_back(std::move(record));
  }
  // Records may come in any order; the indices of an image must be 0, 1, 2, ...
  std::stable_sort(records.begin(), records.end(), [](const Record& a, const Record& b) {
    return std::tie(a.image_id, a.idx) < std::tie(b.image_id, b.idx);
  });
  for (Record& record : records) {
    std::vector<Group2D>& groups = model->FindImage(record.image_id)->groups2D;
    if (record.idx != groups.size()) {
      in.FailAt(
          record.place,
          fmt::format("expected GROUP2D_IDX {} of image {} (indices count from 0, each once), "
                      "found {}",
                      groups.size(), record.image_id, record.idx));
    }
    groups.push_back(std::move(record.group));
  }
}

template <typename In>
void ReadGroup3DRecords(In& in, Reconstruction* model) {
  in.Begin("the number of groups", 41);
  while (in.NextRecord()) {
    const group3D_t group3D_id = in.Key("GROUP3D_ID");
    Group3D group;
    group.type = ReadGroupType(in);
    const size_t num_params = in.Count("NUM_PARAMS", 8);
    if (num_params != static_cast<size_t>(group.type->num_file_params)) {
      in.Fail(fmt::format("expected NUM_PARAMS {} of a {} ({}), found {}",
                          group.type->num_file_params, group.type->name, group.type->file_params,
                          num_params));
    }
    for (size_t i = 0; i < num_params; ++i) group.params.push_back(in.Real("PARAM"));
    group.point3D_ids = ReadIds(in, "NUM_POINTS", "POINT3D_ID", model->points3D);
    group.line3D_ids = ReadIds(in, "NUM_LINES", "LINE3D_ID", model->lines3D);
    for (size_t left = in.Count("NUM_OBS", 8); left > 0; --left) {
      const auto added = ReadObservation<GroupObservation>(in, "GROUP2D_IDX");
      group.observations.push_back(added);
      const Image* image = model->images.Find(added.image_id);
      if (image == nullptr || added.group2D_idx >= image->groups2D.size()) continue;
      const Group2D& observed = image->groups2D[added.group2D_idx];
      if (observed.group3D_id == group3D_id && observed.type != group.type) {
        in.Fail(FaultOf(
            fmt::format("group {}", group3D_id),
            fmt::format("is a {}, but its observation, group {} of image {}, is a {}",
                        group.type->name, added.group2D_idx, added.image_id, observed.type->name)));
      }
    }
    in.EndRecord();
    if (const Fault fault = FindFault(group)) {
      in.FailRecord(FaultOf(fmt::format("group {}", group3D_id), *fault));
    }
    if (!model->groups3D.Add(group3D_id, std::move(group))) {
      in.FailRecord(ThereTwice(fmt::format("group {}", group3D_id)));
    }
  }
}

template <typename In>
void ReadWireframeRecords(In& in, Reconstruction* model) {
  in.Begin("the number of edges", 24);
  while (in.NextRecord()) {
    WireframeEdge edge;
    edge.point3D_id = in.Key("POINT3D_ID");
    if (!model->points3D.contains(edge.point3D_id)) {
      in.Fail(IdNotInModel("POINT3D_ID", edge.point3D_id));
    }
    edge.line3D_id = in.Key("LINE3D_ID");
    if (!model->lines3D.contains(edge.line3D_id)) {
      in.Fail(IdNotInModel("LINE3D_ID", edge.line3D_id));
    }
    edge.num_images = in.Number("NUM_IMAGES");
    in.EndRecord();
    model->wireframe.push_back(edge);
  }
}

template <typename In>
group3D_t ReadRelatedGroup(In& in, const Reconstruction& model, const char* what) {
  const group3D_t id = in.Key(what);
  const Group3D* group = model.groups3D.Find(id);
  if (group == nullptr) {
    in.Fail(IdNotInModel(what, id));
  }
  if (!group->type->HasDirection()) {
    in.Fail(fmt::format("expected {} of a group with a direction, found {}, a {}", what, id,
                        group->type->name));
  }
  return id;
}

template <typename In>
void ReadRelationRecords(In& in, Reconstruction* model) {
  in.Begin("the number of relations", 17);
  while (in.NextRecord()) {
    Relation relation;
    relation.group3D_id1 = ReadRelatedGroup(in, *model, "GROUP3D_ID1");
    relation.group3D_id2 = ReadRelatedGroup(in, *model, "GROUP3D_ID2");
    if constexpr (In::kBinary) {
      const uint8_t type = in.Byte("TYPE");
      if (type > 1)
        in.Fail(fmt::format("expected TYPE (0 ORTHOGONAL or 1 PARALLEL), found {}", type));
      relation.type = static_cast<RelationType>(type);
    } else {
      const std::string_view type = in.Word("TYPE", "ORTHOGONAL or PARALLEL");
      if (type == "ORTHOGONAL") {
        relation.type = RelationType::kOrthogonal;
      } else if (type == "PARALLEL") {
        relation.type = RelationType::kParallel;
      } else {
        in.Fail(
            fmt::format("expected TYPE (ORTHOGONAL or PARALLEL), found '{}'", type.substr(0, 40)));
      }
    }
    in.EndRecord();
    model->relations.push_back(relation);
  }
}

template <typename In>
void ReadPointOriginRecords(In& in, Reconstruction* model) {
  in.Begin("the number of points", 9);
  while (in.NextRecord()) {
    const point3D_t id = in.Key("POINT3D_ID");
    Point3D* point = model->points3D.Find(id);
    if (point == nullptr) {
      in.Fail(IdNotInModel("POINT3D_ID", id));
    }
    size_t origin = 0;
    if constexpr (In::kBinary) {
      origin = in.Byte("ORIGIN");
    } else {
      const std::string_view word = in.Word("ORIGIN", "IMPORTED, JUNCTION or CORNER");
      origin = static_cast<size_t>(std::find(std::begin(kOriginNames), std::end(kOriginNames), word) -
                                   std::begin(kOriginNames));
    }
    if (origin >= std::size(kOriginNames)) {
      in.Fail(
          fmt::format("expected ORIGIN (0 {}, 1 {}, 2 {} or 3 {}) of point {}, found none of these",
                      kOriginNames[0], kOriginNames[1], kOriginNames[2], kOriginNames[3], id));
    }
    point->origin = static_cast<PointOrigin>(origin);
    in.EndRecord();
  }
}

// By id: the order of images in the model is that of their registration and says nothing here. With those
// that have no pose.
std::vector<std::pair<image_t, const Image*>> ImagesById(const Reconstruction& model) {
  std::vector<std::pair<image_t, const Image*>> images;
  for (const auto* some : {&model.images, &model.unregistered_images}) {
    for (const auto& [image_id, image] : *some) images.emplace_back(image_id, &image);
  }
  std::sort(images.begin(), images.end());
  return images;
}

template <typename Out>
void Header(Out& out, const char* fields) {
  if constexpr (!Out::kBinary) out.Comment(fields);
}

}  // namespace

void ReadLines2D(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                 Reconstruction* model) {
  WithInput(format, bytes, path, [&](auto& in) { ReadLine2DRecords(in, model); });
}
void ReadLines3D(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                 Reconstruction* model) {
  WithInput(format, bytes, path, [&](auto& in) { ReadLine3DRecords(in, model); });
}
void ReadGroups2D(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                  Reconstruction* model) {
  WithInput(format, bytes, path, [&](auto& in) { ReadGroup2DRecords(in, model); });
}
void ReadGroups3D(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                  Reconstruction* model) {
  WithInput(format, bytes, path, [&](auto& in) { ReadGroup3DRecords(in, model); });
}
void ReadWireframe(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                   Reconstruction* model) {
  WithInput(format, bytes, path, [&](auto& in) { ReadWireframeRecords(in, model); });
}
void ReadPointOrigins(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                      Reconstruction* model) {
  WithInput(format, bytes, path, [&](auto& in) { ReadPointOriginRecords(in, model); });
}
void WritePointOrigins(ModelFormat format, const Reconstruction& model, std::ostream* stream) {
  WithOutput(format, stream, [&](auto& out) {
    Header(out, "POINT3D_ID ORIGIN; points that are not named are DETECTED");
    const auto is_named = [](const auto& entry) { return entry.second.origin != PointOrigin::kDetected; };
    out.Begin(static_cast<uint64_t>(std::count_if(model.points3D.begin(), model.points3D.end(), is_named)));
    for (const auto& entry : model.points3D) {
      if (!is_named(entry)) continue;
      out.Id(entry.first);
      const auto origin = static_cast<uint8_t>(entry.second.origin);
      if constexpr (std::decay_t<decltype(out)>::kBinary) {
        out.Byte(origin);
      } else {
        out.Word(kOriginNames[origin]);
      }
      out.EndRecord();
    }
  });
}
void ReadRelations(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                   Reconstruction* model) {
  WithInput(format, bytes, path, [&](auto& in) { ReadRelationRecords(in, model); });
}

void WriteLines2D(ModelFormat format, const Reconstruction& model, std::ostream* stream) {
  WithOutput(format, stream, [&](auto& out) {
    Header(out, "IMAGE_ID NUM_LINES (X1 Y1 X2 Y2 LINE3D_ID)*");
    const auto images = ImagesById(model);
    out.Begin(static_cast<uint64_t>(std::count_if(
        images.begin(), images.end(), [](const auto& entry) { return !entry.second->lines2D.empty(); })));
    for (const auto& [image_id, image] : images) {
      if (image->lines2D.empty()) continue;
      out.Index(image_id);
      out.Count(image->lines2D.size());
      for (const Line2D& line : image->lines2D) {
        for (const Eigen::Vector2d& end : {line.segment.start, line.segment.end}) {
          out.Real(end.x());
          out.Real(end.y());
        }
        out.Id(line.line3D_id);
      }
      out.EndRecord();
    }
  });
}

void WriteLines3D(ModelFormat format, const Reconstruction& model, std::ostream* stream) {
  WithOutput(format, stream, [&](auto& out) {
    Header(out, "LINE3D_ID DX DY DZ MX MY MZ X1 Y1 Z1 X2 Y2 Z2 R G B ERROR (IMAGE_ID LINE2D_IDX)*");
    out.Begin(model.lines3D.size());
    for (const auto& [line3D_id, line] : model.lines3D) {
      out.Id(line3D_id);
      WriteVector3(out, line.line.direction);
      WriteVector3(out, line.line.moment);
      WriteVector3(out, line.start);
      WriteVector3(out, line.end);
      for (const uint8_t channel : line.rgb) out.Byte(channel);
      out.Real(line.error);
      out.List(line.track.size());
      for (const LineObservation& observation : line.track) {
        out.Index(observation.image_id);
        out.Index(observation.line2D_idx);
      }
      out.EndRecord();
    }
  });
}

void WriteGroups2D(ModelFormat format, const Reconstruction& model, std::ostream* stream) {
  WithOutput(format, stream, [&](auto& out) {
    Header(out,
           "IMAGE_ID GROUP2D_IDX TYPE GROUP3D_ID NUM_POINTS POINT2D_IDX* NUM_LINES LINE2D_IDX*");
    uint64_t num_groups = 0;
    const auto images = ImagesById(model);
    for (const auto& [image_id, image] : images) num_groups += image->groups2D.size();
    out.Begin(num_groups);
    for (const auto& [image_id, image] : images) {
      for (size_t idx = 0; idx < image->groups2D.size(); ++idx) {
        const Group2D& group = image->groups2D[idx];
        out.Index(image_id);
        out.Index(static_cast<uint32_t>(idx));
        WriteGroupType(out, group.type);
        out.Id(group.group3D_id);
        out.Count(group.point2D_idxs.size());
        for (const point2D_t point2D_idx : group.point2D_idxs) out.Index(point2D_idx);
        out.Count(group.line2D_idxs.size());
        for (const line2D_t line2D_idx : group.line2D_idxs) out.Index(line2D_idx);
        out.EndRecord();
      }
    }
  });
}

void WriteGroups3D(ModelFormat format, const Reconstruction& model, std::ostream* stream) {
  WithOutput(format, stream, [&](auto& out) {
    Header(out,
           "GROUP3D_ID TYPE NUM_PARAMS PARAM* NUM_POINTS POINT3D_ID* NUM_LINES LINE3D_ID* NUM_OBS "
           "(IMAGE_ID GROUP2D_IDX)*");
    out.Begin(model.groups3D.size());
    for (const auto& [group3D_id, group] : model.groups3D) {
      out.Id(group3D_id);
      WriteGroupType(out, group.type);
      out.Count(group.params.size());
      for (const double param : group.params) out.Real(param);
      out.Count(group.point3D_ids.size());
      for (const point3D_t id : group.point3D_ids) out.Id(id);
      out.Count(group.line3D_ids.size());
      for (const line3D_t id : group.line3D_ids) out.Id(id);
      out.Count(group.observations.size());
      for (const GroupObservation& observation : group.observations) {
        out.Index(observation.image_id);
        out.Index(observation.group2D_idx);
      }
      out.EndRecord();
    }
  });
}

void WriteWireframe(ModelFormat format, const Reconstruction& model, std::ostream* stream) {
  WithOutput(format, stream, [&](auto& out) {
    Header(out, "POINT3D_ID LINE3D_ID NUM_IMAGES");
    out.Begin(model.wireframe.size());
    for (const WireframeEdge& edge : model.wireframe) {
      out.Id(edge.point3D_id);
      out.Id(edge.line3D_id);
      out.Number(edge.num_images);
      out.EndRecord();
    }
  });
}

void WriteRelations(ModelFormat format, const Reconstruction& model, std::ostream* stream) {
  WithOutput(format, stream, [&](auto& out) {
    Header(out, "GROUP3D_ID1 GROUP3D_ID2 TYPE");
    out.Begin(model.relations.size());
    for (const Relation& relation : model.relations) {
      out.Id(relation.group3D_id1);
      out.Id(relation.group3D_id2);
      if constexpr (std::decay_t<decltype(out)>::kBinary) {
        out.Byte(static_cast<uint8_t>(relation.type));
      } else {
        out.Word(relation.type == RelationType::kOrthogonal ? "ORTHOGONAL" : "PARALLEL");
      }
      out.EndRecord();
    }
  });
}

}  // namespace holba
