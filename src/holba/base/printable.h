// SPDX-License-Identifier: BSD-3-Clause
// Text for a terminal. Messages quote files and names, which may hold anything: control characters
// and what is no UTF-8 are shown as \xNN.
#pragma once

#include <string>
#include <string_view>

namespace holba {

// New lines and tabs stay.
std::string Printable(std::string_view text);

}  // namespace holba
