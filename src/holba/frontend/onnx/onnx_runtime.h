// SPDX-License-Identifier: BSD-3-Clause
// Models in ONNX files, run by the ONNX Runtime that the user has: its library is looked for when a
// model is first wanted, so that holba is built and runs without it. On the CPU, one thread a run:
// the same input gives the same output, and images are what runs in parallel.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace holba {

// Row by row. Floats of 32 bits, or whole numbers (of 32 or 64 bits in the model).
struct OnnxTensor {
  std::vector<int64_t> shape;
  bool is_float = true;
  std::vector<float> floats;
  std::vector<int64_t> integers;

  size_t size() const { return is_float ? floats.size() : integers.size(); }
};
OnnxTensor FloatTensor(std::vector<int64_t> shape, std::vector<float> values);

// The library that would be used: the environment's HOLBA_ONNXRUNTIME, else libonnxruntime.so.1 or
// libonnxruntime.so where the system finds libraries. Empty: none that can be loaded.
std::optional<std::string> FindOnnxRuntime();

class OnnxModel {
 public:
  // `library`: of the runtime; empty: the one of FindOnnxRuntime. Throws InputError if there is
  // none, or if it cannot use the model.
  OnnxModel(const std::filesystem::path& path, const std::filesystem::path& library);
  ~OnnxModel();
  OnnxModel(const OnnxModel&) = delete;
  OnnxModel& operator=(const OnnxModel&) = delete;

  const std::filesystem::path& path() const;
  const std::vector<std::string>& input_names() const;
  const std::vector<std::string>& output_names() const;

  // The outputs of these names, in their order. May be called from several threads. Throws
  // InputError with what the runtime says: wrong names or shapes, outputs of other types.
  std::vector<OnnxTensor> Run(const std::vector<std::pair<std::string, OnnxTensor>>& inputs,
                              const std::vector<std::string>& outputs) const;

 private:
  struct Session;
  std::unique_ptr<Session> session_;
};

}  // namespace holba
