// SPDX-License-Identifier: BSD-3-Clause
// Whole models: files, copies, pickles, similarities.
#include "reconstruction.h"

#include <fmt/format.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <filesystem>
#include <fstream>
#include <map>

#include "apps/report.h"
#include "arrays.h"
#include "calls.h"
#include "holba/base/error.h"
#include "holba/base/temporary_paths.h"
#include "holba/group/group_type.h"
#include "holba/io/bal.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"
#include "holba/io/ply.h"
#include "holba/scene/local_frame.h"
#include "holba/scene/selection.h"
#include "record_layout.h"
#include "records.h"

namespace holba::python {
namespace {

namespace fs = std::filesystem;

ModelFormat FormatOf(const std::string& name) {
  if (name == "bin") return ModelFormat::kBinary;
  if (name == "txt") return ModelFormat::kText;
  throw InputError(fmt::format("output_type: expected bin or txt, found '{}'", name));
}

// What only one of a kind can have.
fs::path NewTemporaryFolder() {
  std::string name = (fs::temp_directory_path() / "holba-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr)
    throw InputError(name, "the folder for temporary files cannot be made; check TMPDIR");
  return name;
}

nb::dict ToBytes(const Reconstruction& model) {
  const TemporaryPath folder(NewTemporaryFolder());
  WriteModel(model, folder.path(), ModelFormat::kBinary);
  nb::dict files;
  for (const auto& entry : fs::directory_iterator(folder.path())) {
    std::ifstream in(entry.path(), std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    files[entry.path().filename().c_str()] = nb::bytes(bytes.data(), bytes.size());
  }
  return files;
}

Reconstruction FromBytes(const nb::dict& files) {
  const TemporaryPath folder(NewTemporaryFolder());
  for (const auto& [name, content] : files) {
    const auto bytes = nb::cast<nb::bytes>(content);
    std::ofstream out(folder.path() / fs::path(nb::cast<std::string>(name)).filename(),
                      std::ios::binary);
    out.write(bytes.c_str(), static_cast<std::streamsize>(bytes.size()));
  }
  return ReadModel(folder.path());
}

}  // namespace

void BindReconstruction(nb::module_& m) {
  nb::class_<Reconstruction> model(
      m, "Reconstruction",
      "A scene: cameras, rigs, frames, images, points, lines, groups, wireframe and relations, as "
      "the files of docs/FORMAT.md hold them. Poses are cam_from_world, pixels have the centre of "
      "the "
      "top left one at (0.5, 0.5). A value: copies share nothing. What ties records to each other "
      "is "
      "changed by the methods only; a method that is given ids that are not there raises "
      "CheckError "
      "and leaves the model as it was.");
  model.def(nb::init<>(), "An empty model.");
  BindMaps(m, &model);
  BindVerbs(&model);
  BindBulk(&model);
  model.def(
      "write",
      [](const Reconstruction& self, const fs::path& path, const std::string& output_type) {
        const ModelFormat format = FormatOf(output_type);
        ProbeModelFolder(path);
        Unlocked([&] { WriteModel(self, path, format); });
      },
      nb::arg("path"), nb::arg("output_type") = "bin",
      "Writes the model folder, which COLMAP opens; output_type: bin or txt. What was there is "
      "replaced in one step. Raises InputError if it cannot be written.");
  model.def(
      "write_ply",
      [](const Reconstruction& self, const fs::path& path) {
        Unlocked([&] { WritePly(self, path); });
      },
      nb::arg("path"), "Points, lines and groups as PLY, for viewers. Raises InputError.");
  model.def(
      "write_bal",
      [](const Reconstruction& self, const fs::path& path) {
        Unlocked([&] { WriteBal(self, path); });
      },
      nb::arg("path"),
      "Cameras and points as a BAL problem. Raises InputError for models it cannot hold.");
  model.def(
      "copy", [](const Reconstruction& self) { return Reconstruction(self); },
      "A model of its own, whose records lie one behind the other.");
  model.def(
      "show",
      [](nb::object self, const nb::kwargs& options) {
        return nb::module_::import_("holba._show").attr("show")(self, **options);
      },
      nb::arg("options"), nb::sig("def show(self, **options: typing.Any) -> typing.Any"),
      "The page of the model in a frame, in a notebook: holba.show(model, ...), which has the "
      "options.");
  model.def("__copy__", [](const Reconstruction& self) { return Reconstruction(self); });
  model.def(
      "__deepcopy__", [](const Reconstruction& self, nb::object) { return Reconstruction(self); },
      nb::arg("memo"));
  model.def("__getstate__", ToBytes);
  model.def("__setstate__", [](Reconstruction* self, const nb::dict& files) {
    new (self) Reconstruction(FromBytes(files));
  });
  model.def(
      "transform",
      [](Reconstruction& self, const Sim3d& new_from_old) {
        Unlocked([&] { self.Transform(new_from_old); });
      },
      nb::arg("new_from_old"), "Moves everything: poses, points, lines and groups.");
  model.def(
      "normalized_from_world", [](const Reconstruction& self) { return NormalisedFromWorld(self); },
      "The similarity of COLMAP's normalisation: the mean of the camera centres between the 10th "
      "and 90th percentiles to the origin, the diagonal of their box to 10. None: no image has a "
      "pose.");
  model.def(
      "drop_points_of_structure",
      [](Reconstruction& self) {
        for (const auto& [id, image] : self.images) CheckUnpinned(image.points2D.data());
        for (const auto& [id, image] : self.unregistered_images)
          CheckUnpinned(image.points2D.data());
        RemovePointsOfStructure(&self);
      },
      "Removes junctions and corners with their keypoints, so that images have the keypoints of "
      "their database again. BufferError while arrays show keypoints.");
  model.def("find_inconsistency", &Reconstruction::FindInconsistency,
            "None if the model is consistent; otherwise the first inconsistency in words.");
  model.def("__repr__", [](const Reconstruction& self) {
    return fmt::format("Reconstruction of {}", ContentsText(self));
  });

  m.def(
      "read_model",
      [](const fs::path& path, bool strict) {
        return Unlocked([&] {
          Reconstruction model = fs::is_regular_file(path) ? ReadBal(path.string())
                                                           : ReadModel(path, {.strict = strict});
          LineUp(&model.frames);
          LineUp(&model.images);
          LineUp(&model.points3D);
          LineUp(&model.lines3D);
          return model;
        });
      },
      nb::arg("path"), nb::kw_only(), nb::arg("strict") = false,
      "Reads a model folder, ours or COLMAP's, or the file of a BAL problem. Links between 2D and "
      "3D "
      "features that one end only knows are dropped with a warning; strict: refused. Raises "
      "InputError "
      "with file and place.");
  m.def(
      "read_poses", [](const fs::path& path) { return Unlocked([&] { return ReadPoses(path); }); },
      nb::arg("path"),
      "What there is of a model, for comparisons of poses: points may be missing. Raises "
      "InputError.");
  m.def(
      "group_types",
      [] {
        std::map<std::string, std::string> types;
        for (const GroupType* type : AllGroupTypes())
          types[std::string(type->name)] = std::string(type->file_params);
        return types;
      },
      "Names of all group types with those of their parameters.");
  m.attr("NO_ID") = kNoId;
}

}  // namespace holba::python
