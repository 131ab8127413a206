// SPDX-License-Identifier: BSD-3-Clause
// The folder of --checkpoint_path.
#pragma once

#include <filesystem>

#include "holba/solver/solve_journal.h"

namespace holba {

// Of several ranks the first one writes, and all read.
SolveJournal::Store CheckpointStore(const std::filesystem::path& folder);

// Removes the records of an adjustment, and the folder if nothing else is in it.
void RemoveCheckpoint(const std::filesystem::path& folder);

}  // namespace holba
