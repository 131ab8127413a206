// SPDX-License-Identifier: BSD-3-Clause
#include "apps/adjust/checkpoint.h"

#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "holba/io/files.h"
#include "holba/solver/ranks.h"

namespace holba {
namespace {

bool IsRecord(const std::string& name) {
  return name == "loop.bin" || (name.starts_with("solve_") && name.ends_with(".bin"));
}

}  // namespace

SolveJournal::Store CheckpointStore(const std::filesystem::path& folder) {
  return {.folder = folder,
          .write =
              [folder](const std::string& name, const std::string& bytes) {
                ranks::OnFirst([&] {
                  WriteFileWhole(folder / name, [&](std::ostream* out) {
                    out->write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
                  });
                });
              },
          .read = [folder](const std::string& name) -> std::optional<std::string> {
            if (!std::filesystem::exists(folder / name)) return std::nullopt;
            return ReadFileBytes(folder / name);
          }};
}

void RemoveCheckpoint(const std::filesystem::path& folder) {
  ranks::OnFirst([&] {
    std::error_code error;
    std::vector<std::filesystem::path> records;
    for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
      if (IsRecord(entry.path().filename().string())) records.push_back(entry.path());
    }
    for (const auto& record : records) std::filesystem::remove(record, error);
    if (std::filesystem::is_empty(folder, error)) std::filesystem::remove(folder, error);
  });
}

}  // namespace holba
