// SPDX-License-Identifier: BSD-3-Clause
// Options of a command set by their names, as its command line would.
#pragma once

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/options.h"

namespace holba {

using OptionTexts = std::vector<std::pair<std::string, std::string>>;  // name, value

// The names must be of options of `described` (a struct with Describe).
template <typename Described>
void SetOptions(const OptionTexts& texts, Described* described) {
  OptionTable table;
  table.Bind(described);
  for (const auto& [name, text] : texts) {
    const auto found = std::find_if(table.options().begin(), table.options().end(),
                                    [&](const Option& option) { return option.name == name; });
    HOLBA_CHECK_MSG(found != table.options().end(), "an option is gone: " + name);
    found->SetText(text);
  }
}

}  // namespace holba
