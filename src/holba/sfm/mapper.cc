// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/mapper.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <set>
#include <utility>

#include "holba/base/timer.h"
#include "holba/sfm/contradictions.h"
#include "holba/sfm/filter_model.h"
#include "holba/sfm/join_models.h"
#include "holba/sfm/next_image.h"
#include "holba/sfm/snapshot_archive.h"
#include "holba/sfm/triangulate_lines.h"
#include "holba/sfm/why_left_out.h"

namespace holba {
namespace {

// Grows one model.
class Mapper {
 public:
  Mapper(const MapperOptions& options, const SolverOptions& solver, MapperState* state,
         MapObserver* observer)
      : options_(options),
        num_threads_(solver.num_threads),
        state_(*state),
        observer_(*observer),
        adjuster_(options, solver, state) {}

  // False: no pair of images begins a model.
  bool Begin(InitialPairReport* pairs) {
    const Timer timer;
    // COLMAP's relaxation: half of the inliers, half of the angle, twice. Then walks straight
    // ahead, with the smallest angle that points have anyway.
    InitialPairOptions initial = options_.initial;
    for (int relaxation = 0; relaxation < 6; ++relaxation) {
      if (relaxation == 1 || relaxation == 3)
        initial.min_num_inliers = std::max(initial.min_num_inliers / 2, 5);
      if (relaxation == 2 || relaxation == 4) initial.min_angle_deg /= 2.0;
      if (relaxation == 5) {
        initial.min_angle_deg =
            std::min(initial.min_angle_deg, options_.triangulation.min_angle_deg);
        initial.max_forward_motion = 2.0;
      }
      state_.tried_initial_pairs.clear();
      state_.num_initial_trials.clear();
      while (const auto pair =
                 FindInitialPair(initial, options_.random_seed, num_threads_, &state_, pairs)) {
        if (!BeginFrom(*pair)) {
          ++pairs->dropped["too few points after the adjustment"];
          continue;
        }
        report_.initial_pair = *pair;
        Count("initial pair", timer);
        return true;
      }
    }
    return false;
  }

  // A model that came with poses: what its images have in common that it does not have yet.
  void Continue() {
    std::vector<image_t> images;
    for (const auto& [id, image] : state_.model().images) images.push_back(id);
    report_.num_registered = images.size();
    Triangulate(images);
  }

  // `on_whole`: called before another image is looked for, where the whole model was adjusted since
  // the last call.
  void Grow(const std::function<void()>& on_whole) {
    while (!observer_.ShouldStop() && !state_.model().images.empty() && !Overlaps()) {
      if (is_whole_) OnWhole(on_whole);
      const std::optional<image_t> image_id = RegisterNext();
      if (!image_id) {
        if (is_last_chance_ && adjuster_.IsGlobalDone()) break;
        // Better poses may let images in that were refused.
        is_last_chance_ = true;
        AdjustAll(true);
        continue;
      }
      is_last_chance_ = false;
      const std::vector<image_t> frame = state_.ImagesOfFrame(*image_id);
      Triangulate(frame);
      if (IsContradictedAgain(frame)) continue;
      AdjustAround(frame);
      if (adjuster_.IsGlobalDue()) AdjustAll(false);
      observer_.OnImage(state_, *image_id, Sentence(*image_id));
    }
    if (!adjuster_.IsGlobalDone() && !state_.model().images.empty()) AdjustAll(true);
    CountTotal();
  }

  // Snapshots (snapshot_archive.h), at the head of Grow's loop.
  template <typename Archive>
  void Visit(Archive* archive) {
    (*archive)(report_, is_last_chance_, frames_at_check_);
    adjuster_.Visit(archive);
  }

  // Images that got poses from another model.
  void TakeIn(const std::vector<image_t>& images) {
    const Timer timer;
    report_.num_registered += images.size();
    Triangulate(images);
    AdjustAll(true);
    report_.total_seconds += timer.Seconds();
  }

  MapReport Report() {
    report_.adjustments = adjuster_.report();
    return std::move(report_);
  }

