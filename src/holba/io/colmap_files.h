// SPDX-License-Identifier: BSD-3-Clause
// COLMAP's sparse model files, text and binary: cameras, rigs, frames, images, points3D. Field for
// field what COLMAP (up to 4.2) writes, except that records keep the order in which they were read.
//
// Readers take the bytes of a file and add its records to `model`; call them in the order below,
// each record is checked against those read before (but for tracks: scene/one_sided_links.h).
// `path` is for messages. They throw InputError with line or byte.
#pragma once

#include <filesystem>
#include <ostream>
#include <string_view>

#include "holba/io/model_format.h"
#include "holba/scene/reconstruction.h"

namespace holba {

void ReadCameras(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                 Reconstruction* model);
// Sets has_rig_files.
void ReadRigs(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
              Reconstruction* model);
void ReadFrames(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                Reconstruction* model);
// With rigs and frames, the pose of an image is that of its frame and rig (the file's own is
// redundant and kept only where it agrees to 1e-9); without, trivial rigs and frames are added, as
// COLMAP does.
void ReadImages(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                Reconstruction* model);
// The same for what has no file of cameras: each camera that an image names is added, with
// parameters that say nothing.
void ReadImagePoses(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                    Reconstruction* model);
void ReadPoints3D(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                  Reconstruction* model);

// Frames and images without a pose, in files of ours of the same form but for it (docs/FORMAT.md). After those
// with a pose and the points. Images without a frame get trivial ones.
void ReadUnregisteredFrames(ModelFormat format, std::string_view bytes,
                            const std::filesystem::path& path, Reconstruction* model);
void ReadUnregisteredImages(ModelFormat format, std::string_view bytes,
                            const std::filesystem::path& path, Reconstruction* model);
void WriteUnregisteredFrames(ModelFormat format, const Reconstruction& model, std::ostream* stream);
void WriteUnregisteredImages(ModelFormat format, const Reconstruction& model, std::ostream* stream);

void WriteCameras(ModelFormat format, const Reconstruction& model, std::ostream* stream);
void WriteRigs(ModelFormat format, const Reconstruction& model, std::ostream* stream);
void WriteFrames(ModelFormat format, const Reconstruction& model, std::ostream* stream);
// Text: throws InputError if an image has a name that a line of text cannot hold.
void WriteImages(ModelFormat format, const Reconstruction& model, std::ostream* stream);
void WritePoints3D(ModelFormat format, const Reconstruction& model, std::ostream* stream);

}  // namespace holba
