// SPDX-License-Identifier: BSD-3-Clause
// Opening, tables, transactions and faults of a Database.
#include "holba/io/database.h"

#include <array>
#include <cstdlib>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/io/database_statement.h"
#include "holba/io/files.h"

namespace holba {
namespace {

constexpr int kOurVersion = 1;
constexpr int kBusyTimeoutMs = 10000;  // COLMAP may be writing at the same time

// The tables of COLMAP 4.2. Its 3.8 works with them, too: for it images have the columns prior_*
// (which 4 ignores) and descriptors.type has a default.
constexpr const char* kColmapTables = R"sql(
CREATE TABLE rigs (rig_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,
  ref_sensor_id INTEGER NOT NULL, ref_sensor_type INTEGER NOT NULL);
CREATE UNIQUE INDEX rig_ref_sensor_assignment ON rigs(ref_sensor_id, ref_sensor_type);
CREATE TABLE rig_sensors (rig_id INTEGER NOT NULL, sensor_id INTEGER NOT NULL,
  sensor_type INTEGER NOT NULL, sensor_from_rig BLOB,
  FOREIGN KEY(rig_id) REFERENCES rigs(rig_id) ON DELETE CASCADE);
CREATE UNIQUE INDEX rig_sensor_assignment ON rig_sensors(sensor_id, sensor_type);
CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER NOT NULL,
  width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB,
  prior_focal_length INTEGER NOT NULL);
CREATE TABLE frames (frame_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, rig_id INTEGER NOT NULL,
  FOREIGN KEY(rig_id) REFERENCES rigs(rig_id) ON DELETE CASCADE);
CREATE TABLE frame_data (frame_id INTEGER NOT NULL, data_id INTEGER NOT NULL,
  sensor_id INTEGER NOT NULL, sensor_type INTEGER NOT NULL,
  FOREIGN KEY(frame_id) REFERENCES frames(frame_id) ON DELETE CASCADE);
CREATE UNIQUE INDEX frame_sensor_assignment ON frame_data(data_id, sensor_type);
CREATE TABLE images (image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,
  name TEXT NOT NULL UNIQUE, camera_id INTEGER NOT NULL,
  prior_qw REAL, prior_qx REAL, prior_qy REAL, prior_qz REAL,
  prior_tx REAL, prior_ty REAL, prior_tz REAL,
  CONSTRAINT image_id_check CHECK(image_id >= 0 and image_id < 2147483647),
  FOREIGN KEY(camera_id) REFERENCES cameras(camera_id));
CREATE UNIQUE INDEX index_name ON images(name);
CREATE TABLE pose_priors (pose_prior_id INTEGER PRIMARY KEY NOT NULL,
  corr_data_id INTEGER NOT NULL, corr_sensor_id INTEGER NOT NULL,
  corr_sensor_type INTEGER NOT NULL, position BLOB, position_covariance BLOB, gravity BLOB,
  coordinate_system INTEGER NOT NULL);
CREATE UNIQUE INDEX pose_prior_data_assignment
  ON pose_priors(corr_data_id, corr_sensor_id, corr_sensor_type);
CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
  cols INTEGER NOT NULL, data BLOB,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY NOT NULL, type INTEGER NOT NULL DEFAULT 0,
  rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE matches (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
  cols INTEGER NOT NULL, data BLOB);
CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
  cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB,
  qvec BLOB, tvec BLOB, camera1 BLOB, camera2 BLOB);
PRAGMA user_version = 4020100;
)sql";