 private:
  // Whether a further model has come into one that is there: more images of it show nothing new.
  bool Overlaps() const {
    if (state_.images_of_earlier_models.empty()) return false;
    const auto num_shared = std::count_if(
        state_.model().images.begin(), state_.model().images.end(),
        [&](const auto& image) { return state_.images_of_earlier_models.contains(image.first); });
    return num_shared >= std::max(options_.max_model_overlap, 1);
  }

  void OnWhole(const std::function<void()>& on_whole) {
    is_whole_ = false;
    state_.RenewIndices();
    CountTotal();
    on_whole();
  }

  bool BeginFrom(const InitialPair& pair) {
    RegisterInitialPair(pair, &state_);
    TriangulationOptions triangulation = options_.triangulation;
    std::vector<image_t> images = state_.ImagesOfFrame(pair.image_id1);
    for (const image_t id : state_.ImagesOfFrame(pair.image_id2)) {
      if (std::find(images.begin(), images.end(), id) == images.end()) images.push_back(id);
    }
    // Two images know of every point no more than each other.
    triangulation.ignore_two_view_tracks = false;
    for (const image_t id : images) TriangulateImage(triangulation, id, &state_);
    Triangulate(images);
    adjuster_.AdjustOnce();
    FilterAllPoints(options_.filter, &state_);
    state_.TakeModifiedPoints();
    const size_t needed = std::min<size_t>(options_.registration.pose.abs_pose_min_num_inliers,
                                           options_.initial.min_num_inliers);
    if (state_.model().points3D.size() >= needed &&
        std::all_of(images.begin(), images.end(), [&](image_t id) {
          const Image& image = state_.model().images.at(id);
          return IsPlausible(options_.filter, state_.model().cameras.at(image.camera_id));
        })) {
      report_.num_registered = images.size();
      observer_.OnImage(state_, pair.image_id2, Sentence(pair.image_id2));
      return true;
    }
    Undo(images);
    return false;
  }

  // Frames lose their poses, and cameras that no other image has are as given again.
  void Undo(const std::vector<image_t>& images) {
    for (const image_t id : images) {
      const Image* image = state_.model().images.Find(id);
      if (image != nullptr) state_.DeregisterFrame(image->frame_id);
    }
    ResetFreeCameras(images);
  }

  void ResetFreeCameras(const std::vector<image_t>& images) {
    for (const image_t id : images) {
      const camera_t camera_id = state_.model().FindImage(id)->camera_id;
      if (state_.NumRegistered(camera_id) == 0)
        state_.mutable_model()->cameras.at(camera_id).params = state_.given_params.at(camera_id);
    }
  }

  // Points and lines first; where none of the images that see some can be registered, matches
  // alone.
  std::optional<image_t> RegisterNext() {
    const Timer timer;
    std::optional<image_t> registered;
    for (const image_t id : RankNextImages(options_.next, &state_)) {
      if (Try(id, RegisterImage(options_, id, &state_))) {
        registered = id;
        break;
      }
    }
    if (!registered && options_.registration.structure_less) {
      const size_t min_matches =
          2 * static_cast<size_t>(options_.registration.pose.abs_pose_min_num_inliers);
      for (const image_t id : RankByMatches(options_.next, min_matches, state_)) {
        if (Try(id, RegisterWithoutStructure(options_, id, &state_))) {
          ++report_.num_registered_without_structure;
          registered = id;
          break;
        }
      }
    }
    Count("registration", timer);
    return registered;
  }

  bool Try(image_t image_id, const RegistrationReport& registration) {
    if (registration.accepted) {
      report_.num_registered += state_.ImagesOfFrame(image_id).size();
      return true;
    }
    ++state_.num_registration_trials[image_id];
    state_.registration_failures[image_id] = registration.failure;
    ++report_.num_failed_registrations;
    return false;
  }

