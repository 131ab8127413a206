// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/localize.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/threads.h"
#include "holba/base/timer.h"
#include "holba/base/words.h"
#include "holba/estimation/directions/vanishing_points.h"
#include "holba/estimation/two_view/relative_pose.h"
#include "holba/geometry/angle.h"
#include "holba/io/files.h"
#include "holba/pipeline/image_structure.h"
#include "holba/pipeline/model_sightings.h"
#include "holba/pipeline/pair_lists.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

// Fewer sightings agree with a wrong pose by chance.
constexpr int kMinNumInliers = 12;
// A pair says where segments are looked for and which points are tried, no more: the pose judges
// them all together.
constexpr int kMinNumInliersOfPair = 8;

class Localizer {
 public:
  using ProgressFunction = std::function<void(const std::string&, size_t, size_t)>;

  Localizer(const LocalizeOptions& options, const fs::path& image_path, const fs::path& work_folder,
            Database* database, Reconstruction* model, const ProgressFunction& progress)
      : options_(options),
        num_threads_(options.matching.num_threads),
        image_path_(image_path),
        work_folder_(work_folder),
        database_(*database),
        model_(*model),
        progress_(progress) {}

  LocalizeReport Run() {
    ListNewImages();
    Timer timer;
    FindFeatures();
    FindIds();
    report_.extract_seconds = timer.Seconds();
    timer = Timer();
    Match();
    report_.match_seconds = timer.Seconds();
    timer = Timer();
    FindPoses();
    AddToModel();
    report_.pose_seconds = timer.Seconds();
    return std::move(report_);
  }

 private:
  struct Task {
    LocalizedImage* image;
    Camera camera;
    bool focal_is_known = false;
    bool hold_intrinsics = false;  // they are those of the model, or were given
    camera_t database_camera_id = kInvalidId32;
    std::optional<camera_t> model_camera_id;  // it is one of the model's
    ModelSightings sightings;
  };

  void ListNewImages() {
    std::set<std::string> in_model;
    for (const auto& [id, image] : model_.images) in_model.insert(image.name);
    std::vector<std::string> names;
    if (!image_path_.empty()) {
      names = PhotographNames(image_path_, options_.image_list_path);
    } else if (!options_.image_list_path.empty()) {
      names = NamesOfDatabase(PhotographNames(image_path_, options_.image_list_path));
    } else {
      for (const auto& [id, image] : database_.ReadImages()) names.push_back(image.name);
    }
    std::sort(names.begin(), names.end());
    for (std::string& name : names) {
      // The folder may hold the model's photographs, too; one that is asked for by name is
      // answered.
      const bool is_known = in_model.contains(name);
      if (is_known && options_.image_list_path.empty()) continue;
      LocalizedImage image;
      image.name = std::move(name);
      if (is_known) image.failure = "the model has an image of this name";
      report_.images.push_back(std::move(image));
    }
    if (report_.images.empty()) {
      throw InputError(image_path_.empty() ? database_.path() : image_path_,
                       "there is no image that the model lacks; give other photographs");
    }
  }

  std::vector<std::string> NamesOfDatabase(std::vector<std::string> names) const {
    for (const std::string& name : names) {
      if (database_.FindImage(name)) continue;
      throw InputError(options_.image_list_path,
                       fmt::format("'{}' is not in the database; give --image_path", name));
    }
    return names;
  }

  // Whether the database has what is matched of an image.
  bool HasFeatures(image_t database_id) const {
    return database_.NumKeypoints(database_id) && database_.HasDescriptors(database_id) &&
           (!WithLines() || database_.ReadSegmentSettings(database_id));
  }
  bool WithLines() const {
    return options_.from != LocalizeFrom::kPoints && !model_.lines3D.empty();
  }

