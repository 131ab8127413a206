// SPDX-License-Identifier: BSD-3-Clause
// The viewer as viewer/ builds it: one page without a model.
#pragma once

#include <string_view>

namespace holba {

// ASCII. Models go in place of kDataPlace, which it holds once.
std::string_view ViewerPage();
inline constexpr std::string_view kDataPlace = "<!--holba-data-->";

}  // namespace holba
