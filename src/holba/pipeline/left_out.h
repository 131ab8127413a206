// SPDX-License-Identifier: BSD-3-Clause
// What is said of photographs that cannot be used, by all that read a folder of them.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "holba/scene/types.h"

namespace holba {

// A picture that cannot be read or does not fit its camera.
struct LeftOutPhotograph {
  image_t image_id = kInvalidId32;
  std::string reason;  // names the file
};

// Says which of `num_all` photographs are left out (none: says nothing). Throws InputError if all
// are, or if `strict` and any is. `consequence`: what else that means, said in parentheses; may be
// empty.
void HandleLeftOut(bool strict, std::span<const LeftOutPhotograph> left_out, size_t num_all,
                   std::string_view consequence);

// Says which photographs are used although their files end early (none: says nothing).
void WarnOfCutOff(std::span<const std::string> names);

}  // namespace holba