  // Extracts what the database lacks, of new images and of the model's whose photographs are there.
  void FindFeatures() {
    if (image_path_.empty()) return;
    std::string list;
    size_t count = 0;
    const auto add = [&](const std::string& name) {
      list += name + "\n";
      ++count;
    };
    for (const LocalizedImage& image : report_.images) {
      const auto id = database_.FindImage(image.name);
      if (image.failure.empty() && (!id || !HasFeatures(*id))) add(image.name);
    }
    for (const auto& [id, image] : model_.images) {
      const auto known = database_.FindImage(image.name);
      if ((known && HasFeatures(*known)) || !fs::exists(image_path_ / image.name)) continue;
      if (!known) AddImageOfModel(image);
      add(image.name);
    }
    if (count == 0) return;
    ExtractOptions extract = options_.extract;
    extract.num_threads = num_threads_;
    extract.structure = options_.from != LocalizeFrom::kPoints;
    const fs::path path = work_folder_ / "photographs.txt";
    WriteFileWhole(path, [&](std::ostream* out) { *out << list; });
    extract.image_list_path = path.string();
    const ExtractReport extracted =
        ExtractFeaturesOf(extract, image_path_, &database_, [&](size_t num_done, size_t num_all) {
          if (progress_) progress_("Extracting", num_done, num_all);
        });
    fs::remove(path);
    std::map<std::string, std::string> faults;
    for (const ExtractReport::OfImage& image : extracted.images) {
      if (image.fault) faults.emplace(image.name, *image.fault);
    }
    for (LocalizedImage& image : report_.images) {
      const auto fault = faults.find(image.name);
      if (fault != faults.end()) image.failure = fault->second;
    }
  }

  // With the model's camera, so that its matches are verified with that.
  void AddImageOfModel(const Image& image) {
    const auto [known, is_new] = added_cameras_.emplace(image.camera_id, kInvalidId32);
    if (is_new)
      known->second = database_.AddCamera(std::nullopt, {model_.cameras.at(image.camera_id), true});
    database_.AddImage(std::nullopt, {image.name, known->second});
  }

  void FindIds() {
    const std::map<image_t, DatabaseImage> images = database_.ReadImages();
    std::map<std::string, image_t> id_of_name;
    for (const auto& [id, image] : images) id_of_name.emplace(image.name, id);
    for (const auto& [id, image] : model_.images) {
      const auto known = id_of_name.find(image.name);
      if (known == id_of_name.end()) continue;
      database_id_[id] = known->second;
      model_camera_.emplace(images.at(known->second).camera_id, image.camera_id);
    }
    if (database_id_.empty()) {
      throw InputError(database_.path(),
                       "it has none of the model's images; give the database that the model was "
                       "made from, or the folder of its photographs as --image_path");
    }
    for (LocalizedImage& image : report_.images) {
      const auto known = id_of_name.find(image.name);
      if (known != id_of_name.end()) image.database_id = known->second;
    }
    features_.emplace(model_, database_, database_id_);
    if (features_->num_points_with_keypoint() < features_->num_points_without_keypoint()) {
      throw InputError(
          database_.path(),
          fmt::format("of the model's 2D points {} are at keypoints of the database and {} are "
                      "not; give the one that the model was made from",
                      features_->num_points_with_keypoint(),
                      features_->num_points_without_keypoint()));
    }
  }

  void Match() {
    std::set<image_t> wanted, of_model(features_->images().begin(), features_->images().end());
    for (const LocalizedImage& image : report_.images) {
      if (image.failure.empty() && image.database_id) wanted.insert(*image.database_id);
    }
    std::vector<ImagePair> pairs;
    if (of_model.size() <= static_cast<size_t>(options_.max_num_neighbors)) {
      for (image_t id : wanted) {
        for (image_t other : of_model) pairs.push_back(std::minmax(id, other));
      }
    } else {
      PairListOptions alike;
      alike.selection = PairSelection::kRetrieval;
      // Those that look most like a new image may be new ones, too.
      alike.num_images = options_.max_num_neighbors + static_cast<int>(wanted.size()) - 1;
      for (const ImagePair& pair : ListPairs(alike, database_, num_threads_)) {
        if ((wanted.contains(pair.first) && of_model.contains(pair.second)) ||
            (wanted.contains(pair.second) && of_model.contains(pair.first)))
          pairs.push_back(pair);
      }
    }
    MatchPoints(options_.matching, pairs, &database_, [&](size_t num_done) {
      if (progress_) progress_("Matching", num_done, pairs.size());
    });
    if (WithLines())
      MatchSegmentsOfPairs(options_.segments, pairs, num_threads_, &database_, &line_matches_);
  }

