// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/gauge.h"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "holba/bundle/bundle_options.h"
#include "holba/bundle/bundle_selection.h"
#include "holba/bundle/flat_index.h"
#include "holba/geometry/manifold.h"
#include "holba/geometry/types.h"

namespace holba {
namespace {

// Motion of a point under the seven similarities about a centre, in its unit of length: rotation
// w, translation v, scale s; X moves by unit * (w x Y + v + s Y), Y = (X - centre) / unit.
using Motion = Eigen::Matrix<double, 3, 7>;
using RowVector7 = Eigen::Matrix<double, 1, 7>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;

// Eigenvalues below this part of the largest one are zero: a direction that is resisted ten
// thousand times less than another is free.
constexpr double kMinEigenvalueRatio = 1e-8;
// Step of central differences, in the unit of length.
constexpr double kStepOfDifferences = 1e-5;

uint64_t KeyOf(const Reconstruction& model, const Image& image) {
  return SensorKey(model.frames.at(image.frame_id).rig_id, image.camera_id);
}

struct SelectedView {
  Eigen::Vector3d centre;  // of the camera
  bool constant;
};

// Adds up what resists the similarities.
class Resistance {
 public:
  Resistance(const Reconstruction& model, const BundleOptions& options,
             const BundleSelection& selection,
             const std::vector<std::pair<image_t, const Image*>>& images,
             const FlatIndex& variable_sensors, bool scale_is_known)
      : model_(model),
        options_(options),
        selection_(selection),
        image_idx_(images.size()),
        scale_is_known_(scale_is_known) {
    FlatIndex frame_idx(selection.frames.size());
    for (const auto& frame : selection.frames) frame_idx.Add(frame.id);
    for (const auto& [id, image] : images) image_idx_.Add(id);
    const std::vector<char> sees = ImagesThatSee();
    std::vector<std::optional<Eigen::Vector3d>> held_centre(selection.frames.size());  // in its rig
    for (size_t i = 0; i < images.size(); ++i) {
      const Image* image = images[i].second;
      const uint32_t frame = frame_idx.Find(image->frame_id);
      const bool constant = selection.frames[frame].constant;
      views_.push_back({image->cam_from_world.OriginInA(), constant});
      centre_ += views_.back().centre;
      if (!constant && sees[i] && !variable_sensors.contains(KeyOf(model, *image))) {
        const Eigen::Vector3d centre = model.SensorFromRig(*image).OriginInA();
        scale_is_known_ |= held_centre[frame] && (centre - *held_centre[frame]).norm() > 0.0;
        held_centre[frame] = centre;
      }
      any_frame_held_ |= constant;
    }
    centre_ /= static_cast<double>(std::max<size_t>(views_.size(), 1));
    for (const SelectedView& view : views_) unit_ = std::max(unit_, (view.centre - centre_).norm());
    if (!(unit_ > 0.0)) unit_ = 1.0;
  }

  const Eigen::Vector3d& centre() const { return centre_; }
  double unit() const { return unit_; }

  // Similarities that nothing resists, as columns. First what frames, baselines and points resist,
  // then, where that leaves something, lines and groups.
  Eigen::MatrixXd FreeWithoutStructure() {
    if (scale_is_known_) Add(RowVector7::Unit(6));
    const auto held = [](const auto& element) { return element.constant; };
    const bool any_point_held =
        std::any_of(selection_.points.begin(), selection_.points.end(), held);
    if (any_frame_held_ || any_point_held) AddPoints();
    return Free();
  }
  Eigen::MatrixXd FreeWithStructure() {
    const auto held = [](const auto& element) { return element.constant; };
    const bool any_line_held = options_.config >= BundleConfig::kPointLine &&
                               std::any_of(selection_.lines.begin(), selection_.lines.end(), held);
    const bool any_group_held =
        options_.config >= BundleConfig::kGroups &&
        std::any_of(selection_.groups.begin(), selection_.groups.end(), held);
    if ((any_frame_held_ && options_.config >= BundleConfig::kPointLine) || any_line_held)
      AddLines();
    if (any_group_held) AddGroups();
    return Free();
  }

