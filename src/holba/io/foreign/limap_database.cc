// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/foreign/limap_database.h"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <sstream>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/words.h"
#include "holba/io/binary_io.h"
#include "holba/io/files.h"
#include "holba/io/foreign/limap_groups.h"
#include "holba/scene/validity.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

constexpr const char* kSettings = "limap";
constexpr const char* kLineMatches = "line_matches";
constexpr const char* kGroupMatches = "group_matches";

class Sqlite {
 public:
  // Opens a file for reading.
  explicit Sqlite(const fs::path& path) : path_(path) {
    Open(Uri(path), SQLITE_OPEN_READONLY | SQLITE_OPEN_URI);
  }
  // A new one in memory.
  Sqlite() : path_("LIMAP's database") {
    Open(":memory:", SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  }
  ~Sqlite() { sqlite3_close(handle_); }
  Sqlite(const Sqlite&) = delete;
  Sqlite& operator=(const Sqlite&) = delete;

  // The whole database as the bytes of its file.
  std::string Bytes() {
    sqlite3_int64 size = 0;
    unsigned char* const bytes = sqlite3_serialize(handle_, "main", &size, 0);
    if (bytes == nullptr) throw std::bad_alloc();
    std::string copy(reinterpret_cast<const char*>(bytes), static_cast<size_t>(size));
    sqlite3_free(bytes);
    return copy;
  }

  void Execute(const char* sql) {
    if (sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr) != SQLITE_OK) Fail();
  }

  class Statement {
   public:
    Statement(Sqlite* database, const std::string& sql) : database_(*database) {
      if (sqlite3_prepare_v2(database_.handle_, sql.c_str(), -1, &statement_, nullptr) != SQLITE_OK)
        database_.Fail();
    }
    ~Statement() { sqlite3_finalize(statement_); }
    Statement(const Statement&) = delete;
    Statement& operator=(const Statement&) = delete;

    bool Step() {
      const int code = sqlite3_step(statement_);
      if (code != SQLITE_ROW && code != SQLITE_DONE) database_.Fail();
      return code == SQLITE_ROW;
    }
    int64_t Integer(int column) const { return sqlite3_column_int64(statement_, column); }
    std::string_view Bytes(int column) const {
      const void* const bytes = sqlite3_column_blob(statement_, column);
      if (bytes == nullptr) return {};
      return {static_cast<const char*>(bytes),
              static_cast<size_t>(sqlite3_column_bytes(statement_, column))};
    }
    // Runs the statement once with these values.
    void Run(const std::vector<int64_t>& integers, std::string_view blob) {
      int at = 0;
      for (const int64_t value : integers) Check(sqlite3_bind_int64(statement_, ++at, value));
      Check(sqlite3_bind_blob64(statement_, ++at, blob.empty() ? "" : blob.data(), blob.size(),
                                SQLITE_STATIC));
      Step();
      Check(sqlite3_reset(statement_));
    }

   private:
    void Check(int code) const {
      if (code != SQLITE_OK) database_.Fail();
    }
    Sqlite& database_;
    sqlite3_stmt* statement_ = nullptr;
  };

 private:
  void Open(const std::string& name, int flags) {
    if (sqlite3_open_v2(name.c_str(), &handle_, flags, nullptr) != SQLITE_OK) Fail();
  }

  // LIMAP leaves its database in a mode in which readers, too, make files beside it. One that
  // nobody has open is read without, so that its folder may be closed to writing.
  static std::string Uri(const fs::path& path) {
    std::string uri = "file:";
    for (const char c : fs::absolute(path).string()) {
      if (c == '?' || c == '#' || c == '%') {
        uri += fmt::format("%{:02x}", static_cast<unsigned char>(c));
      } else {
        uri += c;
      }
    }
    return fs::exists(path.string() + "-wal") ? uri : uri + "?immutable=1";
  }

