// SPDX-License-Identifier: BSD-3-Clause
// One SQL statement of a Database: bind, step through its rows, fetch columns; and the bytes of
// blobs (little-endian, without padding). Included by database*.cc only.
#pragma once

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "holba/io/database.h"

namespace holba {

static_assert(std::endian::native == std::endian::little, "blobs are little-endian");

// A camera in columns of types of sensors.
inline constexpr int kDatabaseCamera = static_cast<int>(SensorType::kCamera);

// The key of a row of an image, in messages and in conditions.
inline std::string ImageKey(image_t image_id) { return fmt::format("image_id = {}", image_id); }

class Database::Statement {
 public:
  Statement(const Database& database, std::string sql) : database_(database), sql_(std::move(sql)) {
    const int code = sqlite3_prepare_v2(database.handle_, sql_.c_str(),
                                        static_cast<int>(sql_.size()), &statement_, nullptr);
    if (code != SQLITE_OK) database_.FailSql(code, sql_);
  }
  ~Statement() { sqlite3_finalize(statement_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  // Values of the question marks, in order. Text and bytes must live until the last Step.
  Statement& Integer(int64_t value) {
    return Check(sqlite3_bind_int64(statement_, ++num_bound_, value));
  }
  Statement& Text(std::string_view text) {
    return Check(sqlite3_bind_text64(statement_, ++num_bound_, text.data(), text.size(),
                                     SQLITE_STATIC, SQLITE_UTF8));
  }
  Statement& Double(double value) {
    return Check(sqlite3_bind_double(statement_, ++num_bound_, value));
  }
  Statement& Null() { return Check(sqlite3_bind_null(statement_, ++num_bound_)); }
  template <typename T>
  Statement& Bytes(const T* data, size_t count) {
    // An empty blob, not NULL, for no elements.
    return Check(sqlite3_bind_blob64(statement_, ++num_bound_,
                                     count == 0 ? static_cast<const void*>("") : data,
                                     count * sizeof(T), SQLITE_STATIC));
  }
  template <typename T>
  Statement& Bytes(const std::vector<T>& values) {
    return Bytes(values.data(), values.size());
  }
  Statement& Bytes(const std::optional<std::vector<double>>& values) {
    return values ? Bytes(*values) : Null();
  }

  // False: there is no further row.
  bool Step() {
    const int code = sqlite3_step(statement_);
    if (code != SQLITE_ROW && code != SQLITE_DONE) database_.FailSql(code, sql_);
    return code == SQLITE_ROW;
  }
  void Run() {
    while (Step()) {
    }
  }

  // Columns of the row, from 0.
  bool IsNull(int column) const { return sqlite3_column_type(statement_, column) == SQLITE_NULL; }
  int64_t GetInteger(int column) const { return sqlite3_column_int64(statement_, column); }
  double GetDouble(int column) const { return sqlite3_column_double(statement_, column); }
  std::string GetText(int column) const {
    const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
    return text == nullptr ? std::string()
                           : std::string(text, sqlite3_column_bytes(statement_, column));
  }
  std::span<const uint8_t> GetBytes(int column) const {
    const auto* bytes = static_cast<const uint8_t*>(sqlite3_column_blob(statement_, column));
    if (bytes == nullptr) return {};
    return {bytes, static_cast<size_t>(sqlite3_column_bytes(statement_, column))};
  }
  // Empty: the blob has not this many elements, or a column of the file gives a count that makes no
  // sense (negative, more than fit into memory).
  template <typename T>
  std::optional<std::vector<T>> GetArray(int column, int64_t num_rows, int64_t num_cols) const {
    const std::span<const uint8_t> bytes = GetBytes(column);
    const auto num_values = static_cast<int64_t>(bytes.size() / sizeof(T));
    if (bytes.size() % sizeof(T) != 0 || num_rows < 0 || num_cols < 0 || num_rows > num_values ||
        (num_cols > 0 && num_rows > num_values / num_cols) || num_rows * num_cols != num_values) {
      return std::nullopt;
    }
    std::vector<T> values(num_values);
    if (!values.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
    return values;
  }

 private:
  Statement& Check(int code) {
    if (code != SQLITE_OK) database_.FailSql(code, sql_);
    return *this;
  }

  const Database& database_;
  const std::string sql_;
  sqlite3_stmt* statement_ = nullptr;
  int num_bound_ = 0;
};

// The condition of a pair's row in a table of ours; pairs in either order.
inline std::string OurPairKey(image_t image_id1, image_t image_id2) {
  return fmt::format("image_id1 = {} AND image_id2 = {}", std::min(image_id1, image_id2),
                     std::max(image_id1, image_id2));
}

template <typename T>
bool AllFinite(const std::vector<T>& values) {
  for (const T value : values) {
    if (!std::isfinite(value)) return false;
  }
  return true;
}

}  // namespace holba