 private:
  // By the numbers of the images. One that sees nothing of the selection has no residual: its
  // place in the rig fixes nothing. Not looked at where no frame has a baseline.
  std::vector<char> ImagesThatSee() const {
    const size_t num_images = image_idx_.size();
    const bool any_baseline =
        std::any_of(selection_.frames.begin(), selection_.frames.end(),
                    [&](const auto& frame) { return model_.frames.at(frame.id).data.size() > 1; });
    if (!any_baseline) return std::vector<char>(num_images, 1);
    std::vector<char> sees(num_images, 0);
    size_t num_blind = num_images;
    const auto look = [&](const auto& track) {
      for (const auto& observation : track) {
        const uint32_t idx = image_idx_.Find(observation.image_id);
        if (idx == FlatIndex::kNone || sees[idx]) continue;
        sees[idx] = 1;
        --num_blind;
      }
    };
    for (const auto& point : selection_.points) {
      if (num_blind == 0) return sees;
      look(model_.points3D.at(point.id).track);
    }
    if (options_.config < BundleConfig::kPointLine) return sees;
    for (const auto& line : selection_.lines) look(model_.lines3D.at(line.id).track);
    return sees;
  }

  Motion MotionOf(const Eigen::Vector3d& X) const {
    const Eigen::Vector3d Y = (X - centre_) / unit_;
    Motion motion;
    motion << -CrossMatrix(Y), Eigen::Matrix3d::Identity(), Y;
    return unit_ * motion;
  }
  // The similarity itself, in one of the seven directions.
  Sim3d Similarity(int direction, double step) const {
    Sim3d moved_from_world;
    if (direction < 3)
      moved_from_world.rotation = ExpRotation(step * Eigen::Vector3d::Unit(direction));
    if (direction == 6) moved_from_world.scale = std::exp(step);
    moved_from_world.translation =
        centre_ - moved_from_world.scale * (moved_from_world.rotation * centre_);
    if (direction >= 3 && direction < 6)
      moved_from_world.translation += step * unit_ * Eigen::Vector3d::Unit(direction - 3);
    return moved_from_world;
  }

  template <typename Rows>
  void Add(const Rows& rows) {
    if (!rows.allFinite()) return;
    sum_ += rows.transpose() * rows;
  }
  Eigen::MatrixXd Free() const {
    // Of dynamic size: one of a fixed size takes the compiler 27 s for this file in place of 20.
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(sum_);
    const double least = kMinEigenvalueRatio * eigen.eigenvalues()[6];
    int count = 0;
    while (count < 7 && !(eigen.eigenvalues()[count] > least)) ++count;
    return eigen.eigenvectors().leftCols(count);
  }
  // Looks at whether something is still free after 8, 16, 32, ... of some elements.
  class Enough {
   public:
    bool operator()(const Resistance& of) {
      if (++count_ < next_) return false;
      next_ *= 2;
      return of.Free().cols() == 0;
    }

   private:
    size_t count_ = 0, next_ = 8;
  };

  // A point that moves against a camera is resisted across the ray.
  void AddPoints() {
    Enough enough;
    for (const auto& point : selection_.points) {
      const Point3D& record = model_.points3D.at(point.id);
      const Motion motion = MotionOf(record.xyz);
      for (const PointObservation& observation : record.track) {
        const uint32_t idx = image_idx_.Find(observation.image_id);
        if (idx == FlatIndex::kNone || views_[idx].constant == point.constant) continue;
        const Eigen::Vector3d ray = record.xyz - views_[idx].centre;
        const Eigen::Vector3d u = ray.normalized();
        Add(Motion((motion - u * (u.transpose() * motion)) / ray.norm()));
      }
      if (enough(*this)) return;
    }
  }

