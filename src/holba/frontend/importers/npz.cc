// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/npz.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <optional>

#include "holba/base/check.h"
#include "holba/base/error.h"

namespace holba {
namespace {

constexpr char kNpyRemedy[] = "write plain numbers: numpy.save(path, array.astype('float32'))";
constexpr char kZipRemedy[] = "write it again with numpy.savez or numpy.savez_compressed";

// Little-endian numbers at a place that may not be in the bytes.
template <typename T>
std::optional<T> Peek(std::string_view bytes, uint64_t offset) {
  if (offset > bytes.size() || bytes.size() - offset < sizeof(T)) return std::nullopt;
  T value = 0;
  for (size_t i = sizeof(T); i-- > 0;) {
    value = static_cast<T>((uint64_t{value} << 8) | static_cast<uint8_t>(bytes[offset + i]));
  }
  return value;
}

// The Python literal {'descr': '<f4', 'fortran_order': False, 'shape': (3, 4), }.
class HeaderParser {
 public:
  HeaderParser(std::string_view text, const std::string& place) : text_(text), place_(place) {}

  void Parse() {
    Expect('{');
    while (!Take('}')) {
      const std::string key = Quoted();
      Expect(':');
      if (key == "descr") {
        if (Next() == '[') {
          Fail("holds records (a structured type)");
        }
        descr = Quoted();
      } else if (key == "fortran_order") {
        fortran_order = Word() == "True";
      } else if (key == "shape") {
        Shape();
        has_shape = true;
      } else {
        Fail("has an unknown key '" + key.substr(0, 40) + "' in its header");
      }
      if (!Take(',')) {
        Expect('}');
        break;
      }
    }
    if (descr.empty() || !has_shape) Fail("lacks its type or its shape");
  }

  [[noreturn]] void Fail(const std::string& message) const {
    throw InputError(place_ + ": the array " + message + "; " + kNpyRemedy);
  }

  std::string descr;
  bool fortran_order = false;
  bool has_shape = false;
  std::vector<uint64_t> shape;

 private:
  char Next() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n')) ++at_;
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  bool Take(char c) {
    if (Next() != c) return false;
    ++at_;
    return true;
  }
  void Expect(char c) {
    if (!Take(c)) Fail(fmt::format("has a damaged header: expected '{}' at character {}", c, at_));
  }
  std::string Quoted() {
    const char quote = Next();
    if (quote != '\'' && quote != '"') {
      Fail(fmt::format("has a damaged header: expected a quoted word at character {}", at_));
    }
    const size_t end = text_.find(quote, at_ + 1);
    if (end == std::string_view::npos) Fail("has a damaged header: a quote is not closed");
    const std::string word(text_.substr(at_ + 1, end - at_ - 1));
    at_ = end + 1;
    return word;
  }
  std::string_view Word() {
    Next();
    const size_t begin = at_;
    while (at_ < text_.size() &&
           ((text_[at_] >= 'a' && text_[at_] <= 'z') || (text_[at_] >= 'A' && text_[at_] <= 'Z'))) {
      ++at_;
    }
    const std::string_view word = text_.substr(begin, at_ - begin);
    if (word != "True" && word != "False") Fail("has a damaged header: expected True or False");
    return word;
  }
  void Shape() {
    Expect('(');
    while (!Take(')')) {
      Next();
      uint64_t extent;
      const char* end_of_text = text_.data() + text_.size();
      const auto [end, error] = std::from_chars(text_.data() + at_, end_of_text, extent);
      if (error != std::errc() || shape.size() == 32) Fail("has a damaged shape in its header");
      shape.push_back(extent);
      at_ = static_cast<size_t>(end - text_.data());
      if (at_ < text_.size() && text_[at_] == 'L') ++at_;  // long integers of Python 2
      if (!Take(',')) {
        Expect(')');
        break;
      }
    }
  }

