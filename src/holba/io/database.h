// SPDX-License-Identifier: BSD-3-Clause
// COLMAP's SQLite database: its own tables (cameras, images, keypoints, descriptors, matches,
// two-view geometries) and, beside them, ours with the prefix holba_ for what is found in single
// images and pairs (scene/image_features.h). Databases of COLMAP 3.6 and later are read and
// written as they are; a new one has the tables of COLMAP 4, with which COLMAP 3.8 works, too.
// Our tables are made when something is first put into them; COLMAP ignores them, and they go with
// the images they belong to.
//
// All functions throw InputError (file, table, image, remedy) for what is damaged, locked or cannot
// be written. One thread at a time.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "holba/scene/image_features.h"
#include "holba/scene/keypoints.h"
#include "holba/scene/pair_repetition.h"
#include "holba/scene/reconstruction.h"
#include "holba/scene/two_view_geometry.h"

struct sqlite3;

namespace holba {

// Ids of images in a database are below this number (COLMAP's kMaxNumImages).
inline constexpr image_t kMaxNumImages = 2147483647;

struct DatabaseCamera {
  Camera camera;
  bool has_prior_focal_length = false;
};

struct DatabaseImage {
  std::string name;
  camera_t camera_id = kInvalidId32;
};

// What is known about a camera's pose before anything is computed (COLMAP 4's pose_priors).
struct PosePrior {
  enum class System { kUndefined = -1, kWgs84 = 0, kCartesian = 1 };
  // Of the centre; WGS84: latitude and longitude in degrees, altitude in metres.
  std::optional<Eigen::Vector3d> position;
  System system = System::kUndefined;
  std::optional<Eigen::Vector3d> gravity_in_cam;  // unit, downwards

  bool empty() const { return !position && !gravity_in_cam; }
};

struct ImageCorners {
  std::vector<Eigen::Vector2d> positions;
  std::vector<uint8_t> descriptors;  // kCornerDescriptorSize each; empty: not described
};

struct ImageVanishingPoints {
  std::vector<ImageVanishingPoint> points;
  std::vector<int32_t> vp_of_segment;  // -1: none
};

// How much of everything a database holds; empty: there is no such row.
struct DatabaseSummary {
  struct OfImage {
    image_t image_id = kInvalidId32;
    std::string name;
    camera_t camera_id = kInvalidId32;
    std::optional<size_t> num_keypoints, num_descriptors;
    std::optional<size_t> num_segments, num_corners, num_vanishing_points;
    bool has_label_map = false;
    bool has_pose_prior = false;
  };
  std::map<camera_t, DatabaseCamera> cameras;
  std::vector<OfImage> images;  // by id
  size_t num_rigs = 0, num_frames = 0, num_pose_priors = 0;
  // Pairs: tried at all, with a match, and the matches of these.
  size_t num_pairs_tried = 0, num_matched_pairs = 0, num_matches = 0;
  // The same of two-view geometries, which are verified; how many of each configuration.
  size_t num_verified_pairs = 0, num_inliers = 0;
  std::map<TwoViewConfig, size_t> num_of_config;
  size_t num_line_matched_pairs = 0, num_line_matches = 0;
};

// A camera in words, for the settings of what depends on it.
std::string ToString(const Camera& camera);

// Whether a Database could be opened at `path` and written to; makes none. Throws InputError.
void ProbeDatabase(const std::filesystem::path& path);
// The same of one that must be there already.
void ProbeExistingDatabase(const std::filesystem::path& path);

// Removes a database that holds no camera and no image: what a command that then could not do its
// work has made.
void RemoveEmptyDatabase(const std::filesystem::path& path);

class Database {
 public:
  // Opens a database, or makes a new one with its parent folders.
  explicit Database(const std::filesystem::path& path);
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  const std::filesystem::path& path() const { return path_; }

  // All writes until Commit are done then, or, without it, never (also if the process ends).
  // Inside another one: part of it. Each Write function is whole by itself.
  class Transaction {
   public:
    explicit Transaction(Database* database);
    ~Transaction();  // undoes what was not committed
    Transaction(const Transaction&) = delete;
    Transaction& operator=(const Transaction&) = delete;
    void Commit();