  // A line that moves against a camera is resisted across the plane in which it is seen.
  void AddLines() {
    Enough enough;
    for (const auto& line : selection_.lines) {
      const Line3D& record = model_.lines3D.at(line.id);
      for (const LineObservation& observation : record.track) {
        const uint32_t idx = image_idx_.Find(observation.image_id);
        if (idx == FlatIndex::kNone || views_[idx].constant == line.constant) continue;
        const Eigen::Vector3d& centre = views_[idx].centre;
        const Eigen::RowVector3d normal =
            (record.start - centre).cross(record.end - centre).normalized().transpose();
        for (const Eigen::Vector3d& X : {record.start, record.end})
          Add(RowVector7(normal * MotionOf(X) / (X - centre).norm()));
      }
      if (enough(*this)) return;
    }
  }

  // A member that moves against its group is resisted where it leaves the group.
  void AddGroups() {
    Enough enough;
    FlatIndex point_idx(selection_.points.size()), line_idx(selection_.lines.size());
    for (const auto& point : selection_.points) point_idx.Add(point.id);
    for (const auto& line : selection_.lines) line_idx.Add(line.id);
    for (const SelectedGroup& group : selection_.groups) {
      const Group3D& record = model_.groups3D.at(group.id);
      double g[kMaxGroupParams];
      if (!record.type->from_file(record.params.data(), g)) continue;
      for (const point3D_t id : group.point3D_ids) {
        const uint32_t idx = point_idx.Find(id);
        if (idx == FlatIndex::kNone || selection_.points[idx].constant == group.constant) continue;
        AddPointMember(*record.type, g, model_.points3D.at(id).xyz);
        if (enough(*this)) return;
      }
      for (const line3D_t id : group.line3D_ids) {
        const uint32_t idx = line_idx.Find(id);
        if (idx == FlatIndex::kNone || selection_.lines[idx].constant == group.constant) continue;
        AddLineMember(*record.type, g, model_.lines3D.at(id));
        if (enough(*this)) return;
      }
    }
  }

  void AddPointMember(const GroupType& type, const double* g, const Eigen::Vector3d& X) {
    AddDifferences<3>([&](const Sim3d& moved_from_world, auto* away) {
      Eigen::Vector3d projected;
      if (!type.project_point(g, moved_from_world * X, &projected)) return false;
      *away = (X - moved_from_world.Inverse() * projected) / unit_;
      return true;
    });
  }

  void AddLineMember(const GroupType& type, const double* g, const Line3D& line) {
    if (type.IsParallelism()) {
      Eigen::Vector3d vp;
      type.direction(g, &vp, nullptr);
      AddDifferences<3>([&](const Sim3d& moved_from_world, auto* away) {
        *away = line.line.direction.cross(moved_from_world.Inverse().rotation * vp);
        return true;
      });
      return;
    }
    AddDifferences<6>([&](const Sim3d& moved_from_world, auto* away) {
      const PlueckerLine moved = Transform(moved_from_world, line.line);
      Vector6d pluecker, projected;
      pluecker << moved.direction, moved.moment;
      if (!type.project_line(g, pluecker, &projected)) return false;
      const double length = projected.head<3>().norm();
      if (!(length > 0.0)) return false;
      const PlueckerLine on_group =
          Transform(moved_from_world.Inverse(),
                    PlueckerLine{projected.head<3>() / length, projected.tail<3>() / length});
      away->template head<3>() = (line.start - on_group.ClosestPoint(line.start)) / unit_;
      away->template tail<3>() = (line.end - on_group.ClosestPoint(line.end)) / unit_;
      return true;
    });
  }

  // Central differences of how far a member is from its group, as seen by what is variable: that
  // moves by the similarity, the group stays.
  template <int kDim, typename Away>
  void AddDifferences(const Away& away) {
    Eigen::Matrix<double, kDim, 7> rows;
    for (int k = 0; k < 7; ++k) {
      Eigen::Matrix<double, kDim, 1> plus, minus;
      if (!away(Similarity(k, kStepOfDifferences), &plus) ||
          !away(Similarity(k, -kStepOfDifferences), &minus))
        return;
      rows.col(k) = (plus - minus) / (2.0 * kStepOfDifferences);
    }
    // What is left of differences of directions that change nothing is rounding.
    rows = (rows.array().abs() > 1e-7).select(rows, 0.0);
    Add(rows);
  }

