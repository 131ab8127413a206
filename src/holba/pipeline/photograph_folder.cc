// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/photograph_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>
#include <utility>
#include <vector>

#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/scene/name_pairing.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

constexpr std::array<std::string_view, 10> kExtensions = {".jpg", ".jpeg", ".png", ".tif", ".tiff",
                                                          ".bmp", ".ppm",  ".pgm", ".pnm", ".webp"};

bool IsPhotograph(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

// Relative to the folder, in the order of their names.
std::vector<std::string> FindPhotographs(const fs::path& folder) {
  std::vector<std::string> files;
  std::error_code error;  // what cannot be looked into holds nothing for us
  const auto options = fs::directory_options::follow_directory_symlink |
                       fs::directory_options::skip_permission_denied;
  for (fs::recursive_directory_iterator it(folder, options, error), end; !error && it != end;
       it.increment(error)) {
    if (it->is_regular_file(error) && IsPhotograph(it->path()))
      files.push_back(it->path().lexically_relative(folder).generic_string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

PhotographFolder::PhotographFolder(fs::path folder, const Reconstruction& model)
    : folder_(std::move(folder)) {
  std::vector<std::string_view> names;
  bool is_missing = false;
  for (const auto& [image_id, image] : model.images) {
    names.push_back(image.name);
    is_missing = is_missing || !fs::exists(folder_ / image.name);
  }
  if (!is_missing) return;
  const std::vector<std::string> files = FindPhotographs(folder_);
  const NamePairing pairing =
      PairNames(names, std::vector<std::string_view>(files.begin(), files.end()));
  if (pairing.NumPairs() == 0 && !files.empty()) {
    throw InputError(
        folder_,
        fmt::format(
            "none of its photographs ({} of them) has a name of the model (the folder has '{}', "
            "the model '{}'); --image_path must be the folder that the image names are relative to",
            files.size(), files.front(), names.front()));
  }
  for (size_t i = 0; i < names.size(); ++i) {
    if (pairing.b_of_a[i] && files[*pairing.b_of_a[i]] != names[i])
      file_of_name_.emplace(names[i], files[*pairing.b_of_a[i]]);
  }
  if (file_of_name_.empty()) return;
  LogInfo("{}",
          HowPaired("photograph", pairing.num_whole, pairing.num_by_ending, pairing.examples));
}

fs::path PhotographFolder::operator/(const std::string& name) const {
  const auto file = file_of_name_.find(name);
  return folder_ / (file != file_of_name_.end() ? file->second : name);
}

}  // namespace holba