   private:
    Database* database_;
    int depth_;
  };

  // COLMAP's tables.
  std::map<camera_t, DatabaseCamera> ReadCameras() const;
  std::map<image_t, DatabaseImage> ReadImages() const;
  std::optional<image_t> FindImage(const std::string& name) const;
  // Empty in databases of before COLMAP 3.12. Frames have no poses.
  std::map<rig_t, Rig> ReadRigs() const;
  std::map<frame_t, Frame> ReadFrames() const;
  // Adds it under this id, or (empty) under a new one. Returns the id. An image needs its camera,
  // and gets a trivial rig and frame if the database's other images have theirs (COLMAP 3.12 and
  // later).
  camera_t AddCamera(std::optional<camera_t> camera_id, const DatabaseCamera& camera);
  image_t AddImage(std::optional<image_t> image_id, const DatabaseImage& image);

  // Of the image, whose camera this is. Databases of before COLMAP 3.12 take the position only, in
  // their own columns.
  void WritePosePrior(image_t image_id, camera_t camera_id, const PosePrior& prior);
  // Of images that have one, in whatever way the database's version of COLMAP stores them.
  std::map<image_t, PosePrior> ReadPosePriors() const;

  // Empty: there is no such row. A write replaces what was there.
  std::optional<Keypoints> ReadKeypoints(image_t image_id) const;
  std::optional<size_t> NumKeypoints(image_t image_id) const;
  void WriteKeypoints(image_t image_id, const Keypoints& keypoints);
  bool HasDescriptors(image_t image_id) const;
  std::optional<Descriptors> ReadDescriptors(image_t image_id) const;
  void WriteDescriptors(image_t image_id, const Descriptors& descriptors);

  // Pairs in either order: the file holds the image with the smaller id first, these functions turn
  // what they are given and give. The indices are those of stored keypoints. Empty: no such row; a
  // row without matches means that matching was tried.
  std::optional<PointMatches> ReadMatches(image_t image_id1, image_t image_id2) const;
  void WriteMatches(image_t image_id1, image_t image_id2, const PointMatches& matches);
  std::optional<TwoViewGeometry> ReadTwoViewGeometry(image_t image_id1, image_t image_id2) const;
  void WriteTwoViewGeometry(image_t image_id1, image_t image_id2, const TwoViewGeometry& geometry);
  // Pairs with at least this many matches (inliers), in the order of ids.
  std::vector<ImagePair> MatchedPairs(size_t min_num_matches) const;
  std::vector<ImagePair> VerifiedPairs(size_t min_num_inliers) const;

  // Our tables. `settings` says how something was made (the detector, its options, the camera's
  // parameters); a read is empty if nothing is there or it was made with other settings. A write
  // replaces what was there, with whatever settings.
  std::optional<std::vector<LineSegment2d>> ReadSegments(image_t image_id,
                                                         const std::string& settings) const;
  // Those of what is stored, to read it however it was made; empty: there is nothing.
  std::optional<std::string> ReadSegmentSettings(image_t image_id) const;
  std::optional<std::string> ReadCornerSettings(image_t image_id) const;
  std::optional<std::string> ReadVanishingPointSettings(image_t image_id) const;
  std::optional<std::string> ReadLineMatchSettings(image_t image_id1, image_t image_id2) const;
  // What belongs to the old segments (descriptors, vanishing points, line matches) is removed.
  void WriteSegments(image_t image_id, const std::string& settings,
                     const std::vector<LineSegment2d>& segments);
  // Of the stored segments, kSegmentDescriptorSize values each.
  std::optional<std::vector<float>> ReadSegmentDescriptors(image_t image_id,
                                                           const std::string& settings) const;
  void WriteSegmentDescriptors(image_t image_id, const std::string& settings,
                               const std::vector<float>& descriptors);
  std::optional<ImageCorners> ReadCorners(image_t image_id, const std::string& settings) const;
  void WriteCorners(image_t image_id, const std::string& settings, const ImageCorners& corners);
  // With a label for each of the stored segments.
  std::optional<ImageVanishingPoints> ReadVanishingPoints(image_t image_id,
                                                          const std::string& settings) const;
  void WriteVanishingPoints(image_t image_id, const std::string& settings,
                            const ImageVanishingPoints& vanishing_points);
  std::optional<LabelMap> ReadLabelMap(image_t image_id, const std::string& settings) const;
  void WriteLabelMap(image_t image_id, const std::string& settings, const LabelMap& label_map);
  std::optional<std::map<uint16_t, RegionNormal>> ReadNormals(image_t image_id,
                                                              const std::string& settings) const;
  void WriteNormals(image_t image_id, const std::string& settings,
                    const std::map<uint16_t, RegionNormal>& normals);
  // Of the stored segments; pairs in either order, as above.
  std::optional<std::vector<LineMatch>> ReadLineMatches(image_t image_id1, image_t image_id2,
                                                        const std::string& settings) const;
  void WriteLineMatches(image_t image_id1, image_t image_id2, const std::string& settings,
                        const std::vector<LineMatch>& matches);