  const Reconstruction& model_;
  const BundleOptions& options_;
  const BundleSelection& selection_;
  FlatIndex image_idx_;
  std::vector<SelectedView> views_;
  bool scale_is_known_ = false, any_frame_held_ = false;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  double unit_ = 0.0;
  Matrix7 sum_ = Matrix7::Zero();
};

// Derivatives of a pose's tangent coordinates with respect to the similarities, translations in the
// unit of length. R' = R exp(-w): the rotation follows w alone.
Eigen::Matrix<double, 3, 7> RotationMotion(const Rigid3d& pose) {
  Eigen::Matrix<double, 3, 7> motion = Eigen::Matrix<double, 3, 7>::Zero();
  motion.leftCols<3>() = -pose.RotationMatrix();
  return motion;
}
// t = -R c, where the place c moves like a point; once no similarity that is free rotates.
Eigen::Matrix<double, 3, 7> TranslationMotion(const Rigid3d& pose, const Eigen::Vector3d& place,
                                              const Eigen::Vector3d& centre, double unit) {
  const Eigen::Matrix3d R = pose.RotationMatrix();
  Eigen::Matrix<double, 3, 7> motion = Eigen::Matrix<double, 3, 7>::Zero();
  motion.block<3, 3>(0, 3) = -R;
  motion.rightCols<1>() = -R * (place - centre) / unit;
  return motion;
}

// The sensor that is held in the place of a rig's reference; null: none, the reference is.
const Rig::Sensor* StandIn(const Reconstruction& model, const BundleSelection& selection,
                           rig_t rig_id) {
  for (const HeldSensor& held : selection.held_sensors) {
    if (held.rig_id != rig_id || held.why != HeldSensor::Why::kStandsForReference) continue;
    for (const Rig::Sensor& sensor : model.rigs.at(rig_id).sensors) {
      if (sensor.id == SensorId{SensorType::kCamera, held.camera_id}) return &sensor;
    }
  }
  return nullptr;
}

// Where the sensor of a frame is that is held in the rig. Under a similarity of all cameras and
// features, the translation of the frame's pose follows this place.
Eigen::Vector3d PlaceOf(const Reconstruction& model, const BundleSelection& selection,
                        const Frame& frame) {
  const Rig::Sensor* stand_in = StandIn(model, selection, frame.rig_id);
  if (stand_in == nullptr) return frame.rig_from_world.OriginInA();
  return (*stand_in->sensor_from_rig * frame.rig_from_world).OriginInA();
}

// How an adjusted sensor's translation in its rig grows with the scale.
Eigen::Vector3d BaselineOf(const Reconstruction& model, const BundleSelection& selection,
                           const Image& image) {
  const Rigid3d& sensor_from_rig = model.SensorFromRig(image);
  const Rig::Sensor* stand_in = StandIn(model, selection, model.frames.at(image.frame_id).rig_id);
  if (stand_in == nullptr) return sensor_from_rig.translation;
  return sensor_from_rig * stand_in->sensor_from_rig->OriginInA();
}

// Takes the coordinates of `rows` (their derivatives by what is free) that determine most, one
// after the other, until they determine all that they can. Returns their mask and leaves in `free`
// what is still free.
uint32_t HoldCoordinates(Eigen::MatrixXd rows, int first_coordinate, Eigen::MatrixXd* free) {
  const double largest = rows.rowwise().norm().maxCoeff();
  Eigen::MatrixXd rest = rows * *free;
  uint32_t mask = 0;
  while (free->cols() > 0) {
    Eigen::Index row;
    const double norm = rest.rowwise().norm().maxCoeff(&row);
    if (!(norm > 1e-6 * largest)) break;
    mask |= uint32_t{1} << (first_coordinate + static_cast<int>(row));
    // What is free and does not move this coordinate.
    const Eigen::VectorXd direction = rest.row(row).transpose().normalized();
    const Eigen::Index n = free->cols();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> complement(
        Eigen::MatrixXd::Identity(n, n) - direction * direction.transpose());
    *free = *free * complement.eigenvectors().rightCols(n - 1);
    rest = rows * *free;
  }
  return mask;
}

}  // namespace

FixedGauge ChooseGauge(const Reconstruction& model, const BundleOptions& options,
                       const BundleSelection& selection, bool scale_is_known) {
  FixedGauge gauge;
  if (options.gauge == Gauge::kFree || !selection.HasVariableFrame()) return gauge;
  const auto images = ImagesOf(model, selection);
  FlatIndex variable_sensors(selection.sensors.size());
  for (const SelectedSensor& sensor : selection.sensors) {
    if (!sensor.constant) variable_sensors.Add(SensorKey(sensor.rig_id, sensor.camera_id));
  }
  Resistance resistance(model, options, selection, images, variable_sensors, scale_is_known);
  Eigen::MatrixXd free = resistance.FreeWithoutStructure();
  if (free.cols() > 0) {
    const Eigen::Index without_structure = free.cols();
    free = resistance.FreeWithStructure();
    gauge.needs_structure = free.cols() < without_structure;
  }
  if (free.cols() == 0) return gauge;

  FlatIndex variable(selection.frames.size());
  for (const auto& frame : selection.frames) {
    if (!frame.constant) variable.Add(frame.id);
  }
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  double farthest = 0.0;
  int coordinate = 0;
  for (const auto& [image_id, image] : images) {
    if (!variable.contains(image->frame_id)) continue;
    const Frame& frame = model.frames.at(image->frame_id);
    const Rigid3d& pose = frame.rig_from_world;
    const Eigen::Vector3d place = PlaceOf(model, selection, frame);
    if (gauge.origin_frame == kInvalidId32) {
      gauge.origin_frame = image->frame_id;
      origin = place;
    }
    // Scaling the scene about the first camera moves this translation along R (c - origin).
    const Eigen::Vector3d move = pose.RotationMatrix() * (place - origin);
    if (move.norm() <= farthest) continue;
    farthest = move.norm();
    gauge.scale_frame = image->frame_id;
    move.cwiseAbs().maxCoeff(&coordinate);
  }
  if (gauge.origin_frame == kInvalidId32) return gauge;
  // Where frames are nearer to each other than sensors in their rig, as in a rig that stands still,
  // the noise of their distance would become that of the scale.
  Eigen::Vector3d baseline = Eigen::Vector3d::Zero();
  for (const auto& [image_id, image] : images) {
    if (!variable.contains(image->frame_id) || !variable_sensors.contains(KeyOf(model, *image)))
      continue;
    const Eigen::Vector3d of_sensor = BaselineOf(model, selection, *image);
    if (of_sensor.norm() <= farthest) continue;
    farthest = of_sensor.norm();
    gauge.scale_frame = kInvalidId32;
    gauge.scale_rig = model.frames.at(image->frame_id).rig_id;
    gauge.scale_camera = image->camera_id;
    baseline = of_sensor;
    baseline.cwiseAbs().maxCoeff(&coordinate);
  }
  if (free.cols() == 7) {
    gauge.origin_held = FixedGauge::kWholePose;
    if (farthest > 0.0) gauge.scale_held = uint32_t{1} << (3 + coordinate);
    return gauge;
  }
  const auto translation_of = [&](frame_t id) {
    const Frame& frame = model.frames.at(id);
    return TranslationMotion(frame.rig_from_world, PlaceOf(model, selection, frame),
                             resistance.centre(), resistance.unit());
  };
  gauge.origin_held =
      HoldCoordinates(RotationMotion(model.frames.at(gauge.origin_frame).rig_from_world), 0, &free);
  gauge.origin_held |= HoldCoordinates(translation_of(gauge.origin_frame), 3, &free);
  Eigen::Matrix<double, 3, 7> scale_motion = Eigen::Matrix<double, 3, 7>::Zero();
  if (gauge.scale_frame != kInvalidId32) {
    scale_motion = translation_of(gauge.scale_frame);
  } else if (gauge.scale_rig != kInvalidId32) {
    scale_motion.col(6) = baseline / resistance.unit();
  }
  gauge.scale_held = HoldCoordinates(scale_motion, 3, &free);
  if (gauge.scale_held == 0)
    gauge.scale_frame = gauge.scale_rig = gauge.scale_camera = kInvalidId32;
  return gauge;
}

}  // namespace holba
