// SPDX-License-Identifier: BSD-3-Clause
// The stages of the mapper, for incremental loops of one's own.
#include <fmt/format.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <filesystem>
#include <optional>

#include "arrays.h"
#include "calls.h"
#include "holba/base/error.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/frontend/photographs/opencv_threads.h"
#include "holba/io/database.h"
#include "holba/pipeline/mapping.h"
#include "holba/sfm/extend_structure.h"
#include "holba/sfm/filter_model.h"
#include "holba/sfm/initial_pair.h"
#include "holba/sfm/map_adjustment.h"
#include "holba/sfm/next_image.h"
#include "holba/sfm/register_image.h"
#include "holba/sfm/triangulate_lines.h"
#include "holba/sfm/triangulate_points.h"
#include "module.h"
#include "options.h"
#include "records.h"

namespace holba::python {
namespace {

struct MapperSettings {
  MapperOptions mapper;
  DetectionOptions detection;
  LineMatchingOptions matching{.num_near_points = kNearPointsWithoutPoses};
  SolverOptions solver;

  void Describe(OptionTable* table) const {
    mapper.Describe(table);
    mapper.structure_options.Describe(table);
    detection.Describe(table);
    matching.Describe(table);
    solver.Describe(table);
  }
};
using MapperOptionSet = OptionsOf<MapperSettings>;

MappingData ReadData(const MapperSettings& s, const std::filesystem::path& database_path,
                     const std::optional<std::filesystem::path>& image_path) {
  const MappingDataOptions options{
      .selection = {static_cast<size_t>(s.mapper.min_num_matches), s.mapper.ignore_watermarks},
      .structure = s.mapper.structure != MapperStructure::kNone,
      .num_threads = s.solver.num_threads};
  if (!std::filesystem::is_regular_file(database_path))
    throw InputError(database_path, "there is no such file; check the path");
  s.detection.Check();
  HoldOpenCvThreads();
  Database database(database_path);
  return ReadMappingData(options, s.detection, s.matching, image_path ? &*image_path : nullptr,
                         &database);
}

// What a loop goes on with; stages are functions of it (sfm/mapper.h has the program's own loop).
struct PyMapper {
  PyMapper(const MapperSettings& given, const std::filesystem::path& database_path,
           const std::optional<std::filesystem::path>& image_path)
      : settings(given),
        data(ReadData(settings, database_path, image_path)),
        state(data.input, data.scene),
        adjuster(settings.mapper, settings.solver, &state) {
    settings.mapper.structure_options.SetNumThreads(settings.solver.num_threads);
  }
  PyMapper(const PyMapper&) = delete;
  PyMapper& operator=(const PyMapper&) = delete;

  const Reconstruction& model() const { return state.model(); }
  bool HasLines() const { return settings.mapper.structure != MapperStructure::kNone; }
  void CheckImage(image_t id) const {
    if (model().FindImage(id) == nullptr) NoRecord("image", id);
  }
  void CheckRegistered(image_t id) const {
    if (!model().images.contains(id)) NoRecord("image with a pose", id);
  }
  void CheckWaiting(image_t id) const {
    if (!model().unregistered_images.contains(id)) NoRecord("image without a pose", id);
  }
  RegistrationReport Register(image_t id, bool with_structure) {
    CheckWaiting(id);
    return Unlocked([&] {
      RegistrationReport report = with_structure
                                      ? RegisterImage(settings.mapper, id, &state)
                                      : RegisterWithoutStructure(settings.mapper, id, &state);
      if (!report.accepted) {
        ++state.num_registration_trials[id];
        state.registration_failures[id] = report.failure;
      }
      return report;
    });
  }