  void FindPoses() {
    const std::map<camera_t, DatabaseCamera> cameras = database_.ReadCameras();
    const std::map<image_t, DatabaseImage> images = database_.ReadImages();
    for (LocalizedImage& image : report_.images) {
      if (!image.failure.empty()) continue;
      if (!image.database_id || database_.NumKeypoints(*image.database_id).value_or(0) == 0) {
        image.failure = "it has no features";
        continue;
      }
      Task task;
      task.image = &image;
      task.database_camera_id = images.at(*image.database_id).camera_id;
      const auto known = model_camera_.find(task.database_camera_id);
      if (known != model_camera_.end()) {
        task.camera = model_.cameras.at(known->second);
        task.model_camera_id = known->second;
        task.focal_is_known = task.hold_intrinsics = true;
      } else {
        const DatabaseCamera& camera = cameras.at(task.database_camera_id);
        task.camera = camera.camera;
        task.focal_is_known = camera.has_prior_focal_length;
        task.hold_intrinsics = !options_.extract.reader.camera_params.empty();
      }
      tasks_.push_back(std::move(task));
    }
    LocaliseAll(MatchesTaken::kVerified, [](const Task& task) { return !task.image->pose; });
    // What the geometry of pairs refused may still agree with one pose in the model.
    LocaliseAll(MatchesTaken::kAll, [](const Task& task) { return !task.image->pose; });
    ShareIntrinsics();
  }

  template <typename Wanted>
  void LocaliseAll(MatchesTaken taken, const Wanted& wanted) {
    std::vector<Task*> chosen;
    for (Task& task : tasks_) {
      if (!wanted(task)) continue;
      ReadSightings(taken, &task);
      chosen.push_back(&task);
    }
    LocaliseThese(chosen);
  }

  void LocaliseThese(const std::vector<Task*>& chosen) {
    ParallelTasks(num_threads_, chosen.size(), [&](size_t i) {
      Task& task = *chosen[i];
      AbsolutePoseOptions pose = options_.pose;
      if (task.hold_intrinsics)
        pose.abs_pose_refine_focal_length = pose.abs_pose_refine_extra_params = false;
      const uint64_t seed =
          (static_cast<uint64_t>(options_.random_seed) << 32) + *task.image->database_id;
      task.image->pose = EstimateAbsolutePose(pose, task.camera, task.focal_is_known,
                                              task.sightings.matches, seed);
    });
    for (const Task* task : chosen) Describe(*task);
  }

  void ReadSightings(MatchesTaken taken, Task* task) {
    task->sightings = features_->Find(database_, *task->image->database_id, taken, line_matches_);
    if (options_.from != LocalizeFrom::kAll) return;
    task->sightings.matches.directions =
        features_->PairDirections(VanishingPointsOf(*task->image->database_id, task->camera));
  }

  std::vector<ImageVanishingPoint> VanishingPointsOf(image_t database_id,
                                                     const Camera& camera) const {
    const auto settings = database_.ReadSegmentSettings(database_id);
    const auto segments = settings ? database_.ReadSegments(database_id, *settings) : std::nullopt;
    if (!segments) return {};
    std::vector<LineSegment2d> ideal;
    for (const LineSegment2d& segment : *segments) {
      const auto start = IdealPixel(*camera.model, camera.params.data(), segment.start);
      const auto end = IdealPixel(*camera.model, camera.params.data(), segment.end);
      if (start && end) ideal.push_back({*start, *end});
    }
    return DetectVanishingPoints(options_.extract.vps, ideal, CalibrationMatrix(camera)).points;
  }

  void Describe(const Task& task) {
    LocalizedImage& image = *task.image;
    const ModelSightings& sightings = task.sightings;
    image.focal_was_known = task.focal_is_known;
    image.num_neighbours = sightings.num_images;
    image.num_matches = {sightings.points.size(), sightings.lines.size(),
                         sightings.matches.directions.size()};
    image.camera = task.camera;
    if (image.pose) {
      image.camera.params = image.pose->params;
      image.failure.clear();
      return;
    }
    const size_t num_features = sightings.points.size() + sightings.lines.size();
    const auto least = static_cast<size_t>(options_.pose.abs_pose_min_num_inliers);
    if (num_features == 0) {
      image.failure = "it shares no match with the model";
    } else if (num_features < least) {
      image.failure = fmt::format(
          "it shares {} and {} with the model, fewer than the {} of "
          "--Mapper.abs_pose_min_num_inliers",
          Counted(sightings.points.size(), "point"), Counted(sightings.lines.size(), "line"),
          least);
    } else {
      image.failure = fmt::format("no pose that {} of its {} and {} agree with", least,
                                  Counted(sightings.points.size(), "point"),
                                  Counted(sightings.lines.size(), "line"));
    }
  }

