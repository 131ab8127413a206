// SPDX-License-Identifier: BSD-3-Clause
// Arrays of an HDF5 file, as h5py (and so hloc) writes them.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>

#include "holba/frontend/importers/import_arrays.h"

namespace holba {

// Whether the bytes at the start of a file are HDF5's.
bool IsHdf5(const std::filesystem::path& path);

// The data sets of numbers whose path ("folder/image.jpg/lines") is wanted. Links to other places
// and data in other files are not followed. Throws InputError.
//
// The HDF5 library has a history of crashes on crafted files: it runs in a child process, with
// bounds on memory and time, whose death is an InputError. There `wanted` is called, too.
std::map<std::string, NumericArray> ReadHdf5(
    const std::filesystem::path& path, const std::function<bool(std::string_view path)>& wanted);

}  // namespace holba