  [[noreturn]] void Fail() const {
    const std::string message = handle_ ? sqlite3_errmsg(handle_) : "not enough memory";
    throw InputError(path_, fmt::format("LIMAP's database cannot be used ({}); make it anew, or "
                                        "give another one",
                                        message));
  }

  const fs::path path_;
  sqlite3* handle_ = nullptr;
};

// ---- Blobs. Everything is preceded by its size in bytes, which must be what it takes.

// Reads a thing behind its size.
template <typename Read>
void ReadSized(BinaryIn& in, const char* what, const Read& read) {
  in.Count(what, 1);
  read();
}

LimapStructure2d ReadBlob(std::string_view bytes, const fs::path& place) {
  BinaryIn in(bytes, place);
  LimapStructure2d structure;
  structure.num_points = in.Number("NUM_POINTS");
  const size_t num_lines = in.Count("NUM_LINES", 48);
  for (size_t i = 0; i < num_lines; ++i) {
    ReadSized(in, "the size of a line", [&] {
      Line2D line;
      for (Eigen::Vector2d* end : {&line.segment.start, &line.segment.end}) {
        end->x() = in.Real("X");
        end->y() = in.Real("Y");
      }
      line.line3D_id = in.Number("LINE3D_ID");
      structure.lines.push_back(line);
    });
  }
  const size_t num_groups = in.Count("NUM_GROUPS", 36);
  for (size_t i = 0; i < num_groups; ++i) {
    ReadSized(in, "the size of a group", [&] {
      const int32_t code = in.Int32("TYPE");
      Group2D group{.type = GroupTypeOfLimap(code)};
      if (group.type == nullptr) in.Fail(fmt::format("expected TYPE of 0 to 6, found {}", code));
      std::vector<double> params(in.Count("NUM_PARAMS", 8));
      for (double& param : params) param = in.Real("PARAM");
      for (auto* members : {&group.point2D_idxs, &group.line2D_idxs}) {
        const size_t count = in.Count("the number of members", 20);
        for (size_t k = 0; k < count; ++k) {
          ReadSized(in, "the size of a member", [&] {
            members->push_back(in.Index("IDX"));
            in.Real("WEIGHT");
          });
        }
      }
      structure.groups.push_back(std::move(group));
      structure.group_params.push_back(std::move(params));
    });
  }
  ReadSized(in, "the size of the edges", [&] {
    const size_t num_edges = in.Count("NUM_EDGES", 16);
    for (size_t i = 0; i < num_edges; ++i) {
      const point2D_t point2D_idx = in.Index("POINT2D_IDX");
      const line2D_t line2D_idx = in.Index("LINE2D_IDX");
      structure.edges.push_back({point2D_idx, line2D_idx, in.Real("WEIGHT")});
    }
  });
  in.Finish();
  return structure;
}

std::string WriteBlob(const LimapStructure2d& structure) {
  std::ostringstream stream;
  {
    BinaryOut out(&stream);
    out.Number(structure.num_points);
    out.Count(structure.lines.size());
    for (const Line2D& line : structure.lines) {
      out.Number(40);
      for (const Eigen::Vector2d& end : {line.segment.start, line.segment.end}) {
        out.Real(end.x());
        out.Real(end.y());
      }
      out.Number(line.line3D_id);
    }
    out.Count(structure.groups.size());
    for (size_t i = 0; i < structure.groups.size(); ++i) {
      const Group2D& group = structure.groups[i];
      const std::vector<double>& params = structure.group_params.at(i);
      const size_t num_members = group.point2D_idxs.size() + group.line2D_idxs.size();
      out.Number(4 + 8 + 8 * params.size() + 16 + 20 * num_members);
      out.Int32(LimapCodeOf(*group.type));
      out.Count(params.size());
      for (const double param : params) out.Real(param);
      for (const auto* members : {&group.point2D_idxs, &group.line2D_idxs}) {
        out.Count(members->size());
        for (const uint32_t idx : *members) {
          out.Number(12);
          out.Index(idx);
          out.Real(1.0);
        }
      }
    }
    out.Number(8 + 16 * structure.edges.size());
    out.Count(structure.edges.size());
    for (const LimapStructure2d::Edge& edge : structure.edges) {
      out.Index(edge.point2D_idx);
      out.Index(edge.line2D_idx);
      out.Real(edge.weight);
    }
  }
  return stream.str();
}

