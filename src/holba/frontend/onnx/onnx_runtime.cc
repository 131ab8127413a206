// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/onnx/onnx_runtime.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"

namespace holba {
namespace {

// The runtime's C interface is a table of functions to which releases only add: those that are
// needed, by their places. Every function but the releases returns null or a status.
constexpr uint32_t kApiVersion = 14;  // ONNX Runtime 1.14 and later have it
enum Place : size_t {
  kGetErrorMessage = 2,
  kCreateEnv = 3,
  kCreateSession = 7,
  kRun = 9,
  kCreateSessionOptions = 10,
  kSetIntraOpNumThreads = 24,
  kSetInterOpNumThreads = 25,
  kSessionGetInputCount = 30,
  kSessionGetOutputCount = 31,
  kSessionGetInputName = 36,
  kSessionGetOutputName = 37,
  kCreateTensorWithDataAsOrtValue = 49,
  kIsTensor = 50,
  kGetTensorMutableData = 51,
  kGetTensorElementType = 60,
  kGetDimensionsCount = 61,
  kGetDimensions = 62,
  kGetTensorTypeAndShape = 65,
  kCreateCpuMemoryInfo = 69,
  kAllocatorFree = 76,
  kGetAllocatorWithDefaultOptions = 78,
  kReleaseStatus = 93,
  kReleaseMemoryInfo = 94,
  kReleaseSession = 95,
  kReleaseValue = 96,
  kReleaseTensorTypeAndShapeInfo = 99,
  kReleaseSessionOptions = 100,
};
// Numbers of the interface.
constexpr int kFloat = 1, kInt32 = 6, kInt64 = 7;  // types of elements
constexpr int kWarningsOnly = 3;                   // 2 are warnings, 3 errors
constexpr int kArenaAllocator = 1, kDefaultMemory = 0;

struct ApiBase {
  const void* const* (*get_api)(uint32_t version);
  const char* (*get_version)();
};

constexpr const char* kNames[] = {"libonnxruntime.so.1", "libonnxruntime.so"};

// Null: it cannot be loaded.
void* Open(const std::string& library) { return dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL); }

}  // namespace

// The library that is asked for; it stays loaded.
class OnnxRuntime {
 public:
  explicit OnnxRuntime(const std::string& library) {
    void* handle = Open(library);
    if (handle == nullptr) {
      throw InputError(library,
                       fmt::format("the ONNX Runtime cannot be loaded ({}); give the path of its "
                                   "library in HOLBA_ONNXRUNTIME",
                                   LoaderFault()));
    }
    const auto get_base = reinterpret_cast<const ApiBase* (*)()>(dlsym(handle, "OrtGetApiBase"));
    if (get_base != nullptr) api_ = get_base()->get_api(kApiVersion);
    if (api_ == nullptr) {
      throw InputError(library,
                       "expected the library of ONNX Runtime 1.14 or later, found another");
    }
    Check(library,
          Call<const void*, int, const char*, void**>(kCreateEnv, kWarningsOnly, "holba", &env_));
    Check(library, Call<const void*, int, int, void**>(kCreateCpuMemoryInfo, kArenaAllocator,
                                                       kDefaultMemory, &memory_));
    Check(library, Call<const void*, void**>(kGetAllocatorWithDefaultOptions, &allocator_));
  }

  template <typename Result, typename... Args>
  Result Call(Place place, Args... args) const {
    using Function = Result (*)(Args...);
    return reinterpret_cast<Function>(const_cast<void*>(api_[place]))(args...);
  }

  // `status`: what a function returned. Throws InputError with the runtime's words about `path`.
  void Check(const std::filesystem::path& path, const void* status) const {
    if (status == nullptr) return;
    const std::string said = Call<const char*, const void*>(kGetErrorMessage, status);
    Call<void, const void*>(kReleaseStatus, status);
    throw InputError(path, fmt::format("the ONNX Runtime cannot use it ({}); check the model and "
                                       "the JSON file that describes it",
                                       said));
  }

  void* env() const { return env_; }
  void* memory() const { return memory_; }
  void* allocator() const { return allocator_; }

 private:
  static std::string LoaderFault() {
    const char* said = dlerror();
    return said == nullptr ? "no reason given" : said;
  }

  const void* const* api_ = nullptr;
  void *env_ = nullptr, *memory_ = nullptr, *allocator_ = nullptr;
};

