// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/hdf5_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <hdf5.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <new>
#include <optional>
#include <utility>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"

namespace holba {
namespace {

constexpr char kRemedy[] =
    "; write it again with h5py, or give the arrays as .npz (docs/import.md)";

// What the child tells its parent, in this order of bytes: a kind, then
//   'A' path, type, rank, extents, bytes    an array
//   'E' message                             the file is bad: the end
//   'D'                                     done: the end
// Lengths are uint64.

class PipeWriter {
 public:
  explicit PipeWriter(int fd) : fd_(fd) {}

  void Raw(const void* data, size_t size) {
    const char* p = static_cast<const char*>(data);
    while (size > 0) {
      const ssize_t written = write(fd_, p, size);
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) _exit(3);  // nobody reads any more
      p += written;
      size -= static_cast<size_t>(written);
    }
  }
  template <typename T>
  void Value(T value) {
    Raw(&value, sizeof(T));
  }
  void Text(std::string_view text) {
    Value<uint64_t>(text.size());
    Raw(text.data(), text.size());
  }

 private:
  int fd_;
};

// Whatever a dying child sends is taken with care.
class PipeReader {
 public:
  explicit PipeReader(int fd) : fd_(fd) {}

  // False: the pipe ended.
  bool Raw(void* data, size_t size) {
    char* p = static_cast<char*>(data);
    while (size > 0) {
      const ssize_t got = read(fd_, p, size);
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) return false;
      p += got;
      size -= static_cast<size_t>(got);
    }
    return true;
  }
  template <typename T>
  bool Value(T* value) {
    return Raw(value, sizeof(T));
  }
  bool Text(uint64_t max_size, std::string* text) {
    uint64_t size;
    if (!Value(&size) || size > max_size) return false;
    text->resize(size);
    return Raw(text->data(), size);
  }

 private:
  int fd_;
};

class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }  // NOLINT: as the library takes it

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

// Type of the file's numbers in memory; half precision is read as float32.
std::optional<std::pair<ElementType, hid_t>> MemoryType(hid_t type) {
  const size_t size = H5Tget_size(type);
  switch (H5Tget_class(type)) {
    case H5T_FLOAT:
      if (size == 2 || size == 4) return {{ElementType::kFloat32, H5T_NATIVE_FLOAT}};
      if (size == 8) return {{ElementType::kFloat64, H5T_NATIVE_DOUBLE}};
      return std::nullopt;
    case H5T_INTEGER: {
      const bool is_signed = H5Tget_sign(type) == H5T_SGN_2;
      if (size == 1 && is_signed) return {{ElementType::kInt8, H5T_NATIVE_INT8}};
      if (size == 1) return {{ElementType::kUInt8, H5T_NATIVE_UINT8}};
      if (size == 2 && is_signed) return {{ElementType::kInt16, H5T_NATIVE_INT16}};
      if (size == 2) return {{ElementType::kUInt16, H5T_NATIVE_UINT16}};
      if (size == 4 && is_signed) return {{ElementType::kInt32, H5T_NATIVE_INT32}};
      if (size == 4) return {{ElementType::kUInt32, H5T_NATIVE_UINT32}};
      if (size == 8 && is_signed) return {{ElementType::kInt64, H5T_NATIVE_INT64}};
      if (size == 8) return {{ElementType::kUInt64, H5T_NATIVE_UINT64}};
      return std::nullopt;
    }
    default:
      return std::nullopt;
  }
}

struct Visit {
  std::vector<std::string>* paths;
  const std::function<bool(std::string_view)>* wanted;
};

herr_t VisitObject(bool is_dataset, const char* name, void* data) {
  const Visit& visit = *static_cast<Visit*>(data);
  if (is_dataset && (*visit.wanted)(name)) visit.paths->push_back(name);
  return 0;
}