std::map<ImagePair, LimapDatabase::Matches> ReadMatches(const char* table, const fs::path& path,
                                                        Sqlite* database) {
  std::map<ImagePair, LimapDatabase::Matches> all;
  Sqlite::Statement rows(database, fmt::format("SELECT pair_id, rows, cols, data FROM {}", table));
  while (rows.Step()) {
    const int64_t id = rows.Integer(0), id1 = id / kMaxNumImages, id2 = id % kMaxNumImages;
    const std::string_view bytes = rows.Bytes(3);
    const int64_t count = rows.Integer(1);
    if (id < 0 || id1 >= id2 || rows.Integer(2) != 2 || count < 0 ||
        static_cast<uint64_t>(count) != bytes.size() / 8 || bytes.size() % 8 != 0) {
      throw InputError(path,
                       fmt::format("expected a pair of images with rows of two indices in {}, "
                                   "found another thing at pair_id = {}",
                                   table, id));
    }
    LimapDatabase::Matches& matches = all[{static_cast<image_t>(id1), static_cast<image_t>(id2)}];
    matches.resize(static_cast<size_t>(count));
    for (size_t i = 0; i < matches.size(); ++i) {
      std::memcpy(&matches[i].first, bytes.data() + 8 * i, 4);
      std::memcpy(&matches[i].second, bytes.data() + 8 * i + 4, 4);
    }
  }
  return all;
}

// What LIMAP gives to a 2D group without other parameters.
std::vector<double> DefaultParams2D(const GroupType& type) {
  std::vector<double> params(NumLimapParams2D(type), 0.0);
  if ((type.name == "VP" || type.name == "PLANE")) params = {0.0, 1.0, 0.0};
  return params;
}

// A vanishing point as homogeneous pixels, a plane as its normal in the camera frame.
std::vector<double> Params2D(const Group2D& group, const Image& image,
                             const Reconstruction& model) {
  const Group3D* const group3D = model.groups3D.Find(group.group3D_id);
  if (group3D == nullptr || (group.type->name != "VP" && group.type->name != "PLANE"))
    return DefaultParams2D(*group.type);
  const Eigen::Vector3d direction_in_cam =
      image.cam_from_world.RotationMatrix() * Eigen::Vector3d(group3D->params.data());
  if (group.type->name == "PLANE")
    return {direction_in_cam.x(), direction_in_cam.y(), direction_in_cam.z()};
  const Camera& camera = model.cameras.at(image.camera_id);
  const IdealCalibration k = camera.model->ideal_calibration(camera.params.data());
  const Eigen::Vector3d vp(k.fx * direction_in_cam.x() + k.cx * direction_in_cam.z(),
                           k.fy * direction_in_cam.y() + k.cy * direction_in_cam.z(),
                           direction_in_cam.z());
  const Eigen::Vector3d unit = vp.normalized();
  return {unit.x(), unit.y(), unit.z()};
}

// Pairs of features in different images that are of one track.
template <typename Records, typename Index>
std::map<ImagePair, LimapDatabase::Matches> MatchesOfTracks(const Records& tracks,
                                                            const Index& idx_of) {
  std::map<ImagePair, LimapDatabase::Matches> matches;
  for (const auto& track : tracks) {
    for (const auto& a : *track) {
      for (const auto& b : *track) {
        if (a.image_id < b.image_id)
          matches[{a.image_id, b.image_id}].emplace_back(idx_of(a), idx_of(b));
      }
    }
  }
  return matches;
}

}  // namespace

