// SPDX-License-Identifier: BSD-3-Clause
#include "holba/view/view_title.h"

namespace holba {

std::string ViewTitle(const std::filesystem::path& model_folder) {
  const std::filesystem::path whole = std::filesystem::absolute(model_folder).lexically_normal();
  const std::filesystem::path folder = whole.has_filename() ? whole : whole.parent_path();
  const std::string above = folder.parent_path().filename().string();
  return above.empty() ? folder.filename().string() : above + "/" + folder.filename().string();
}

}  // namespace holba