#if H5_VERSION_GE(1, 12, 0)
herr_t VisitEntry(hid_t, const char* name, const H5O_info2_t* info, void* data) {
  return VisitObject(info->type == H5O_TYPE_DATASET, name, data);
}
herr_t VisitAll(hid_t file, void* data) {
  return H5Ovisit3(file, H5_INDEX_NAME, H5_ITER_INC, VisitEntry, data, H5O_INFO_BASIC);
}
#else
herr_t VisitEntry(hid_t, const char* name, const H5O_info_t* info, void* data) {
  return VisitObject(info->type == H5O_TYPE_DATASET, name, data);
}
herr_t VisitAll(hid_t file, void* data) {
  return H5Ovisit(file, H5_INDEX_NAME, H5_ITER_INC, VisitEntry, data);
}
#endif

// Empty: done; else what is wrong.
std::string SendArrays(const std::string& path, const std::function<bool(std::string_view)>& wanted,
                       PipeWriter* out) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  H5PLset_loading_state(0);
  const Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (file < 0) return std::string("the HDF5 file cannot be opened: it is damaged or incomplete");
  std::vector<std::string> paths;
  Visit visit{&paths, &wanted};
  if (VisitAll(file, &visit) < 0) return std::string("the table of the HDF5 file is damaged");
  for (const std::string& name : paths) {
    const auto says = [&](const std::string& message) { return "'" + name + "' " + message; };
    const Handle dataset(H5Dopen2(file, name.c_str(), H5P_DEFAULT), H5Dclose);
    if (dataset < 0) return says("cannot be opened: the file is damaged");
    const Handle list(H5Dget_create_plist(dataset), H5Pclose);
    if (list < 0 || H5Pget_layout(list) == H5D_VIRTUAL || H5Pget_external_count(list) != 0) {
      return says("lies in other files, which is not read");
    }
    const Handle type(H5Dget_type(dataset), H5Tclose);
    const auto memory_type = type < 0 ? std::nullopt : MemoryType(type);
    if (!memory_type) return says("does not hold numbers, expected integers or reals");
    const Handle space(H5Dget_space(dataset), H5Sclose);
    const int rank = space < 0 ? -1 : H5Sget_simple_extent_ndims(space);
    if (rank < 0 || rank > H5S_MAX_RANK) return says("has no shape: the file is damaged");
    std::vector<hsize_t> extents(static_cast<size_t>(rank));
    if (rank > 0 && H5Sget_simple_extent_dims(space, extents.data(), nullptr) != rank) {
      return says("has no shape: the file is damaged");
    }
    NumericArray array;
    array.type = memory_type->first;
    array.shape.assign(extents.begin(), extents.end());
    uint64_t size;
    if (!ArrayBytes(array.shape, array.type, &size)) {
      return says(
          fmt::format("is larger than {} MiB, the most that is read", kMaxArrayBytes >> 20));
    }
    if (H5Sget_simple_extent_type(space) == H5S_NULL) return says("is empty, expected an array");
    array.bytes.resize(size);
    if (size > 0 && H5Dread(dataset, memory_type->second, H5S_ALL, H5S_ALL, H5P_DEFAULT,
                            array.bytes.data()) < 0) {
      return says("cannot be read: it is damaged, or packed by a filter that is not there");
    }
    out->Value('A');
    out->Text(name);
    out->Value(static_cast<uint8_t>(array.type));
    out->Value(static_cast<uint8_t>(rank));
    for (const uint64_t extent : array.shape) out->Value(extent);
    out->Text(array.bytes);
  }
  return "";
}

// Room for what may be read beside what the process has already.
void LimitChild(const std::filesystem::path& path) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  std::ifstream statm("/proc/self/statm");
  uint64_t pages = 0;
  if (statm >> pages) {
    const rlim_t bytes = pages * static_cast<uint64_t>(sysconf(_SC_PAGESIZE)) + 3 * kMaxArrayBytes;
    const rlimit memory{bytes, bytes};
    setrlimit(RLIMIT_AS, &memory);
  }
#endif
  std::error_code ignored;
  const uint64_t size = std::filesystem::file_size(path, ignored);
  constexpr rlim_t kSeconds = 10;
  constexpr uint64_t kSlowestBytesPerSecond = 2'000'000;
  const rlim_t seconds = kSeconds + (ignored ? 0 : size / kSlowestBytesPerSecond);
  const rlimit cpu{seconds, seconds};
  setrlimit(RLIMIT_CPU, &cpu);
  const rlimit no_core{0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
}