bool IsSqliteFile(const fs::path& path) {
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored)) return false;
  std::ifstream stream(path, std::ios::binary);
  char head[16] = {};
  stream.read(head, sizeof(head));
  return std::string_view(head, sizeof(head)) == kMagic;
}

bool IsLimapDatabase(const fs::path& path) {
  if (!IsSqliteFile(path)) return false;
  try {
    Sqlite database(path);
    Sqlite::Statement table(
        &database, "SELECT name FROM sqlite_master WHERE type = 'table' AND name = 'structure2d'");
    return table.Step();
  } catch (const InputError&) {
    return false;
  }
}

LimapDatabase ReadLimapDatabase(const fs::path& path) {
  Sqlite database(path);
  LimapDatabase limap;
  Sqlite::Statement rows(&database, "SELECT image_id, data FROM structure2d ORDER BY image_id");
  while (rows.Step()) {
    const int64_t id = rows.Integer(0);
    if (id < 0 || id >= kMaxNumImages)
      throw InputError(path,
                       fmt::format("expected the id of an image in structure2d, found {}", id));
    const fs::path place = fmt::format("{}: structure2d of image {}", path.string(), id);
    limap.structures[static_cast<image_t>(id)] = ReadBlob(rows.Bytes(1), place);
  }
  limap.line_matches = ReadMatches(kLineMatches, path, &database);
  limap.group_matches = ReadMatches(kGroupMatches, path, &database);
  return limap;
}

void FormatLimapDatabase(const LimapDatabase& limap, std::ostream* stream) {
  Sqlite database;
  database.Execute(
      "BEGIN;"
      "CREATE TABLE meta (key TEXT PRIMARY KEY, value INTEGER);"
      "CREATE TABLE line_matches (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, "
      "cols INTEGER NOT NULL, data BLOB);"
      "CREATE TABLE group_matches (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, "
      "cols INTEGER NOT NULL, data BLOB);"
      "CREATE TABLE structure2d (image_id INTEGER PRIMARY KEY, data BLOB NOT NULL);");
  {
    Sqlite::Statement insert(&database, "INSERT INTO structure2d VALUES (?, ?)");
    for (const auto& [image_id, structure] : limap.structures)
      insert.Run({image_id}, WriteBlob(structure));
  }
  const auto write_matches = [&](const char* table, const auto& all) {
    Sqlite::Statement insert(&database, fmt::format("INSERT INTO {} VALUES (?, ?, 2, ?)", table));
    for (const auto& [pair, matches] : all) {
      std::string bytes(8 * matches.size(), '\0');
      for (size_t i = 0; i < matches.size(); ++i) {
        std::memcpy(bytes.data() + 8 * i, &matches[i].first, 4);
        std::memcpy(bytes.data() + 8 * i + 4, &matches[i].second, 4);
      }
      insert.Run(
          {int64_t{kMaxNumImages} * pair.first + pair.second, static_cast<int64_t>(matches.size())},
          bytes);
    }
  };
  write_matches(kLineMatches, limap.line_matches);
  write_matches(kGroupMatches, limap.group_matches);
  database.Execute("COMMIT");
  *stream << database.Bytes();
}

void WriteLimapDatabase(const LimapDatabase& limap, const fs::path& path) {
  WriteFileWhole(path, [&](std::ostream* stream) { FormatLimapDatabase(limap, stream); });
}

LimapDatabase LimapDatabaseOf(const Reconstruction& model) {
  LimapDatabase limap;
  for (const auto* images : {&model.images, &model.unregistered_images}) {
    for (const auto& [image_id, image] : *images) {
      LimapStructure2d structure = LimapStructureOf(model, image_id);
      for (const Group2D& group : structure.groups)
        structure.group_params.push_back(Params2D(group, image, model));
      // Its programs make the links anew.
      for (Line2D& line : structure.lines) line.line3D_id = kNoId;
      limap.structures[image_id] = std::move(structure);
    }
  }
  std::vector<const std::vector<LineObservation>*> line_tracks;
  for (const auto& [id, line] : model.lines3D) line_tracks.push_back(&line.track);
  limap.line_matches =
      MatchesOfTracks(line_tracks, [](const LineObservation& o) { return o.line2D_idx; });
  std::vector<const std::vector<GroupObservation>*> group_tracks;
  for (const auto& [id, group] : model.groups3D) group_tracks.push_back(&group.observations);
  limap.group_matches =
      MatchesOfTracks(group_tracks, [](const GroupObservation& o) { return o.group2D_idx; });
  return limap;
}

