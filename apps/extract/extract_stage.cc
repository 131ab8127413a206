// SPDX-License-Identifier: BSD-3-Clause
#include "apps/extract/extract_stage.h"

#include <optional>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/progress.h"
#include "holba/frontend/photographs/opencv_threads.h"
#include "holba/io/database.h"

namespace holba {

ExtractReport RunExtract(const ExtractOptions& options, const std::filesystem::path& image_path,
                         const std::filesystem::path& database_path) {
  if (!std::filesystem::is_directory(image_path)) throw NoSuchFolder(image_path, "--image_path");
  options.Check();
  HoldOpenCvThreads();
  const bool is_new = !std::filesystem::exists(database_path);
  try {
    Database database(database_path);
    std::optional<Progress> progress;
    return ExtractFeaturesOf(options, image_path, &database, [&](size_t num_done, size_t num_all) {
      if (!progress) progress.emplace("Extracting", "images", num_all);
      progress->Update(num_done);
      if (num_done == num_all) progress.reset();
    });
  } catch (const InputError&) {
    // Options and files that are refused leave no database behind.
    if (is_new) RemoveEmptyDatabase(database_path);
    throw;
  }
}

}  // namespace holba