  void Triangulate(const std::vector<image_t>& images) {
    const Timer timer;
    for (const image_t id : images)
      report_.points += TriangulateImage(options_.triangulation, id, &state_);
    Count("triangulation", timer);
    if (options_.structure == MapperStructure::kNone) return;
    const Timer line_timer;
    for (const image_t id : images)
      report_.lines += TriangulateLines(options_.structure_options.lines, id, &state_);
    Count("lines", line_timer);
  }

  void AdjustAround(const std::vector<image_t>& images) {
    const Timer timer;
    adjuster_.AdjustAround(images);
    Count("local adjustment", timer);
  }

  void AdjustAll(bool is_last) {
    const Timer timer;
    Remove(adjuster_.AdjustAll(is_last));
    if (TakeContradictedBack(is_last)) Remove(adjuster_.AdjustAll(is_last));
    Count("global adjustment", timer);
    is_whole_ = true;
  }

  // Looks at all pairs of like views, so that it is done at the end and each time that the model
  // has grown by a quarter. Whether any image lost its pose.
  bool TakeContradictedBack(bool is_last) {
    const size_t num_frames = state_.model().frames.size();
    if (!options_.filter.contradicted_images || (!is_last && 4 * num_frames < 5 * frames_at_check_))
      return false;
    frames_at_check_ = num_frames;
    std::vector<image_t> contradicted = MissingMatches(state_).ContradictedImages();
    std::erase_if(contradicted, [&](image_t id) {
      return state_.existing_frames.contains(state_.model().images.at(id).frame_id);
    });
    if (contradicted.empty()) return false;
    report_.num_contradicted += contradicted.size();
    state_.contradicted.insert(contradicted.begin(), contradicted.end());
    Undo(contradicted);
    Remove(contradicted);
    return true;
  }

  // Images that lost their pose have been tried.
  void Remove(const std::vector<image_t>& removed) {
    for (const image_t id : removed) ++state_.num_registration_trials[id];
    report_.num_registered -= std::min(report_.num_registered, removed.size());
    ResetFreeCameras(removed);
  }

  // An image that was contradicted before has more to show.
  bool IsContradictedAgain(const std::vector<image_t>& images) {
    if (std::none_of(images.begin(), images.end(),
                     [&](image_t id) { return state_.contradicted.contains(id); }))
      return false;
    const MissingMatches missing(state_);
    double num_missing = 0.0, num_seen = 0.0;
    for (const image_t id : images) {
      num_missing += missing.MissingOf(id);
      const Image& image = state_.model().images.at(id);
      num_seen += static_cast<double>(
          std::count_if(image.points2D.begin(), image.points2D.end(),
                        [](const Point2D& point) { return point.point3D_id != kNoId; }));
    }
    if (num_missing <= num_seen) return false;
    Undo(images);
    Remove(images);
    return true;
  }

  void CountTotal() {
    report_.total_seconds += since_counted_.Seconds();
    since_counted_ = Timer();
  }
  void Count(const char* stage, const Timer& timer) { report_.seconds[stage] += timer.Seconds(); }

  std::string Sentence(image_t image_id) const {
    const Reconstruction& model = state_.model();
    return fmt::format("{}: {} images, {} points, {} lines, {} groups",
                       model.FindImage(image_id)->name, model.images.size(), model.points3D.size(),
                       model.lines3D.size(), model.groups3D.size());
  }

  const MapperOptions& options_;
  const int num_threads_;
  MapperState& state_;
  MapObserver& observer_;
  MapAdjuster adjuster_;
  MapReport report_;
  size_t frames_at_check_ = 0;   // when missing matches were last looked for
  bool is_last_chance_ = false;  // everything that was refused is tried once more
  bool is_whole_ = false;        // all was adjusted since the last snapshot
  Timer since_counted_;
};

// What a run has besides the model that grows.
struct Run {
  MapResult result;
  std::set<image_t> in_models;
  std::set<ImagePair> failed_pairs;
  bool is_done = false;

