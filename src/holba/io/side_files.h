// SPDX-License-Identifier: BSD-3-Clause
// Our own files beside a COLMAP model, text and binary (FORMAT.md): lines2D, lines3D, groups2D,
// groups3D, wireframe, relations, point_origins. What text ends with the line (the track of a 3D line), binary
// precedes by its uint64 length, as COLMAP's points3D.bin does.
//
// Readers take the bytes of a file and add its records to `model`; call them in the order below,
// after those of colmap_files.h. `path` is for messages. They throw InputError with line or byte.
#pragma once

#include <filesystem>
#include <ostream>
#include <string_view>

#include "holba/io/model_format.h"
#include "holba/scene/reconstruction.h"

namespace holba {

void ReadLines2D(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                 Reconstruction* model);
void ReadLines3D(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                 Reconstruction* model);
void ReadGroups2D(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                  Reconstruction* model);
void ReadGroups3D(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                  Reconstruction* model);
void ReadWireframe(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                   Reconstruction* model);
void ReadRelations(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                   Reconstruction* model);
// Of the points whose origin is not that they were detected.
void ReadPointOrigins(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                      Reconstruction* model);

void WriteLines2D(ModelFormat format, const Reconstruction& model, std::ostream* stream);
void WriteLines3D(ModelFormat format, const Reconstruction& model, std::ostream* stream);
void WriteGroups2D(ModelFormat format, const Reconstruction& model, std::ostream* stream);
void WriteGroups3D(ModelFormat format, const Reconstruction& model, std::ostream* stream);
void WriteWireframe(ModelFormat format, const Reconstruction& model, std::ostream* stream);
void WriteRelations(ModelFormat format, const Reconstruction& model, std::ostream* stream);
void WritePointOrigins(ModelFormat format, const Reconstruction& model, std::ostream* stream);

}  // namespace holba