LimapDatabase LimapDatabaseOf(const Database& database) {
  LimapDatabase limap;
  const std::map<camera_t, DatabaseCamera> cameras = database.ReadCameras();
  const std::map<image_t, DatabaseImage> images = database.ReadImages();
  for (const auto& [image_id, image] : images) {
    LimapStructure2d& structure = limap.structures[image_id];
    structure.num_points = database.NumKeypoints(image_id).value_or(0);
    const std::optional<std::string> settings = database.ReadSegmentSettings(image_id);
    if (!settings) continue;
    for (const LineSegment2d& segment :
         database.ReadSegments(image_id, *settings).value_or(std::vector<LineSegment2d>()))
      structure.lines.push_back({.segment = segment});
    const std::optional<std::string> of_points = database.ReadVanishingPointSettings(image_id);
    const std::optional<ImageVanishingPoints> found =
        of_points ? database.ReadVanishingPoints(image_id, *of_points) : std::nullopt;
    if (!found) continue;
    const Camera& camera = cameras.at(image.camera_id).camera;
    const IdealCalibration k = camera.model->ideal_calibration(camera.params.data());
    for (size_t i = 0; i < found->points.size(); ++i) {
      Group2D group{.type = GroupTypeOfLimap(0)};
      for (size_t line = 0; line < found->vp_of_segment.size(); ++line) {
        if (found->vp_of_segment[line] == static_cast<int32_t>(i))
          group.line2D_idxs.push_back(static_cast<line2D_t>(line));
      }
      if (group.line2D_idxs.empty()) continue;
      const Eigen::Vector3d& d = found->points[i].direction_in_cam;
      const Eigen::Vector3d vp =
          Eigen::Vector3d(k.fx * d.x() + k.cx * d.z(), k.fy * d.y() + k.cy * d.z(), d.z())
              .normalized();
      structure.groups.push_back(std::move(group));
      structure.group_params.push_back({vp.x(), vp.y(), vp.z()});
    }
  }
  for (auto first = images.begin(); first != images.end(); ++first) {
    for (auto second = std::next(first); second != images.end(); ++second) {
      const auto settings = database.ReadLineMatchSettings(first->first, second->first);
      const auto matches = settings
                               ? database.ReadLineMatches(first->first, second->first, *settings)
                               : std::nullopt;
      if (!matches || matches->empty()) continue;
      LimapDatabase::Matches& of_pair = limap.line_matches[{first->first, second->first}];
      for (const LineMatch& match : *matches) of_pair.emplace_back(match.idx1, match.idx2);
    }
  }
  return limap;
}