namespace {

// One for each library, never unloaded: its threads and statics outlive any model.
const OnnxRuntime& RuntimeOf(const std::string& library) {
  static std::mutex mutex;
  static auto* runtimes = new std::map<std::string, std::unique_ptr<OnnxRuntime>>();
  const std::lock_guard lock(mutex);
  auto& runtime = (*runtimes)[library];
  if (!runtime) runtime = std::make_unique<OnnxRuntime>(library);
  return *runtime;
}

// A value of the runtime, released at the end.
class Value {
 public:
  explicit Value(const OnnxRuntime& runtime) : runtime_(&runtime) {}
  Value(Value&& other) noexcept
      : value_(std::exchange(other.value_, nullptr)), runtime_(other.runtime_) {}
  Value(const Value&) = delete;
  Value& operator=(const Value&) = delete;
  ~Value() {
    if (value_ != nullptr) runtime_->Call<void, void*>(kReleaseValue, value_);
  }
  void* value_ = nullptr;

 private:
  const OnnxRuntime* runtime_;
};

size_t NumElements(const std::vector<int64_t>& shape) {
  size_t num = 1;
  for (const int64_t n : shape) num *= static_cast<size_t>(n);
  return num;
}

}  // namespace

OnnxTensor FloatTensor(std::vector<int64_t> shape, std::vector<float> values) {
  HOLBA_CHECK(NumElements(shape) == values.size());
  return {.shape = std::move(shape), .is_float = true, .floats = std::move(values)};
}

std::optional<std::string> FindOnnxRuntime() {
  if (const char* library = std::getenv("HOLBA_ONNXRUNTIME"); library != nullptr && *library != 0) {
    return Open(library) != nullptr ? std::optional<std::string>(library) : std::nullopt;
  }
  for (const char* name : kNames) {
    if (Open(name) != nullptr) return name;
  }
  return std::nullopt;
}

struct OnnxModel::Session {
  std::filesystem::path path;
  const OnnxRuntime* runtime = nullptr;
  void* handle = nullptr;
  std::vector<std::string> input_names, output_names;

  ~Session() {
    if (handle != nullptr) runtime->Call<void, void*>(kReleaseSession, handle);
  }

  std::vector<std::string> Names(Place count_place, Place name_place) const {
    size_t count = 0;
    runtime->Check(path,
                   runtime->Call<const void*, const void*, size_t*>(count_place, handle, &count));
    std::vector<std::string> names;
    for (size_t i = 0; i < count; ++i) {
      char* name = nullptr;
      runtime->Check(path, runtime->Call<const void*, const void*, size_t, void*, char**>(
                               name_place, handle, i, runtime->allocator(), &name));
      names.emplace_back(name);
      runtime->Check(path, runtime->Call<const void*, void*, void*>(kAllocatorFree,
                                                                    runtime->allocator(), name));
    }
    return names;
  }

  Value ToValue(const OnnxTensor& tensor) const {
    Value value(*runtime);
    const void* data = tensor.is_float ? static_cast<const void*>(tensor.floats.data())
                                       : static_cast<const void*>(tensor.integers.data());
    const size_t num_bytes = tensor.size() * (tensor.is_float ? sizeof(float) : sizeof(int64_t));
    // The runtime reads inputs, it does not change them.
    runtime->Check(
        path,
        runtime->Call<const void*, const void*, void*, size_t, const int64_t*, size_t, int, void**>(
            kCreateTensorWithDataAsOrtValue, runtime->memory(), const_cast<void*>(data), num_bytes,
            tensor.shape.data(), tensor.shape.size(), tensor.is_float ? kFloat : kInt64,
            &value.value_));
    return value;
  }