// Every table of ours goes with its images; what blobs hold: database_features.cc.
constexpr const char* kOurTables = R"sql(
CREATE TABLE holba_version (version INTEGER NOT NULL);
CREATE TABLE holba_segments (image_id INTEGER PRIMARY KEY NOT NULL, settings TEXT NOT NULL,
  rows INTEGER NOT NULL, data BLOB NOT NULL,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE holba_segment_descriptors (image_id INTEGER PRIMARY KEY NOT NULL,
  settings TEXT NOT NULL, rows INTEGER NOT NULL, data BLOB NOT NULL,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE holba_corners (image_id INTEGER PRIMARY KEY NOT NULL, settings TEXT NOT NULL,
  rows INTEGER NOT NULL, data BLOB NOT NULL, descriptors BLOB,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE holba_vanishing_points (image_id INTEGER PRIMARY KEY NOT NULL,
  settings TEXT NOT NULL, rows INTEGER NOT NULL, data BLOB NOT NULL, support BLOB NOT NULL,
  num_segments INTEGER NOT NULL, vp_of_segment BLOB NOT NULL,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE holba_label_maps (image_id INTEGER PRIMARY KEY NOT NULL, settings TEXT NOT NULL,
  width INTEGER NOT NULL, height INTEGER NOT NULL, types TEXT NOT NULL, data BLOB NOT NULL,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE holba_normals (image_id INTEGER PRIMARY KEY NOT NULL, settings TEXT NOT NULL,
  rows INTEGER NOT NULL, labels BLOB NOT NULL, data BLOB NOT NULL,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE holba_line_matches (image_id1 INTEGER NOT NULL, image_id2 INTEGER NOT NULL,
  settings TEXT NOT NULL, rows INTEGER NOT NULL, data BLOB NOT NULL, distances BLOB NOT NULL,
  PRIMARY KEY(image_id1, image_id2), CHECK(image_id1 < image_id2),
  FOREIGN KEY(image_id1) REFERENCES images(image_id) ON DELETE CASCADE,
  FOREIGN KEY(image_id2) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE INDEX holba_line_matches_image2 ON holba_line_matches(image_id2);
)sql";

struct TableColumns {
  const char* table;
  std::vector<const char*> columns;
};
// What must be there for a database to be COLMAP's.
const std::vector<TableColumns>& RequiredColumns() {
  static const std::vector<TableColumns> required = {
      {"cameras", {"camera_id", "model", "width", "height", "params", "prior_focal_length"}},
      {"images", {"image_id", "name", "camera_id"}},
      {"keypoints", {"image_id", "rows", "cols", "data"}},
      {"descriptors", {"image_id", "rows", "cols", "data"}},
      {"matches", {"pair_id", "rows", "cols", "data"}},
      {"two_view_geometries", {"pair_id", "rows", "cols", "data", "config", "F", "E", "H"}},
  };
  return required;
}

}  // namespace

Database::Database(const std::filesystem::path& path) : path_(path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    throw FileIsWanted(path);
  }
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path(), error);
  const int code =
      sqlite3_open_v2(path.c_str(), &handle_, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, nullptr);
  try {
    if (code != SQLITE_OK) FailSql(code, "open");
    sqlite3_extended_result_codes(handle_, 1);
    sqlite3_busy_timeout(handle_, kBusyTimeoutMs);
    if (sqlite3_db_readonly(handle_, "main") == 1) {
      throw InputError(path,
                       "the database is write-protected; change its permissions or use a copy");
    }
    Execute("PRAGMA foreign_keys = ON");
    Execute("PRAGMA temp_store = MEMORY");
    CheckSchema();
  } catch (...) {
    Close();
    throw;
  }
}

void ProbeDatabase(const std::filesystem::path& path) {
  std::error_code error;
  const uintmax_t size = std::filesystem::file_size(path, error);
  // An empty file is one that a database will be made in.
  if (error || size == 0) {
    if (std::filesystem::is_directory(path)) {
      throw FileIsWanted(path);
    }
    return ProbeFile(path);
  }
  Database database(path);
  const Database::Transaction undone(&database);
}

void ProbeExistingDatabase(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) {
    throw InputError(
        path, "there is no such database; make it with 'holba extract', or check --database_path");
  }
  if (!std::filesystem::is_regular_file(path)) throw FileIsWanted(path);
  ProbeDatabase(path);
}

void RemoveEmptyDatabase(const std::filesystem::path& path) {
  {
    const Database database(path);
    if (!database.ReadCameras().empty() || !database.ReadImages().empty()) return;
  }
  std::filesystem::remove(path);
}

Database::~Database() { Close(); }

void Database::Close() {
  sqlite3_close(handle_);
  handle_ = nullptr;
}

void Database::CheckSchema() {
  // Also tells whether the file is a database at all.
  const auto is_empty = [this] {
    Statement count(*this, "SELECT COUNT(*) FROM sqlite_master");
    return count.Step() && count.GetInteger(0) == 0;
  };
  if (is_empty()) {
    // As COLMAP: readers and one writer at a time, and a commit without waiting for the disk twice.
    Execute("PRAGMA journal_mode = WAL");
    CreateColmapTables();
  }
  Execute("PRAGMA synchronous = NORMAL");
  if (HasTable("inlier_matches") ||
      (HasTable("two_view_geometries") && !HasColumn("two_view_geometries", "F"))) {
    throw InputError(path_,
                     "the database was made by a COLMAP before 3.0; bring it up to date with "
                     "`colmap database_creator --database_path` and this file");
  }
  for (const auto& [table, columns] : RequiredColumns()) {
    const std::string remedy =
        "give a database of COLMAP, or a file that does not exist yet to make one";
    if (!HasTable(table)) throw InputError(path_, fmt::format("no table '{}'; {}", table, remedy));
    for (const char* column : columns) {
      if (!HasColumn(table, column)) {
        throw InputError(path_,
                         fmt::format("no column '{}' in table '{}'; {}", column, table, remedy));
      }
    }
  }
  has_rigs_ =
      HasTable("rigs") && HasTable("rig_sensors") && HasTable("frames") && HasTable("frame_data");
  has_descriptor_type_ = HasColumn("descriptors", "type");
  has_two_view_pose_ =
      HasColumn("two_view_geometries", "qvec") && HasColumn("two_view_geometries", "tvec");
  if (HasTable("holba_version")) {
    Statement version(*this, "SELECT version FROM holba_version");
    if (!version.Step() || version.GetInteger(0) < 1) {
      throw InputError(path_,
                       "the database is damaged (its table holba_version holds no version); delete "
                       "all tables named holba_* (DROP TABLE), which are then made anew");
    }
    if (version.GetInteger(0) > kOurVersion) {
      throw InputError(path_,
                       fmt::format("its tables holba_* have version {}, this program knows "
                                   "versions up to {}; use a newer holba, or another database",
                                   version.GetInteger(0), kOurVersion));
    }
    has_our_tables_ = true;
  }
}

bool Database::HasOurTables() const { return has_our_tables_ || HasTable("holba_version"); }

void Database::CreateColmapTables() {
  Transaction transaction(this);
  // Another program may have been quicker.
  if (!HasTable("images")) Execute(kColmapTables);
  transaction.Commit();
}

void Database::CreateOurTables() {
  if (has_our_tables_) return;
  Transaction transaction(this);
  if (!HasTable("holba_version")) {
    Execute(kOurTables);
    Statement(*this, "INSERT INTO holba_version(version) VALUES(?)").Integer(kOurVersion).Run();
  }
  transaction.Commit();
  // If an outer transaction is undone, so are the tables; then this is found out again.
  has_our_tables_ = transaction_depth_ == 0;
}

bool Database::HasTable(const std::string& table) const {
  Statement find(*this, "SELECT name FROM sqlite_master WHERE type = 'table' AND name = ?");
  return find.Text(table).Step();
}

bool Database::HasColumn(const std::string& table, const std::string& column) const {
  Statement find(*this, "SELECT name FROM pragma_table_info(?) WHERE name = ?");
  return find.Text(table).Text(column).Step();
}

void Database::Execute(const std::string& sql) {
  const int code = sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) FailSql(code, sql);
}

void Database::FailSql(int code, const std::string& sql) const {
  constexpr const char* kMakeAnew = "use a copy, or delete it and extract and match anew";
  const std::string said = handle_ == nullptr ? sqlite3_errstr(code) : sqlite3_errmsg(handle_);
  switch (code & 0xff) {
    case SQLITE_NOTADB:
      throw InputError(path_,
                       "this is no SQLite database; give a COLMAP database, or a file that does "
                       "not exist yet to make one");
    case SQLITE_CORRUPT:
      throw InputError(path_, fmt::format("the database is damaged ({}); {}", said, kMakeAnew));
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      throw InputError(path_,
                       "another program is using the database; try again when it has finished");
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
    case SQLITE_READONLY:
      throw InputError(path_, fmt::format("the database cannot be opened for writing ({}); check "
                                          "the folder and the permissions",
                                          said));
    case SQLITE_FULL:
    case SQLITE_IOERR:
      throw InputError(
          path_,
          fmt::format(
              "the database cannot be read or written ({}); check the disk and its free space",
              said));
    case SQLITE_CONSTRAINT:
      throw InputError(path_, fmt::format("an id or a name is taken already, or belongs to nothing "
                                          "in the database ({}, in {}); {}",
                                          said, sql, kMakeAnew));
    default:
      throw InputError(path_, fmt::format("the database cannot be used ({}, code {}, in {}); {}",
                                          said, code, sql, kMakeAnew));
  }
}

void Database::FailRow(const std::string& table, const std::string& key,
                       const std::string& message) const {
  const std::string again = table.starts_with("holba_")
                                ? "it is made anew"
                                : "COLMAP (or what made the database) makes it anew";
  throw InputError(
      path_,
      fmt::format("table {}, {}: {}; delete this damaged row (DELETE FROM {} WHERE {}), so that {}",
                  table, key, message, table, key, again));
}

Database::Transaction::Transaction(Database* database)
    : database_(database), depth_(database->transaction_depth_) {
  // Immediate: a writer that waits at the start instead of failing in the middle.
  database_->Execute(depth_ == 0 ? "BEGIN IMMEDIATE" : fmt::format("SAVEPOINT holba_{}", depth_));
  ++database_->transaction_depth_;
}

Database::Transaction::~Transaction() {
  if (database_ == nullptr) return;
  database_->transaction_depth_ = depth_;
  // SQLite undoes by itself after some faults; then there is nothing left to undo.
  const std::string undo =
      depth_ == 0 ? "ROLLBACK" : fmt::format("ROLLBACK TO holba_{0}; RELEASE holba_{0}", depth_);
  sqlite3_exec(database_->handle_, undo.c_str(), nullptr, nullptr, nullptr);
}

void Database::Transaction::Commit() {
  HOLBA_CHECK_MSG(database_ != nullptr, "a transaction is committed twice");
  HOLBA_CHECK_MSG(database_->transaction_depth_ == depth_ + 1,
                  "a transaction ends while one inside it has not");
  database_->Execute(depth_ == 0 ? "COMMIT" : fmt::format("RELEASE holba_{}", depth_));
  database_->transaction_depth_ = depth_;
  database_ = nullptr;
}

}  // namespace holba
