// SPDX-License-Identifier: BSD-3-Clause
// What the tests of importers share: folders that go away, writers of the formats, a small model.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>
#include <zlib.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "holba/base/base64_testing.h"
#include "holba/base/error.h"
#include "holba/camera/camera_model.h"
#include "holba/scene/reconstruction.h"

namespace holba {

class TestFolder {
 public:
  TestFolder() {
    std::string name = (std::filesystem::path(testing::TempDir()) / "holba_XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~TestFolder() { std::filesystem::remove_all(path_); }
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path Write(const std::string& name, std::string_view bytes) const {
    const std::filesystem::path path = path_ / name;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary)
        .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return path;
  }

 private:
  std::filesystem::path path_;
};

// The message of an InputError; empty: none was thrown.
template <typename F>
std::string MessageOf(F&& f) {
  try {
    f();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

// Version 1.0 of npy by hand, little endian; `descr` as '<f4'.
template <typename T>
std::string Npy(const std::string& descr, const std::string& shape, const std::vector<T>& values) {
  std::string header =
      "{'descr': '" + descr + "', 'fortran_order': False, 'shape': " + shape + ", }";
  header.resize((10 + header.size() + 64) / 64 * 64 - 10, ' ');
  header.back() = '\n';
  std::string bytes = "\x93NUMPY";
  bytes += '\1';
  bytes += '\0';
  bytes += static_cast<char>(header.size() & 0xffu);
  bytes += static_cast<char>(header.size() >> 8);
  bytes += header;
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
  return bytes;
}

inline std::string Number(uint64_t value, int num_bytes) {
  std::string bytes;
  for (int i = 0; i < num_bytes; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xffu);
  return bytes;
}

// A zip archive of stored entries (name, bytes).
inline std::string Zip(const std::vector<std::pair<std::string, std::string>>& entries) {
  std::string bytes, directory;
  for (const auto& [name, data] : entries) {
    const uint32_t crc = static_cast<uint32_t>(
        crc32(0, reinterpret_cast<const Bytef*>(data.data()), static_cast<uInt>(data.size())));
    const std::string common = Number(20, 2) + Number(0, 2) + Number(0, 2) + Number(0, 4) +
                               Number(crc, 4) + Number(data.size(), 4) + Number(data.size(), 4) +
                               Number(name.size(), 2) + Number(0, 2);
    directory += "PK\x01\x02" + Number(20, 2) + common + Number(0, 2) + Number(0, 2) +
                 Number(0, 2) + Number(0, 4) + Number(bytes.size(), 4) + name;
    bytes += "PK\x03\x04" + common + name + data;
  }
  return bytes + directory + "PK\x05\x06" + Number(0, 4) + Number(entries.size(), 2) +
         Number(entries.size(), 2) + Number(directory.size(), 4) + Number(bytes.size(), 4) +
         Number(0, 2);
}

inline std::string BigEndian32(uint64_t value) {
  std::string bytes = Number(value, 4);
  return {bytes.rbegin(), bytes.rend()};
}

inline std::string PngChunk(const std::string& type, const std::string& data) {
  const std::string body = type + data;
  const uLong crc =
      crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()));
  return BigEndian32(data.size()) + body + BigEndian32(crc);
}

// A PNG whose rows (without the filter's byte) are as they are packed in it. `filter` is only
// stated: rows must be filtered already.
inline std::string Png(int width, int height, int bit_depth, int colour_type,
                       const std::vector<std::string>& rows, int filter = 0, int interlace = 0) {
  std::string raw;
  for (const std::string& row : rows) raw += static_cast<char>(filter) + row;
  uLongf size = compressBound(static_cast<uLong>(raw.size()));
  std::string packed(size, '\0');
  compress(reinterpret_cast<Bytef*>(packed.data()), &size,
           reinterpret_cast<const Bytef*>(raw.data()), static_cast<uLong>(raw.size()));
  packed.resize(size);
  const std::string header = BigEndian32(static_cast<uint64_t>(width)) +
                             BigEndian32(static_cast<uint64_t>(height)) +
                             static_cast<char>(bit_depth) + static_cast<char>(colour_type) + '\0' +
                             '\0' + static_cast<char>(interlace);
  std::string palette;
  if (colour_type == 3) palette = PngChunk("PLTE", std::string(3 * 256, '\x40'));
  return std::string("\x89PNG\r\n\x1a\n", 8) + PngChunk("IHDR", header) + palette +
         PngChunk("IDAT", packed) + PngChunk("IEND", "");
}

// An 8-bit grey PNG of labels(x, y).
template <typename F>
std::string LabelPng(int width, int height, F&& label) {
  std::vector<std::string> rows(static_cast<size_t>(height));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) rows[y] += static_cast<char>(label(x, y));
  }
  return Png(width, height, 8, 0, rows);
}

// Images 1 "dir/a.jpg", 2 "b.jpg", 3 "c.jpg" of one pinhole camera of 100 x 80 pixels, f 90.
inline Reconstruction SmallImportModel() {
  Reconstruction model;
  Camera camera;
  camera.model = FindCameraModel("PINHOLE");
  camera.width = 100;
  camera.height = 80;
  camera.params = {90.0, 90.0, 50.0, 40.0};
  model.cameras.Add(1, camera);
  const char* names[] = {"dir/a.jpg", "b.jpg", "c.jpg"};
  for (image_t id = 1; id <= 3; ++id) {
    Image image;
    image.name = names[id - 1];
    image.camera_id = 1;
    model.images.Add(id, image);
  }
  model.AddTrivialRigsAndFrames();
  return model;
}

}  // namespace holba