  // Of a pair's inliers, in the order of its two-view geometry; pairs in either order.
  std::optional<PairRepetition> ReadPairRepetition(image_t image_id1, image_t image_id2,
                                                   const std::string& settings) const;
  std::optional<std::string> ReadPairRepetitionSettings(image_t image_id1, image_t image_id2) const;
  void WritePairRepetition(image_t image_id1, image_t image_id2, const std::string& settings,
                           const PairRepetition& repetition);

  // The database's image for each of the model's, by name. Adds what is missing, with the model's
  // ids where they are free: images, their cameras, rigs and frames; the points of images without
  // keypoints (and an empty row of descriptors, so that COLMAP takes the image for done).
  // `names`: the database's name of images of the model that it has under another one.
  std::map<image_t, image_t> MatchImages(const Reconstruction& model,
                                         const std::map<std::string, std::string>& names = {});

  // What is there, in numbers.
  DatabaseSummary Summarise() const;

  // SQL without results, for what has no function here.
  void Execute(const std::string& sql);

 private:
  class Statement;

  void Close();
  void CheckSchema();
  void CreateColmapTables();
  void CreateOurTables();
  bool HasOurTables() const;
  bool HasTable(const std::string& table) const;
  bool HasColumn(const std::string& table, const std::string& column) const;
  [[noreturn]] void FailSql(int code, const std::string& sql) const;
  // A row that cannot be what was written there.
  [[noreturn]] void FailRow(const std::string& table, const std::string& key,
                            const std::string& message) const;

  // COLMAP takes frames for all images or for none: databases from before 3.12 have none, also when
  // a later COLMAP has made the tables for them.
  bool EveryImageHasAFrame() const;
  std::optional<rig_t> FindRigOfCamera(camera_t camera_id) const;
  rig_t RigOfCamera(camera_t camera_id);  // found, or a new trivial one
  void AddFrame(const std::vector<std::pair<image_t, camera_t>>& images);
  void AddRig(const Rig& rig, const std::map<camera_t, camera_t>& database_camera);
  std::map<camera_t, camera_t> MatchCameras(const Reconstruction& model,
                                            const std::map<image_t, image_t>& known,
                                            const std::map<image_t, DatabaseImage>& images);
  image_t InsertImage(std::optional<image_t> image_id, const DatabaseImage& image);
  std::vector<ImagePair> Pairs(const char* table, size_t min_rows) const;
  // `key`: the condition of the row, "image_id = 3".
  std::optional<std::string> StoredSettings(const char* table, const std::string& key) const;
  // Number of rows of an image in `table`; empty: no such row.
  std::optional<size_t> NumRows(const char* table, image_t image_id) const;
  void CheckMatches(const char* table, image_t id1, image_t id2, const PointMatches& matches) const;

  std::filesystem::path path_;
  sqlite3* handle_ = nullptr;
  int transaction_depth_ = 0;
  bool has_our_tables_ = false;
  bool has_rigs_ = false;             // tables rigs, rig_sensors, frames, frame_data
  bool has_descriptor_type_ = false;  // column descriptors.type
  bool has_two_view_pose_ = false;    // columns qvec, tvec of two_view_geometries
};

}  // namespace holba
