// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>

namespace holba {

// What heads the page of a model: "refined/0" of "/data/refined/0/".
std::string ViewTitle(const std::filesystem::path& model_folder);

}  // namespace holba