  template <typename Archive>
  void Visit(Archive* archive) {
    (*archive)(result, in_models, failed_pairs, is_done);
  }
};

// Models that share enough images with the greatest become part of it.
void JoinModels(const MapperOptions& options, const SolverOptions& solver,
                const MappingInput& input, MapObserver* observer,
                std::vector<MappedModel>* models) {
  for (size_t i = 1; i < models->size();) {
    MappedModel& greatest = models->front();
    MapperState state(input, greatest.model);
    state.existing_frames.clear();
    std::vector<image_t> added;
    for (const auto& [id, image] : (*models)[i].model.images) {
      if (!greatest.model.images.contains(id)) added.push_back(id);
    }
    const auto num_joined = JoinModel((*models)[i].model, &state);
    if (!num_joined) {
      ++i;
      continue;
    }
    if (*num_joined > 0) {
      Mapper mapper(options, solver, &state, observer);
      mapper.TakeIn(added);
      greatest.model = state.model();
      greatest.report.num_joined += *num_joined;
    }
    models->erase(models->begin() + static_cast<std::ptrdiff_t>(i));
  }
}

}  // namespace

MapResult MapImages(const MapperOptions& options, const SolverOptions& solver,
                    const MappingInput& input, const Reconstruction& scene, MapObserver* observer,
                    const std::string& snapshot) {
  MapObserver silent;
  if (observer == nullptr) observer = &silent;
  Run run;
  MapResult& result = run.result;
  std::optional<SnapshotReader> start;
  if (!snapshot.empty()) run.Visit(&start.emplace(snapshot, scene));
  std::optional<MapperState> state;
  while (!run.is_done && result.models.size() < static_cast<size_t>(options.max_num_models) &&
         !observer->ShouldStop()) {
    const bool is_first = result.models.empty();
    state.emplace(input, scene);
    state->images_of_earlier_models = run.in_models;
    state->failed_initial_pairs = run.failed_pairs;
    Mapper mapper(options, solver, &*state, observer);
    if (start) {
      state->Visit(&*start);
      mapper.Visit(&*start);
      start.reset();
    } else if (!scene.frames.empty()) {
      mapper.Continue();
    } else if (!mapper.Begin(&result.initial_pairs)) {
      if (is_first) result.left_out = WhyLeftOut(options, *state);
      break;
    }
    mapper.Grow([&] {
      if (!observer->WantsSnapshot()) return;
      SnapshotWriter writer(scene);
      run.Visit(&writer);
      state->Visit(&writer);
      mapper.Visit(&writer);
      observer->OnSnapshot(writer.bytes());
    });
    if (is_first) result.left_out = WhyLeftOut(options, *state);
    const Reconstruction& model = state->model();
    MapReport report = mapper.Report();
    if (model.images.empty()) {
      // It fell apart: the next pair may do better.
      if (!scene.frames.empty()) break;
      const auto [a, b] = std::minmax(report.initial_pair.image_id1, report.initial_pair.image_id2);
      run.failed_pairs.insert({a, b});
      ++result.initial_pairs.dropped["the model that it began fell apart"];
      continue;
    }
    size_t num_shared = 0;
    for (const auto& [id, image] : model.images) num_shared += run.in_models.contains(id);
    const size_t num_new = model.images.size() - num_shared;
    for (const auto& [id, image] : model.images) run.in_models.insert(id);
    const bool is_large = model.images.size() >= static_cast<size_t>(options.min_model_size);
    if (is_first || is_large) result.models.push_back({model, std::move(report)});
    if (!options.multiple_models || !scene.frames.empty() || num_new == 0) break;
    if (run.in_models.size() >= input.graph.image_ids().size()) break;
  }
  if (!run.is_done) {
    std::stable_sort(result.models.begin(), result.models.end(), [](const auto& a, const auto& b) {
      return a.model.images.size() > b.model.images.size();
    });
    JoinModels(options, solver, input, observer, &result.models);
  }
  for (const MappedModel& mapped : result.models) {
    for (const auto& [id, image] : mapped.model.images) result.left_out.erase(id);
  }
  run.is_done = true;
  if (observer->WantsSnapshot()) {
    SnapshotWriter writer(scene);
    run.Visit(&writer);
    observer->OnSnapshot(writer.bytes());
  }
  return std::move(run.result);
}

}  // namespace holba