  // Of images of one camera that nothing was known of, the one that most agrees with tells the
  // others its intrinsics: a single image tells a focal length from a distance badly.
  void ShareIntrinsics() {
    std::map<camera_t, std::vector<Task*>> by_camera;
    for (Task& task : tasks_) {
      if (!task.hold_intrinsics) by_camera[task.database_camera_id].push_back(&task);
    }
    for (const auto& [id, tasks] : by_camera) {
      const Task* best = nullptr;
      for (const Task* task : tasks) {
        if (task->image->pose && (!best || task->image->pose->gain > best->image->pose->gain))
          best = task;
      }
      if (best == nullptr || tasks.size() < 2) continue;
      std::vector<Task*> others;
      for (Task* task : tasks) {
        if (task == best) continue;
        const bool was_known = task->focal_is_known;
        task->camera.params = best->image->pose->params;
        task->focal_is_known = task->hold_intrinsics = true;
        others.push_back(task);
        if (options_.from == LocalizeFrom::kAll) {
          task->sightings.matches.directions =
              features_->PairDirections(VanishingPointsOf(*task->image->database_id, task->camera));
        }
        task->image->focal_was_known = was_known;
      }
      const bool was_known = best->image->focal_was_known;
      LocaliseThese(others);
      for (Task* task : others) task->image->focal_was_known = was_known;
    }
  }

  void AddToModel() {
    image_t next_image = 1;
    camera_t next_camera = 1;
    for (const auto& [id, image] : model_.images) next_image = std::max(next_image, id + 1);
    for (const auto& [id, image] : model_.unregistered_images)
      next_image = std::max(next_image, id + 1);
    for (const auto& [id, camera] : model_.cameras) next_camera = std::max(next_camera, id + 1);
    std::map<std::pair<camera_t, std::vector<double>>, camera_t> added;
    for (const Task& task : tasks_) {
      LocalizedImage& localized = *task.image;
      if (!localized.pose) continue;
      ++report_.num_localized;
      camera_t camera_id;
      if (task.model_camera_id) {
        camera_id = *task.model_camera_id;
      } else {
        // Images of one camera with the same intrinsics share it in the model, too.
        const auto [it, is_new] =
            added.emplace(std::pair(task.database_camera_id, localized.camera.params), next_camera);
        if (is_new) model_.cameras.Add(next_camera++, localized.camera);
        camera_id = it->second;
      }
      ForgetWaiting(localized.name);
      Image image;
      image.name = localized.name;
      image.camera_id = camera_id;
      AddFeatures(*localized.database_id, &image);
      const image_t own = *localized.database_id;
      const bool is_free = model_.FindImage(own) == nullptr;
      const image_t id = is_free ? own : next_image++;
      next_image = std::max(next_image, id + 1);
      model_.AddUnregisteredImage(id, std::move(image));
      model_.RegisterImage(id, localized.pose->cam_from_world);
      Observe(id, task);
      localized.image_id = id;
    }
  }

  // An image that the model knows without a pose is the one that has one now.
  void ForgetWaiting(const std::string& name) {
    for (const auto& [waiting_id, image] : model_.unregistered_images) {
      if (image.name != name) continue;
      const image_t id = waiting_id;  // the pair is removed below
      const frame_t frame_id = image.frame_id;
      if (Frame* frame = model_.unregistered_frames.Find(frame_id)) {
        std::erase_if(frame->data, [id](const Frame::Data& data) {
          return data.sensor.type == SensorType::kCamera && data.data_id == id;
        });
        if (frame->data.empty()) model_.unregistered_frames.Remove(frame_id);
      }
      model_.unregistered_images.Remove(id);
      return;
    }
  }

  void AddFeatures(image_t database_id, Image* image) const {
    if (const auto keypoints = database_.ReadKeypoints(database_id)) {
      for (size_t k = 0; k < keypoints->size(); ++k)
        image->points2D.push_back({keypoints->Position(k), kNoId});
    }
    const auto settings = database_.ReadSegmentSettings(database_id);
    const auto segments = settings ? database_.ReadSegments(database_id, *settings) : std::nullopt;
    if (!segments) return;
    for (const LineSegment2d& segment : *segments) image->lines2D.push_back({segment, kNoId});
  }

