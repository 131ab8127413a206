// SPDX-License-Identifier: BSD-3-Clause
// What `holba --version` says: the version, what it was built from and how, what it uses here.
#pragma once

#include <string>

namespace holba {

// Lines; the first is "holba VERSION".
std::string VersionText();

}  // namespace holba