  MapperSettings settings;
  MappingData data;
  MapperState state;
  MapAdjuster adjuster;
  InitialPairReport pairs;
};

std::map<std::string, size_t> Counts(const PointChanges& p) {
  return {{"created", p.created},
          {"continued", p.continued},
          {"completed", p.completed},
          {"merged", p.merged}};
}
std::map<std::string, size_t> Counts(const LineChanges& l) {
  return {{"created", l.created}, {"continued", l.continued}, {"merged", l.merged}};
}

void BindInitialPair(nb::class_<PyMapper>* type) {
  type->def(
      "find_initial_pair",
      [](PyMapper& m) {
        return Unlocked([&] {
          return FindInitialPair(m.settings.mapper.initial, m.settings.mapper.random_seed,
                                 m.settings.solver.num_threads, &m.state, &m.pairs);
        });
      },
      "The next pair that could begin a model, in COLMAP's order; one that was found before is not "
      "found again. None: "
      "there is none.");
  type->def(
      "register_initial_pair",
      [](PyMapper& m, const InitialPair& pair) {
        m.CheckWaiting(pair.image_id1);
        m.CheckWaiting(pair.image_id2);
        RegisterInitialPair(pair, &m.state);
      },
      nb::arg("pair"), "Gives both images their poses, the first one's at the origin.");
}

void BindRegistration(nb::class_<PyMapper>* type) {
  type->def(
      "rank_next_images",
      [](PyMapper& m) {
        return Unlocked([&] { return RankNextImages(m.settings.mapper.next, &m.state); });
      },
      "Images without a pose that see enough of the model, the best first.");
  type->def(
      "rank_by_matches",
      [](PyMapper& m, size_t min_num_matches) {
        return Unlocked(
            [&] { return RankByMatches(m.settings.mapper.next, min_num_matches, m.state); });
      },
      nb::arg("min_num_matches") = 60,
      "The same by matches with images of the model, with 3D points or without.");
  type->def(
      "register_image", [](PyMapper& m, image_t id) { return m.Register(id, true); },
      nb::arg("image_id"),
      "A pose from matches with 3D points and lines; its frame with it. A refusal counts as a "
      "trial.");
  type->def(
      "register_without_structure", [](PyMapper& m, image_t id) { return m.Register(id, false); },
      nb::arg("image_id"), "A pose from matches with images of the model alone.");
  type->def(
      "deregister_image",
      [](PyMapper& m, image_t id) {
        m.CheckRegistered(id);
        m.state.DeregisterFrame(m.model().images.at(id).frame_id);
      },
      nb::arg("image_id"), "Takes the pose of its frame away, with the observations.");
  type->def(
      "images_of_frame",
      [](const PyMapper& m, image_t id) {
        m.CheckImage(id);
        return m.state.ImagesOfFrame(id);
      },
      nb::arg("image_id"), "The images of the frame of an image, itself among them.");
}

void BindStructure(nb::class_<PyMapper>* type) {
  type->def(
      "triangulate_image",
      [](PyMapper& m, image_t id) {
        m.CheckRegistered(id);
        return Unlocked([&] {
          return Counts(TriangulateImage(m.settings.mapper.triangulation, id, &m.state));
        });
      },
      nb::arg("image_id"),
      "Keypoints join the points of their matches or make new ones; counts of what changed.");
  type->def(
      "triangulate_lines",
      [](PyMapper& m, image_t id) {
        m.CheckRegistered(id);
        if (!m.HasLines()) return Counts(LineChanges());
        return Unlocked([&] {
          return Counts(TriangulateLines(m.settings.mapper.structure_options.lines, id, &m.state));
        });
      },
      nb::arg("image_id"), "The same of segments and lines; nothing with structure \"none\".");
  type->def(
      "retriangulate",
      [](PyMapper& m) {
        return Unlocked(
            [&] { return Counts(Retriangulate(m.settings.mapper.triangulation, &m.state)); });
      },
      "Pairs of images of which few matches are triangulated.");
  type->def(
      "rebuild_groups",
      [](PyMapper& m) { Unlocked([&] { RebuildGroups(m.settings.mapper, &m.state); }); },
      "Vanishing points, planes, members, incidences and relations anew.");
  type->def(
      "filter_points",
      [](PyMapper& m) {
        return Unlocked([&] { return FilterAllPoints(m.settings.mapper.filter, &m.state); });
      },
      "Removes observations that do not fit; returns how many.");
  type->def(
      "filter_frames",
      [](PyMapper& m) {
        return Unlocked([&] { return FilterFrames(m.settings.mapper.filter, &m.state); });
      },
      "Frames without observations or with cameras that no lens is lose their pose; returns their "
      "images.");
}

void BindAdjustments(nb::class_<PyMapper>* type) {
  type->def(
      "adjust_around",
      [](PyMapper& m, const std::vector<image_t>& ids) {
        for (image_t id : ids) m.CheckRegistered(id);
        Unlocked([&] { m.adjuster.AdjustAround(ids); });
      },
      nb::arg("image_ids"), "Adjusts images with those that see most of the same, and filters.");
  type->def(
      "adjust_all",
      [](PyMapper& m, bool is_last) {
        return Unlocked([&] { return m.adjuster.AdjustAll(is_last); });
      },
      nb::arg("is_last") = false,
      "Adjusts everything, completes, merges and filters; returns images that lost their pose.");
  type->def(
      "adjust_once", [](PyMapper& m) { Unlocked([&] { m.adjuster.AdjustOnce(); }); },
      "Adjusts everything and does nothing else: after the first pair.");
  type->def(
      "is_global_due", [](const PyMapper& m) { return m.adjuster.IsGlobalDue(); },
      "Whether the model has grown so much that adjust_all is due.");
  type->def(
      "is_global_done", [](const PyMapper& m) { return m.adjuster.IsGlobalDone(); },
      "Whether nothing was registered since adjust_all.");
}

void BindState(nb::class_<PyMapper>* type) {
  type->def_prop_ro("num_registered", [](const PyMapper& m) { return m.model().images.size(); });
  type->def_prop_ro("num_points", [](const PyMapper& m) { return m.model().points3D.size(); });
  type->def_prop_ro("num_lines", [](const PyMapper& m) { return m.model().lines3D.size(); });
  type->def_prop_ro("num_groups", [](const PyMapper& m) { return m.model().groups3D.size(); });
  type->def_prop_ro("registered_images", [](const PyMapper& m) {
    std::vector<image_t> ids;
    for (const auto& [id, image] : m.model().images) ids.push_back(id);
    return ids;
  });
  type->def_prop_ro("waiting_images", [](const PyMapper& m) {
    std::vector<image_t> ids;
    for (const auto& [id, image] : m.model().unregistered_images) ids.push_back(id);
    return ids;
  });
  type->def_prop_ro(
      "registration_failures", [](const PyMapper& m) { return m.state.registration_failures; },
      "Why the last registration of an image failed, by image id.");
  type->def_prop_ro(
      "dropped_pairs", [](const PyMapper& m) { return m.pairs.dropped; },
      "Why pairs could not begin a model: how many, by reason.");
  type->def(
      "visibility",
      [](PyMapper& m, image_t id) {
        m.CheckWaiting(id);
        const ImageVisibility& v = m.state.VisibilityOf(id);
        return std::tuple(v.num_points, v.num_lines, v.score);
      },
      nb::arg("image_id"),
      "Points and lines that an image without a pose sees of the model, and COLMAP's score.");
  type->def(
      "matched_images",
      [](const PyMapper& m, image_t id) {
        m.CheckImage(id);
        std::vector<std::tuple<image_t, size_t, size_t>> out;
        for (const MatchedImage& other : m.state.graph().MatchedImages(id))
          out.emplace_back(other.image_id, other.num_matches, other.num_line_matches);
        return out;
      },
      nb::arg("image_id"),
      "(image id, matches of keypoints, of segments) of the images that one has matches with.");
  type->def(
      "model",
      [](const PyMapper& m) {
        Reconstruction copy(m.model());
        Unlocked([&] { UpdateErrors(&copy); });
        return copy;
      },
      "A copy of the model as it stands; images that wait for a pose are its unregistered_images.");
}

}  // namespace

void BindMapper(nb::module_& m) {
  nb::class_<MapperOptionSet, OptionSet>(m, "MapperOptions", "Of mappers.").def(nb::init<>());
  nb::class_<InitialPair> pair(m, "InitialPair", "Two images that can begin a model.");
  pair.def_ro("image_id1", &InitialPair::image_id1);
  pair.def_ro("image_id2", &InitialPair::image_id2);
  pair.def_ro("cam2_from_cam1", &InitialPair::cam2_from_cam1,
              "Baseline 1, but of one frame of a rig the rig's.");
  pair.def_ro("num_inliers", &InitialPair::num_inliers);
  pair.def_ro("median_angle_deg", &InitialPair::median_angle_deg);
  nb::class_<RegistrationReport> report(m, "RegistrationReport", "What a registration found.");
  report.def_ro("accepted", &RegistrationReport::accepted);
  report.def_ro("num_points", &RegistrationReport::num_points, "Matches with points of the model.");
  report.def_ro("num_lines", &RegistrationReport::num_lines);
  report.def_ro("num_point_inliers", &RegistrationReport::num_point_inliers);
  report.def_ro("num_line_inliers", &RegistrationReport::num_line_inliers);
  report.def_ro("failure", &RegistrationReport::failure, "A phrase; empty: none.");
  nb::class_<PyMapper> type(m, "_Mapper", "The stages of an incremental mapper.");
  type.def(
      "__init__",
      [](PyMapper* self, const MapperOptionSet& options, const std::filesystem::path& database_path,
         std::optional<std::filesystem::path> image_path) {
        Interruptible([&] { new (self) PyMapper(options.values, database_path, image_path); });
      },
      nb::arg("options"), nb::arg("database_path"), nb::arg("image_path").none());
  BindInitialPair(&type);
  BindRegistration(&type);
  BindStructure(&type);
  BindAdjustments(&type);
  BindState(&type);
}

}  // namespace holba::python
