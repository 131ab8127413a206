// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/bzip2.h"

#include <bzlib.h>

#include <algorithm>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/error.h"

namespace holba {
namespace {

constexpr size_t kPieceSize = size_t{1} << 20;

// One packed stream.
class Stream {
 public:
  Stream() { HOLBA_CHECK(BZ2_bzDecompressInit(&stream_, 0, 0) == BZ_OK); }
  ~Stream() { BZ2_bzDecompressEnd(&stream_); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  // Appends what a piece of the input holds, and removes what was used of it. BZ_OK: there is more.
  int Unpack(std::string_view* packed, std::vector<char>* piece, std::string* unpacked) {
    const size_t given = std::min(packed->size(), kPieceSize);
    // The interface has no const; the input is not written to.
    stream_.next_in = const_cast<char*>(packed->data());
    stream_.avail_in = static_cast<unsigned>(given);
    stream_.next_out = piece->data();
    stream_.avail_out = static_cast<unsigned>(piece->size());
    const int result = BZ2_bzDecompress(&stream_);
    packed->remove_prefix(given - stream_.avail_in);
    unpacked->append(piece->data(), piece->size() - stream_.avail_out);
    has_output_ = stream_.avail_out == 0;
    return result;
  }
  // Whether the last piece was full, so that more may come without further input.
  bool has_output() const { return has_output_; }

 private:
  bz_stream stream_ = {};
  bool has_output_ = false;
};

}  // namespace

bool IsBzip2(std::string_view bytes) {
  return bytes.size() > 3 && bytes.starts_with("BZh") && bytes[3] >= '1' && bytes[3] <= '9';
}

std::string UnpackBzip2(std::string_view bytes, const std::filesystem::path& path, size_t at_most) {
  std::string unpacked;
  std::vector<char> piece(kPieceSize);
  while (IsBzip2(bytes) && unpacked.size() < at_most) {
    Stream stream;
    int result = BZ_OK;
    while (result == BZ_OK && unpacked.size() < at_most) {
      if (bytes.empty() && !stream.has_output())
        throw InputError(path,
                         "the end of the packed data (bzip2) is missing; fetch the file again");
      result = stream.Unpack(&bytes, &piece, &unpacked);
    }
    if (result != BZ_OK && result != BZ_STREAM_END)
      throw InputError(path, "the packed data (bzip2) is damaged; fetch the file again");
  }
  unpacked.resize(std::min(unpacked.size(), at_most));
  return unpacked;
}

}  // namespace holba