  // What agrees with the pose becomes an observation: a 2D feature of one 3D feature, a point once.
  void Observe(image_t id, const Task& task) {
    const AbsolutePose& pose = *task.image->pose;
    const Image& image = model_.images.at(id);
    std::set<point3D_t> seen;
    for (size_t k = 0; k < task.sightings.points.size(); ++k) {
      const auto& [idx, point] = task.sightings.points[k];
      if (!pose.inliers.points[k] || image.points2D[idx].point3D_id != kNoId ||
          !seen.insert(point).second)
        continue;
      model_.AddObservation(point, PointObservation{id, idx});
    }
    for (size_t k = 0; k < task.sightings.lines.size(); ++k) {
      const auto& [idx, line] = task.sightings.lines[k];
      if (!pose.inliers.lines[k] || image.lines2D[idx].line3D_id != kNoId) continue;
      model_.AddObservation(line, LineObservation{id, idx});
    }
  }

  const LocalizeOptions& options_;
  const int num_threads_;
  const fs::path image_path_, work_folder_;
  Database& database_;
  Reconstruction& model_;
  const ProgressFunction& progress_;
  LocalizeReport report_;
  std::map<camera_t, camera_t> added_cameras_;  // the model's to the database's
  std::map<image_t, image_t> database_id_;      // of the model's images
  std::map<camera_t, camera_t> model_camera_;   // the database's to the model's
  std::optional<FeaturesOfModel> features_;
  LineMatchMap line_matches_;
  std::vector<Task> tasks_;
};

double LargestDeviation(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(solver.eigenvalues()[2], 0.0));
}

}  // namespace

LocalizeOptions::LocalizeOptions() {
  pose.abs_pose_min_num_inliers = kMinNumInliers;
  matching.geometry.min_num_inliers = kMinNumInliersOfPair;
}

void LocalizeOptions::Describe(OptionTable* table) const {
  table->Field(
      "image_list_path", &image_list_path,
      "File of names, a line each, of what is localised; empty: all that the model lacks.");
  table
      ->Choice("from", &from,
               {{"points", LocalizeFrom::kPoints},
                {"lines", LocalizeFrom::kPointsAndLines},
                {"all", LocalizeFrom::kAll}},
               "What poses come from: points alone, points and lines, or all, with vanishing "
               "directions.")
      .Basic();
  table->Field(
      "max_num_neighbors", &max_num_neighbors, AtLeast(1),
      "Images that each photograph is matched with; those of the model that look most like it, "
      "all if it has no more.");
  table->Field("random_seed", &random_seed, AtLeast(0), "Seed of the samples.");
  pose.Describe(table);
  extract.reader.Describe(table);
  extract.sift.Describe(table);
  extract.extraction.Describe(table);
  extract.vps.Describe(table);
  matching.Describe(table);
  segments.Describe(table);
}

void LocalizeOptions::Check() const {
  extract.Check();
  if (!image_list_path.empty() && !fs::is_regular_file(image_list_path))
    throw NoSuchFile(image_list_path);
}

double LocalizedImage::CentreSigma() const {
  HOLBA_CHECK(pose.has_value());
  const Eigen::Matrix3d R = pose->cam_from_world.RotationMatrix();
  // C = -R' t: a rotation w of the camera's frame and a translation dt move it by
  // -R' (dt + t x w).
  Eigen::Matrix<double, 3, 6> J;
  J << -R.transpose() * CrossMatrix<double>(pose->cam_from_world.translation), -R.transpose();
  return LargestDeviation(J * pose->covariance * J.transpose());
}

double LocalizedImage::RotationSigmaDeg() const {
  HOLBA_CHECK(pose.has_value());
  return RadToDeg(LargestDeviation(pose->covariance.topLeftCorner<3, 3>()));
}

LocalizeReport Localize(
    const LocalizeOptions& options, const fs::path& image_path, const fs::path& work_folder,
    Database* database, Reconstruction* model,
    const std::function<void(const std::string& step, size_t num_done, size_t num_all)>& progress) {
  return Localizer(options, image_path, work_folder, database, model, progress).Run();
}

}  // namespace holba
