// SPDX-License-Identifier: BSD-3-Clause
// What several readers of records have to say, in the same words.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "holba/io/holistic_json.h"

namespace holba {

// For what a program writes and nobody edits by hand.
inline constexpr const char* kMendModel =
    "write the model anew with the program that made it, or mend this by hand";

// "camera 3 is there twice; remove one of the two".
inline std::string ThereTwice(std::string_view what) {
  return fmt::format("{} is there twice; remove one of the two", what);
}

// "image 1 names camera 9, which is not in the model; ...".
inline std::string NamesWhatIsMissing(std::string_view who, std::string_view what) {
  return fmt::format("{} names {}, which is not in the model; {}", who, what, kMendModel);
}

// `fault`: what is wrong with `what`: "camera 3", "has a parameter that is not finite".
inline std::string FaultOf(std::string_view what, std::string_view fault) {
  return fmt::format("{} {}; {}", what, fault, kMendModel);
}

// An id in a side file, of what was removed from the model: "expected LINE3D_ID of the model, ...".
inline std::string IdNotInModel(std::string_view id_name, uint64_t id) {
  return fmt::format("expected {} of the model, found {}, which is not in it: {}", id_name, id,
                     kSideFilesRemedy);
}

}  // namespace holba