  OnnxTensor ToTensor(const std::string& name, void* value) const {
    int is_tensor = 0;
    runtime->Check(path,
                   runtime->Call<const void*, const void*, int*>(kIsTensor, value, &is_tensor));
    if (is_tensor == 0)
      throw InputError(path, fmt::format("expected a tensor as output '{}', found none", name));
    void* info = nullptr;
    runtime->Check(path, runtime->Call<const void*, const void*, void**>(kGetTensorTypeAndShape,
                                                                         value, &info));
    int type = 0;
    size_t num_dims = 0;
    OnnxTensor tensor;
    const void* faults[] = {
        runtime->Call<const void*, const void*, int*>(kGetTensorElementType, info, &type),
        runtime->Call<const void*, const void*, size_t*>(kGetDimensionsCount, info, &num_dims)};
    tensor.shape.resize(num_dims);
    const void* fault = runtime->Call<const void*, const void*, int64_t*, size_t>(
        kGetDimensions, info, tensor.shape.data(), num_dims);
    runtime->Call<void, void*>(kReleaseTensorTypeAndShapeInfo, info);
    for (const void* status : faults) runtime->Check(path, status);
    runtime->Check(path, fault);
    void* data = nullptr;
    runtime->Check(path,
                   runtime->Call<const void*, void*, void**>(kGetTensorMutableData, value, &data));
    const size_t num = NumElements(tensor.shape);
    tensor.is_float = type == kFloat;
    if (type == kFloat) {
      const auto* values = static_cast<const float*>(data);
      tensor.floats.assign(values, values + num);
    } else if (type == kInt64) {
      const auto* values = static_cast<const int64_t*>(data);
      tensor.integers.assign(values, values + num);
    } else if (type == kInt32) {
      const auto* values = static_cast<const int32_t*>(data);
      tensor.integers.assign(values, values + num);
    } else {
      throw InputError(path, fmt::format("expected floats of 32 bits or whole numbers of 32 or 64 "
                                         "bits as output '{}', found type {} of ONNX",
                                         name, type));
    }
    return tensor;
  }
};

OnnxModel::OnnxModel(const std::filesystem::path& path, const std::filesystem::path& library)
    : session_(std::make_unique<Session>()) {
  if (!std::filesystem::is_regular_file(path)) throw NoSuchFile(path);
  const std::optional<std::string> found =
      library.empty() ? FindOnnxRuntime() : std::optional<std::string>(library.string());
  if (!found) {
    throw InputError(path,
                     "the ONNX Runtime that runs it is not found; give the path of its "
                     "libonnxruntime.so in the environment's HOLBA_ONNXRUNTIME");
  }
  session_->path = path;
  session_->runtime = &RuntimeOf(*found);
  const OnnxRuntime& runtime = *session_->runtime;
  void* options = nullptr;
  runtime.Check(path, runtime.Call<const void*, void**>(kCreateSessionOptions, &options));
  const void* status = nullptr;
  for (const Place place : {kSetIntraOpNumThreads, kSetInterOpNumThreads}) {
    if (status == nullptr) status = runtime.Call<const void*, void*, int>(place, options, 1);
  }
  if (status == nullptr) {
    status = runtime.Call<const void*, const void*, const char*, const void*, void**>(
        kCreateSession, runtime.env(), path.c_str(), options, &session_->handle);
  }
  runtime.Call<void, void*>(kReleaseSessionOptions, options);
  runtime.Check(path, status);
  session_->input_names = session_->Names(kSessionGetInputCount, kSessionGetInputName);
  session_->output_names = session_->Names(kSessionGetOutputCount, kSessionGetOutputName);
}

OnnxModel::~OnnxModel() = default;

const std::filesystem::path& OnnxModel::path() const { return session_->path; }
const std::vector<std::string>& OnnxModel::input_names() const { return session_->input_names; }
const std::vector<std::string>& OnnxModel::output_names() const { return session_->output_names; }

std::vector<OnnxTensor> OnnxModel::Run(
    const std::vector<std::pair<std::string, OnnxTensor>>& inputs,
    const std::vector<std::string>& outputs) const {
  const OnnxRuntime& runtime = *session_->runtime;
  std::vector<Value> values;
  std::vector<const char*> input_names, output_names;
  std::vector<void*> input_values, output_values(outputs.size(), nullptr);
  for (const auto& [name, tensor] : inputs) {
    values.push_back(session_->ToValue(tensor));
    input_names.push_back(name.c_str());
    input_values.push_back(values.back().value_);
  }
  for (const std::string& name : outputs) output_names.push_back(name.c_str());
  const void* status = runtime.Call<const void*, void*, const void*, const char* const*,
                                    void* const*, size_t, const char* const*, size_t, void**>(
      kRun, session_->handle, nullptr, input_names.data(), input_values.data(), input_names.size(),
      output_names.data(), output_names.size(), output_values.data());
  std::vector<Value> found;
  for (void* value : output_values) {
    found.emplace_back(runtime);
    found.back().value_ = value;
  }
  runtime.Check(session_->path, status);
  std::vector<OnnxTensor> tensors;
  for (size_t i = 0; i < outputs.size(); ++i)
    tensors.push_back(session_->ToTensor(outputs[i], output_values[i]));
  return tensors;
}

}  // namespace holba
