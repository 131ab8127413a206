// SPDX-License-Identifier: BSD-3-Clause
// The binary form of records: little-endian fields without padding after a uint64 number of
// records. BinaryIn and TextIn (text_io.h) offer the same fields, so that a file of either form is
// read by one function; likewise BinaryOut and TextOut. Readers never trust a count: it is checked
// against the bytes that follow before memory is set aside.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <ostream>
#include <string>
#include <string_view>

#include "holba/base/error.h"
#include "holba/scene/types.h"

namespace holba {

static_assert(std::endian::native == std::endian::little, "binary files are little-endian");

class BinaryIn {
 public:
  static constexpr bool kBinary = true;

  // `path` is for messages only.
  BinaryIn(std::string_view bytes, const std::filesystem::path& path)
      : bytes_(bytes), path_(path) {}

  // Reads the number of records, each of at least `min_bytes`.
  void Begin(const char* what, size_t min_bytes) { num_left_ = Count(what, min_bytes); }
  size_t NumRecordsAtMost() const { return num_left_; }
  bool NextRecord() {
    record_ = position_;
    return num_left_ > 0 && num_left_-- > 0;
  }
  void EndRecord() {}
  void Finish() {
    field_ = position_;
    if (position_ != bytes_.size()) {
      Fail("expected the end of the file after its last record, found " +
           std::to_string(bytes_.size() - position_) + " more bytes");
    }
  }

  uint8_t Byte(const char* what) { return Read<uint8_t>(what); }
  uint32_t Index(const char* what) { return Read<uint32_t>(what); }
  uint64_t Number(const char* what) { return Read<uint64_t>(what); }
  int32_t Int32(const char* what) { return Read<int32_t>(what); }
  // An id or "none".
  uint64_t Id(const char* what) { return Read<uint64_t>(what); }
  // The id of a record: not "none".
  uint64_t Key(const char* what) {
    const uint64_t id = Read<uint64_t>(what);
    if (id == kNoId) Fail(std::string("expected ") + what + " (an id), found none (2^64 - 1)");
    return id;
  }
  uint32_t Key32(const char* what) {
    const uint32_t id = Read<uint32_t>(what);
    if (id == kInvalidId32)
      Fail(std::string("expected ") + what + " (an id), found none (2^32 - 1)");
    return id;
  }
  double Real(const char* what) {
    const double value = Read<double>(what);
    if (!std::isfinite(value)) {
      Fail(std::string("expected ") + what + " (a finite number), found " +
           (std::isnan(value) ? "nan" : "inf"));
    }
    return value;
  }
  // Number of elements of at least `min_bytes` each.
  size_t Count(const char* what, size_t min_bytes) {
    return CheckCount(Read<uint64_t>(what), what, min_bytes);
  }
  size_t Count32(const char* what, size_t min_bytes) {
    return CheckCount(Read<uint32_t>(what), what, min_bytes);
  }
  // A list that text ends with the line and binary precedes by its length:
  // for (size_t list = in.List("TRACK_LENGTH", 8); in.More(&list);) ...
  size_t List(const char* what, size_t min_bytes) { return Count(what, min_bytes); }
  bool More(size_t* list) { return *list > 0 && (*list)-- > 0; }

  // Up to the next zero byte.
  std::string_view ZeroTerminated(const char* what) {
    field_ = position_;
    const size_t end = bytes_.find('\0', position_);
    if (end == std::string_view::npos) {
      Fail(std::string("expected ") + what +
           " (text that ends with a zero byte), found the end of the file: it is truncated");
    }
    const std::string_view text = bytes_.substr(position_, end - position_);
    position_ = end + 1;
    return text;
  }

  // At the field read last.
  [[noreturn]] void Fail(const std::string& message) const {
    throw InputError::AtByte(path_, field_, message);
  }
  // At the beginning of the record.
  [[noreturn]] void FailRecord(const std::string& message) const {
    throw InputError::AtByte(path_, record_, message);
  }
  // Place for a message that is only known later.
  uint64_t Place() const { return record_; }
  [[noreturn]] void FailAt(uint64_t place, const std::string& message) const {
    throw InputError::AtByte(path_, place, message);
  }

 private:
  template <typename T>
  T Read(const char* what) {
    field_ = position_;
    if (bytes_.size() - position_ < sizeof(T)) {
      Fail(std::string("expected ") + what + " (" + std::to_string(sizeof(T)) +
           " bytes), found the end of the file: it is truncated");
    }
    T value;
    std::memcpy(&value, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    return value;
  }
  size_t CheckCount(uint64_t count, const char* what, size_t min_bytes) const {
    const size_t left = bytes_.size() - position_;
    if (count > left / min_bytes) {
      Fail(std::string("expected ") + what + " (at most " + std::to_string(left / min_bytes) +
           ", as " + std::to_string(left) + " bytes follow), found " + std::to_string(count) +
           ": the file is truncated or damaged");
    }
    return count;
  }

  std::string_view bytes_;
  const std::filesystem::path path_;
  size_t position_ = 0;
  size_t field_ = 0;
  size_t record_ = 0;
  size_t num_left_ = 0;
};

class BinaryOut {
 public:
  static constexpr bool kBinary = true;

  explicit BinaryOut(std::ostream* stream) : stream_(stream) {}
  ~BinaryOut() { Flush(); }
  BinaryOut(const BinaryOut&) = delete;
  BinaryOut& operator=(const BinaryOut&) = delete;

  void Begin(uint64_t num_records) { Write(num_records); }
  void EndRecord() {
    if (buffer_.size() >= kFlushSize) Flush();
  }
  void Byte(uint8_t value) { Write(value); }
  void Index(uint32_t value) { Write(value); }
  void Number(uint64_t value) { Write(value); }
  void Int32(int32_t value) { Write(value); }
  void Id(uint64_t value) { Write(value); }
  void Real(double value) { Write(value); }
  void Count(uint64_t value) { Write(value); }
  void List(uint64_t size) { Write(size); }
  void ZeroTerminated(std::string_view text) {
    buffer_.append(text);
    buffer_.push_back('\0');
  }

 private:
  static constexpr size_t kFlushSize = size_t{1} << 20;

  template <typename T>
  void Write(T value) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    buffer_.append(bytes, sizeof(T));
  }
  void Flush() {
    stream_->write(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
    buffer_.clear();
  }

  std::ostream* stream_;
  std::string buffer_;
};

}  // namespace holba