  std::string_view text_;
  const std::string& place_;
  size_t at_ = 0;
};

std::optional<ElementType> TypeOf(char kind, char digit) {
  struct Known {
    char kind, digit;
    ElementType type;
  };
  constexpr Known kKnown[] = {
      {'b', '1', ElementType::kBool},    {'i', '1', ElementType::kInt8},
      {'i', '2', ElementType::kInt16},   {'i', '4', ElementType::kInt32},
      {'i', '8', ElementType::kInt64},   {'u', '1', ElementType::kUInt8},
      {'u', '2', ElementType::kUInt16},  {'u', '4', ElementType::kUInt32},
      {'u', '8', ElementType::kUInt64},  {'f', '2', ElementType::kFloat16},
      {'f', '4', ElementType::kFloat32}, {'f', '8', ElementType::kFloat64},
  };
  for (const Known& known : kKnown) {
    if (known.kind == kind && known.digit == digit) return known.type;
  }
  return std::nullopt;
}

void ReverseElements(size_t size, std::string* bytes) {
  for (size_t at = 0; at + size <= bytes->size(); at += size) {
    std::reverse(bytes->begin() + at, bytes->begin() + at + size);
  }
}

// First index fastest -> last index fastest.
void ToRowOrder(const std::vector<uint64_t>& shape, size_t element, std::string* bytes) {
  std::vector<uint64_t> stride(shape.size(), 1);
  for (size_t i = 1; i < shape.size(); ++i) stride[i] = stride[i - 1] * shape[i - 1];
  std::string rows(bytes->size(), '\0');
  std::vector<uint64_t> index(shape.size(), 0);
  uint64_t from = 0;
  for (size_t to = 0; to < rows.size(); to += element) {
    std::memcpy(rows.data() + to, bytes->data() + from * element, element);
    for (size_t i = shape.size(); i-- > 0;) {
      from += stride[i];
      if (++index[i] < shape[i]) break;
      from -= stride[i] * shape[i];
      index[i] = 0;
    }
  }
  *bytes = std::move(rows);
}

}  // namespace

NumericArray ParseNpy(std::string_view bytes, const std::string& place) {
  const auto fail = [&](const std::string& message) {
    throw InputError(place + ": " + message + "; " + kNpyRemedy);
  };
  if (!bytes.starts_with("\x93NUMPY") || bytes.size() < 10) {
    fail("this is no array of numpy (.npy)");
  }
  const int version = static_cast<uint8_t>(bytes[6]);
  if (version < 1 || version > 3) {
    fail(fmt::format("version {} of .npy is not known (1 to 3 are)", version));
  }
  const size_t header_at = version == 1 ? 10 : 12;
  std::optional<uint32_t> stated = Peek<uint32_t>(bytes, 8);
  if (version == 1) stated = *Peek<uint16_t>(bytes, 8);
  if (!stated || bytes.size() - header_at < *stated) {
    fail("the array is truncated in its header");
  }
  HeaderParser header(bytes.substr(header_at, *stated), place);
  header.Parse();

  const std::string& descr = header.descr;
  if (descr.find('O') != std::string::npos) {
    header.Fail("holds pickled Python objects, which are not read (they could run code)");
  }
  const std::optional<ElementType> type =
      descr.size() == 3 ? TypeOf(descr[1], descr[2]) : std::nullopt;
  const char order = descr[0];
  if (!type || (order != '<' && order != '>' && order != '|' && order != '=')) {
    header.Fail("is of type '" + descr.substr(0, 40) +
                "', expected numbers (bool, int8 to uint64, float16 to float64)");
  }
  NumericArray array;
  array.shape = header.shape;
  array.type = *type;
  uint64_t expected;
  if (!ArrayBytes(array.shape, array.type, &expected)) {
    header.Fail(fmt::format("is larger than {} MiB, the most that is read", kMaxArrayBytes >> 20));
  }
  const std::string_view data = bytes.substr(header_at + *stated);
  if (data.size() != expected) {
    header.Fail(fmt::format("has {} bytes of numbers, expected {} of a {}, so that it is {}",
                            data.size(), expected, array.ShapeText(),
                            data.size() < expected ? "truncated" : "damaged"));
  }
  array.bytes = data;
  const size_t element = BytesOf(array.type);
  constexpr bool kLittle = std::endian::native == std::endian::little;
  if (element > 1 && order == (kLittle ? '>' : '<')) ReverseElements(element, &array.bytes);
  if (header.fortran_order && array.shape.size() > 1) {
    ToRowOrder(array.shape, element, &array.bytes);
  }
  return array;
}

void NpzArchive::Fail(const std::string& message) const {
  throw InputError(path_, message + "; " + kZipRemedy);
}

NpzArchive::NpzArchive(std::string bytes, const std::filesystem::path& path)
    : bytes_(std::move(bytes)), path_(path) {
  // The end record is 22 bytes and a comment of up to 65535.
  constexpr size_t kEndSize = 22;
  constexpr size_t kMaxComment = 65535;
  const std::string_view all = bytes_;
  if (!all.starts_with("PK")) Fail("this is no archive of numpy (.npz)");
  size_t end_at = std::string_view::npos;
  for (size_t back = kEndSize; back <= std::min(all.size(), kEndSize + kMaxComment); ++back) {
    const size_t at = all.size() - back;
    if (all.substr(at, 4) == "PK\x05\x06" && *Peek<uint16_t>(all, at + 20) == back - kEndSize) {
      end_at = at;
      break;
    }
  }
  if (end_at == std::string_view::npos) Fail("the archive is truncated (it has no end record)");
  uint64_t num_entries = *Peek<uint16_t>(all, end_at + 10);
  uint64_t directory_size = *Peek<uint32_t>(all, end_at + 12);
  uint64_t at = *Peek<uint32_t>(all, end_at + 16);
  constexpr size_t kLocatorSize = 20;
  if (end_at >= kLocatorSize && all.substr(end_at - kLocatorSize, 4) == "PK\x06\x07") {
    const uint64_t end64_at = *Peek<uint64_t>(all, end_at - kLocatorSize + 8);
    if (end64_at > all.size() || all.substr(end64_at, 4) != "PK\x06\x06" ||
        all.size() - end64_at < 56) {
      Fail("the archive's zip64 record is damaged");
    }
    num_entries = *Peek<uint64_t>(all, end64_at + 32);
    directory_size = *Peek<uint64_t>(all, end64_at + 40);
    at = *Peek<uint64_t>(all, end64_at + 48);
  }
  if (at > end_at || directory_size > end_at - at) {
    Fail("the archive is truncated (its table of contents lies outside of it)");
  }
  const std::string_view directory = all.substr(0, at + directory_size);
  const auto fail_entry = [&](uint64_t i) {
    Fail(fmt::format("entry {} of the archive's table of contents is damaged", i));
  };
  uint64_t packed_left = all.size();  // entries that share their bytes could make a bomb
  for (uint64_t i = 0; i < num_entries; ++i) {
    constexpr size_t kHeaderSize = 46;
    if (directory.substr(at, 4) != "PK\x01\x02" || directory.size() - at < kHeaderSize) {
      fail_entry(i);
    }
    const uint16_t flags = *Peek<uint16_t>(directory, at + 8);
    Entry entry;
    entry.method = *Peek<uint16_t>(directory, at + 10);
    entry.crc32 = *Peek<uint32_t>(directory, at + 16);
    entry.packed_size = *Peek<uint32_t>(directory, at + 20);
    entry.size = *Peek<uint32_t>(directory, at + 24);
    entry.header_offset = *Peek<uint32_t>(directory, at + 42);
    const size_t name_size = *Peek<uint16_t>(directory, at + 28);
    const size_t extra_size = *Peek<uint16_t>(directory, at + 30);
    const size_t comment_size = *Peek<uint16_t>(directory, at + 32);
    if (directory.size() - at - kHeaderSize < name_size + extra_size + comment_size) {
      fail_entry(i);
    }
    std::string name(directory.substr(at + kHeaderSize, name_size));
    // zip64: the numbers that did not fit, in this order.
    std::string_view extra = directory.substr(at + kHeaderSize + name_size, extra_size);
    while (extra.size() >= 4) {
      const uint16_t id = *Peek<uint16_t>(extra, 0);
      const uint16_t size = *Peek<uint16_t>(extra, 2);
      std::string_view field = extra.substr(4, size);
      extra.remove_prefix(std::min<size_t>(extra.size(), size_t{4} + size));
      if (id != 1) continue;
      for (uint64_t* number : {&entry.size, &entry.packed_size, &entry.header_offset}) {
        if (*number != 0xffffffffu) continue;
        const std::optional<uint64_t> value = Peek<uint64_t>(field, 0);
        if (!value) Fail("'" + name + "' has a damaged zip64 field");
        *number = *value;
        field.remove_prefix(8);
      }
    }
    at += kHeaderSize + name_size + extra_size + comment_size;
    if (flags & 1) Fail("'" + name + "' is encrypted");
    if (!name.ends_with(".npy")) continue;
    if (entry.packed_size > packed_left) Fail("'" + name + "' is larger than the archive");
    packed_left -= entry.packed_size;
    name.resize(name.size() - 4);
    if (!entries_.emplace(name, entry).second) Fail("'" + name + "' is there twice");
  }
}

std::vector<std::string> NpzArchive::Names() const {
  std::vector<std::string> names;
  for (const auto& [name, entry] : entries_) names.push_back(name);
  return names;
}

std::string NpzArchive::Unpack(const std::string& name, const Entry& entry) const {
  const std::string_view all = bytes_;
  constexpr size_t kLocalSize = 30;
  const uint64_t at = entry.header_offset;
  if (at > all.size() || all.size() - at < kLocalSize || all.substr(at, 4) != "PK\x03\x04") {
    Fail("'" + name + "' is not where the table of contents says");
  }
  const uint64_t data_at =
      at + kLocalSize + *Peek<uint16_t>(all, at + 26) + *Peek<uint16_t>(all, at + 28);
  if (data_at > all.size() || all.size() - data_at < entry.packed_size) {
    Fail("'" + name + "' reaches beyond the end of the archive: it is truncated");
  }
  const std::string_view packed = all.substr(data_at, entry.packed_size);
  std::string data;
  if (entry.method == 0) {
    data = packed;
  } else if (entry.method == 8) {
    // Deflate makes 1032 bytes of one at best, so that the announced size is bounded by the file's.
    constexpr uint64_t kMaxRatio = 1032;
    constexpr uint64_t kMaxHeader = 1 << 20;
    if (entry.size > kMaxArrayBytes + kMaxHeader ||
        entry.size / kMaxRatio > entry.packed_size + 64) {
      Fail(fmt::format("'{}' announces {} bytes in {} packed ones, which cannot be", name,
                       entry.size, entry.packed_size));
    }
    data.resize(entry.size);
    z_stream stream{};
    HOLBA_CHECK(inflateInit2(&stream, -MAX_WBITS) == Z_OK);
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
    stream.next_out = reinterpret_cast<Bytef*>(data.data());
    uint64_t in_left = packed.size(), out_left = data.size();
    int status = Z_OK;
    while (status == Z_OK) {
      constexpr uint64_t kStep = 1u << 30;
      const uInt in = static_cast<uInt>(std::min(in_left, kStep));
      const uInt out = static_cast<uInt>(std::min(out_left, kStep));
      stream.avail_in = in;
      stream.avail_out = out;
      status = inflate(&stream, Z_NO_FLUSH);
      in_left -= in - stream.avail_in;
      out_left -= out - stream.avail_out;
    }
    inflateEnd(&stream);
    if (status != Z_STREAM_END || out_left != 0) Fail("'" + name + "' cannot be unpacked");
  } else {
    Fail(fmt::format("'{}' is packed by method {}, expected 0 (stored) or 8 (deflate)", name,
                     entry.method));
  }
  if (data.size() != entry.size) Fail("'" + name + "' has not the size that is stated");
  const uLong crc = crc32_z(0, reinterpret_cast<const Bytef*>(data.data()), data.size());
  if (static_cast<uint32_t>(crc) != entry.crc32) {
    Fail("'" + name + "' has a wrong checksum: it is damaged");
  }
  return data;
}

NumericArray NpzArchive::Read(const std::string& name) const {
  const auto it = entries_.find(name);
  HOLBA_CHECK_MSG(it != entries_.end(), name);
  return ParseNpy(Unpack(name, it->second), path_.string() + ": '" + name + "'");
}

}  // namespace holba