[[noreturn]] void RunChild(const std::filesystem::path& path,
                           const std::function<bool(std::string_view)>& wanted, int fd) {
  for (const int signal_number : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL, SIGPIPE}) {
    std::signal(signal_number, SIG_DFL);
  }
  const int null = open("/dev/null", O_WRONLY);
  if (null >= 0) dup2(null, STDERR_FILENO);  // the C library's last words
  LimitChild(path);
  PipeWriter out(fd);
  try {
    const std::string fault = SendArrays(path.string(), wanted, &out);
    if (fault.empty()) {
      out.Value('D');
    } else {
      out.Value('E');
      out.Text(fault);
    }
  } catch (const std::bad_alloc&) {
    out.Value('E');
    out.Text("takes more memory than there is");
  } catch (...) {
    _exit(2);
  }
  _exit(0);
}

// False: the pipe ended before the end, or nonsense came.
bool Receive(int fd, std::map<std::string, NumericArray>* arrays, std::string* fault) {
  constexpr uint64_t kMaxText = 1 << 16;
  PipeReader in(fd);
  for (;;) {
    char kind;
    if (!in.Value(&kind)) return false;
    if (kind == 'D') return true;
    if (kind == 'E') return in.Text(kMaxText, fault) && !fault->empty();
    std::string name;
    uint8_t type, rank;
    if (kind != 'A' || !in.Text(kMaxText, &name) || !in.Value(&type) || !in.Value(&rank) ||
        type > static_cast<uint8_t>(ElementType::kFloat64)) {
      return false;
    }
    NumericArray array;
    array.type = static_cast<ElementType>(type);
    array.shape.resize(rank);
    for (uint64_t& extent : array.shape) {
      if (!in.Value(&extent)) return false;
    }
    uint64_t expected;
    if (!ArrayBytes(array.shape, array.type, &expected)) return false;
    if (!in.Text(expected, &array.bytes) || array.bytes.size() != expected) return false;
    if (!arrays->emplace(std::move(name), std::move(array)).second) return false;
  }
}

}  // namespace

bool IsHdf5(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  char magic[8] = {};
  stream.read(magic, sizeof(magic));
  return stream && std::string_view(magic, sizeof(magic)) ==
                       std::string_view("\x89HDF\r\n\x1a\n", sizeof(magic));
}

std::map<std::string, NumericArray> ReadHdf5(
    const std::filesystem::path& path, const std::function<bool(std::string_view path)>& wanted) {
  if (!std::filesystem::is_regular_file(path)) throw NoSuchFile(path);
  if (!IsHdf5(path)) throw InputError(path, std::string("this is no HDF5 file") + kRemedy);
  int ends[2];
  if (pipe(ends) != 0) throw CannotBeRead(path, SystemFault());
  const pid_t child = fork();
  if (child < 0) {
    close(ends[0]);
    close(ends[1]);
    throw CannotBeRead(path, "no more processes can be started");
  }
  if (child == 0) {
    close(ends[0]);
    RunChild(path, wanted, ends[1]);
  }
  close(ends[1]);
  std::map<std::string, NumericArray> arrays;
  std::string fault;
  bool complete = false;
  std::exception_ptr exception;
  try {
    complete = Receive(ends[0], &arrays, &fault);
  } catch (...) {
    exception = std::current_exception();  // the child must be waited for first
  }
  close(ends[0]);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (exception) std::rethrow_exception(exception);
  if (!fault.empty()) throw InputError(path, fault + kRemedy);
  if (!complete) {
    const std::string how = WIFSIGNALED(status)
                                ? WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL
                                      ? "ran out of time or memory"
                                      : "crashed"
                                : "failed";
    throw InputError(path,
                     "the HDF5 library " + how + " reading this file: it is damaged" + kRemedy);
  }
  return arrays;
}

}  // namespace holba