size_t AddToDatabase(const LimapDatabase& limap, const fs::path& path, Database* database) {
  const std::map<image_t, DatabaseImage> images = database->ReadImages();
  const std::map<camera_t, DatabaseCamera> cameras = database->ReadCameras();
  for (const auto& [image_id, structure] : limap.structures) {
    if (!images.contains(image_id)) {
      throw InputError(path, fmt::format("holds structure of image {}, which {} lacks; give the "
                                         "database of COLMAP that it was made with",
                                         image_id, database->path().string()));
    }
  }
  Database::Transaction transaction(database);
  for (const auto& [image_id, structure] : limap.structures) {
    std::vector<LineSegment2d> segments;
    for (const Line2D& line : structure.lines) segments.push_back(line.segment);
    database->WriteSegments(image_id, kSettings, segments);
    ImageVanishingPoints points;
    points.vp_of_segment.assign(segments.size(), -1);
    const Camera& camera = cameras.at(images.at(image_id).camera_id).camera;
    const IdealCalibration k = camera.model->ideal_calibration(camera.params.data());
    for (size_t i = 0; i < structure.groups.size(); ++i) {
      const Group2D& group = structure.groups[i];
      const std::vector<double>& vp = structure.group_params[i];
      if (group.type != GroupTypeOfLimap(0) || vp.size() != 3) continue;
      const Eigen::Vector3d direction((vp[0] - k.cx * vp[2]) / k.fx, (vp[1] - k.cy * vp[2]) / k.fy,
                                      vp[2]);
      if (!(direction.norm() > 0.0)) continue;
      uint32_t num_segments = 0;
      for (const line2D_t idx : group.line2D_idxs) {
        if (idx >= segments.size() || points.vp_of_segment[idx] != -1) continue;
        points.vp_of_segment[idx] = static_cast<int32_t>(points.points.size());
        ++num_segments;
      }
      points.points.push_back({direction.normalized(), num_segments});
    }
    if (!points.points.empty()) database->WriteVanishingPoints(image_id, kSettings, points);
  }
  for (const auto& [pair, matches] : limap.line_matches) {
    const auto first = limap.structures.find(pair.first),
               second = limap.structures.find(pair.second);
    std::vector<LineMatch> found;
    for (const auto& [idx1, idx2] : matches) {
      if (first == limap.structures.end() || second == limap.structures.end() ||
          idx1 >= first->second.lines.size() || idx2 >= second->second.lines.size()) {
        throw InputError(path, fmt::format("matches of images {} and {} name lines that "
                                           "are not there; write LIMAP's database anew",
                                           pair.first, pair.second));
      }
      found.push_back({idx1, idx2, 0.0f});
    }
    database->WriteLineMatches(pair.first, pair.second, kSettings, found);
  }
  transaction.Commit();
  return limap.structures.size();
}

Reconstruction ReadLimapDatabaseAsModel(const fs::path& path) {
  const fs::path colmap = path.parent_path() / "database.db";
  if (!fs::is_regular_file(colmap)) {
    throw InputError(path,
                     "LIMAP's database knows its images by numbers only; put database.db of "
                     "COLMAP, with which it was made, into the same folder");
  }
  const LimapDatabase limap = ReadLimapDatabase(path);
  const Database database(colmap);
  Reconstruction model;
  for (const auto& [camera_id, camera] : database.ReadCameras())
    model.cameras.Add(camera_id, camera.camera);
  for (const auto& [image_id, stored] : database.ReadImages()) {
    Image image;
    image.name = stored.name;
    image.camera_id = stored.camera_id;
    if (const std::optional<Keypoints> keypoints = database.ReadKeypoints(image_id)) {
      for (size_t i = 0; i < keypoints->size(); ++i)
        image.points2D.push_back({.xy = keypoints->Position(i)});
    }
    const auto structure = limap.structures.find(image_id);
    if (structure != limap.structures.end()) {
      for (const Line2D& line : structure->second.lines)
        image.lines2D.push_back({.segment = line.segment});
      for (Group2D group : structure->second.groups) {
        group.group3D_id = kNoId;
        const auto is_known = [&](const std::vector<uint32_t>& idxs, size_t size) {
          return std::all_of(idxs.begin(), idxs.end(), [&](uint32_t idx) { return idx < size; });
        };
        if (!FindFault(group) && is_known(group.point2D_idxs, image.points2D.size()) &&
            is_known(group.line2D_idxs, image.lines2D.size()))
          image.groups2D.push_back(std::move(group));
      }
    }
    model.unregistered_images.Add(image_id, std::move(image));
  }
  model.AddTrivialRigsAndFrames();
  return model;
}

}  // namespace holba
