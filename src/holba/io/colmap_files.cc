// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/colmap_files.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "holba/io/record_faults.h"

namespace holba {
namespace {

// Poses of image file and frame that differ by less are the same pose, rounded differently.
constexpr double kSamePose = 1e-9;

std::string CameraModelNames() {
  std::string names;
  for (const CameraModel* model : AllCameraModels()) {
    if (!names.empty()) names += ", ";
    names += model->name;
  }
  return names;
}

template <typename In>
const CameraModel* ReadCameraModel(In& in) {
  if constexpr (In::kBinary) {
    const int32_t id = in.Int32("MODEL_ID");
    const CameraModel* model = FindCameraModel(id);
    if (model == nullptr) {
      in.Fail(fmt::format("expected MODEL_ID (the number of a camera model: {}), found {}",
                          CameraModelNames(), id));
    }
    return model;
  } else {
    const std::string_view name = in.Word("MODEL", "the name of a camera model");
    const CameraModel* model = FindCameraModel(name);
    if (model == nullptr) {
      in.Fail(fmt::format("expected MODEL (one of {}), found '{}'", CameraModelNames(),
                          name.substr(0, 40)));
    }
    return model;
  }
}

template <typename In>
SensorType ReadSensorType(In& in) {
  if constexpr (In::kBinary) {
    const int32_t type = in.Int32("SENSOR_TYPE");
    if (type == static_cast<int32_t>(SensorType::kCamera)) return SensorType::kCamera;
    if (type == static_cast<int32_t>(SensorType::kImu)) return SensorType::kImu;
    in.Fail(fmt::format("expected SENSOR_TYPE (0 CAMERA or 1 IMU), found {}", type));
  } else {
    const std::string_view type = in.Word("SENSOR_TYPE", "CAMERA or IMU");
    if (type == "CAMERA") return SensorType::kCamera;
    if (type == "IMU") return SensorType::kImu;
    in.Fail(fmt::format("expected SENSOR_TYPE (CAMERA or IMU), found '{}'", type.substr(0, 40)));
  }
}

template <typename In>
SensorId ReadSensor(In& in) {
  const SensorType type = ReadSensorType(in);
  return {type, in.Key32("SENSOR_ID")};
}

template <typename Out>
void WriteSensor(Out& out, const SensorId& sensor) {
  if constexpr (Out::kBinary) {
    out.Int32(static_cast<int32_t>(sensor.type));
  } else {
    out.Word(sensor.type == SensorType::kImu ? "IMU" : "CAMERA");
  }
  out.Index(sensor.id);
}

// COLMAP takes a quaternion of any length. What is off by rounding keeps its bits.
void NormaliseAsColmap(Eigen::Quaterniond* rotation) {
  constexpr double kRounding = 1e-3;
  const double norm = rotation->norm();
  if (std::isfinite(norm) && norm > 0.0 && std::abs(norm - 1.0) > kRounding)
    rotation->coeffs() /= norm;
}

// `what` names the record in messages: "image 3".
template <typename In>
Rigid3d ReadPose(In& in, const std::string& what) {
  Rigid3d pose;
  pose.rotation.w() = in.Real("QW");
  pose.rotation.x() = in.Real("QX");
  pose.rotation.y() = in.Real("QY");
  pose.rotation.z() = in.Real("QZ");
  NormaliseAsColmap(&pose.rotation);
  pose.translation = ReadVector3(in, "TX", "TY", "TZ");
  if (const Fault fault = FindFault(pose)) in.FailRecord(FaultOf(what, *fault));
  return pose;
}

template <typename Out>
void WritePose(Out& out, const Rigid3d& pose) {
  out.Real(pose.rotation.w());
  out.Real(pose.rotation.x());
  out.Real(pose.rotation.y());
  out.Real(pose.rotation.z());
  WriteVector3(out, pose.translation);
}

bool SamePose(const Rigid3d& a, const Rigid3d& b) {
  const Eigen::Vector4d p = a.rotation.coeffs().normalized(), q = b.rotation.coeffs().normalized();
  return std::min((p - q).norm(), (p + q).norm()) <= kSamePose &&
         (a.translation - b.translation).norm() <= kSamePose * (1.0 + b.translation.norm());
}

uint64_t NumObservations(const Reconstruction& model) {
  uint64_t count = 0;
  for (const auto& [point3D_id, point] : model.points3D) count += point.track.size();
  return count;
}

std::string Ratio(uint64_t sum, size_t count) {
  return RealToText(count == 0 ? 0.0 : static_cast<double>(sum) / static_cast<double>(count));
}

template <typename In>
void ReadCameraRecords(In& in, Reconstruction* model) {
  in.Begin("the number of cameras", 24);
  while (in.NextRecord()) {
    const camera_t camera_id = in.Key32("CAMERA_ID");
    Camera camera;
    camera.model = ReadCameraModel(in);
    camera.width = in.Number("WIDTH");
    camera.height = in.Number("HEIGHT");
    for (int i = 0; i < camera.model->num_params; ++i) camera.params.push_back(in.Real("PARAMS"));
    in.EndRecord();
    if (const Fault fault = FindFault(camera)) {
      in.FailRecord(FaultOf(fmt::format("camera {}", camera_id), *fault));
    }
    if (!model->cameras.Add(camera_id, std::move(camera))) {
      in.FailRecord(ThereTwice(fmt::format("camera {}", camera_id)));
    }
  }
}

template <typename In>
void ReadRigRecords(In& in, Reconstruction* model) {
  in.Begin("the number of rigs", 8);
  while (in.NextRecord()) {
    const rig_t rig_id = in.Key32("RIG_ID");
    const size_t num_sensors = in.Count32("NUM_SENSORS", 8);
    Rig rig;
    std::vector<SensorId> sensors;
    for (size_t i = 0; i < num_sensors; ++i) {
      const SensorId sensor = ReadSensor(in);
      if (sensor.type == SensorType::kCamera && !model->cameras.contains(sensor.id)) {
        in.Fail(NamesWhatIsMissing(fmt::format("rig {}", rig_id), ToString(sensor)));
      }
      sensors.push_back(sensor);
      if (i == 0) {
        rig.ref_sensor = sensor;
        continue;
      }
      rig.sensors.push_back({.id = sensor, .sensor_from_rig = std::nullopt});
      const uint8_t has_pose = in.Byte("HAS_POSE");
      if (has_pose > 1) in.Fail(fmt::format("expected HAS_POSE (0 or 1), found {}", has_pose));
      if (has_pose == 1) {
        rig.sensors.back().sensor_from_rig =
            ReadPose(in, fmt::format("rig {}: the pose of {}", rig_id, ToString(sensor)));
      }
    }
    in.EndRecord();
    std::sort(sensors.begin(), sensors.end());
    const auto twice = std::adjacent_find(sensors.begin(), sensors.end());
    if (twice != sensors.end()) {
      in.FailRecord(ThereTwice(fmt::format("{} of rig {}", ToString(*twice), rig_id)));
    }
    if (!model->rigs.Add(rig_id, std::move(rig))) {
      in.FailRecord(ThereTwice(fmt::format("rig {}", rig_id)));
    }
  }
}

bool HasSensor(const Rig& rig, const SensorId& sensor) {
  return rig.ref_sensor == sensor ||
         std::any_of(rig.sensors.begin(), rig.sensors.end(),
                     [&](const Rig::Sensor& other) { return other.id == sensor; });
}

// Frames and images come in two files each: those with a pose (COLMAP's), and those without (ours,
// the same but for the pose).
enum class Registration { kRegistered, kUnregistered };

template <Registration kRegistration, typename In>
void ReadFrameRecords(In& in, Reconstruction* model) {
  constexpr bool kHasPose = kRegistration == Registration::kRegistered;
  std::unordered_map<uint64_t, frame_t> frame_of_image;
  in.Begin("the number of frames", kHasPose ? 68 : 12);
  while (in.NextRecord()) {
    const frame_t frame_id = in.Key32("FRAME_ID");
    Frame frame;
    frame.rig_id = in.Key32("RIG_ID");
    const Rig* rig = model->rigs.Find(frame.rig_id);
    if (rig == nullptr) {
      in.Fail(NamesWhatIsMissing(fmt::format("frame {}", frame_id),
                                 fmt::format("rig {}", frame.rig_id)));
    }
    if constexpr (kHasPose) frame.rig_from_world = ReadPose(in, fmt::format("frame {}", frame_id));
    for (size_t left = in.Count32("NUM_DATA_IDS", 16); left > 0; --left) {
      Frame::Data data;
      data.sensor = ReadSensor(in);
      if (!HasSensor(*rig, data.sensor)) {
        in.Fail(FaultOf(fmt::format("frame {}", frame_id),
                        fmt::format("has data of {}, which is not in its rig {}",
                                    ToString(data.sensor), frame.rig_id)));
      }
      data.data_id = in.Key("DATA_ID");
      if (data.sensor.type == SensorType::kCamera) {
        const auto [other, is_new] = frame_of_image.emplace(data.data_id, frame_id);
        if (!is_new) {
          in.Fail(FaultOf(
              fmt::format("image {}", data.data_id),
              fmt::format("is in frame {} and again in frame {}", other->second, frame_id)));
        }
      }
      frame.data.push_back(data);
    }
    in.EndRecord();
    auto& frames = kHasPose ? model->frames : model->unregistered_frames;
    if ((!kHasPose && model->frames.contains(frame_id)) ||
        !frames.Add(frame_id, std::move(frame))) {
      in.FailRecord(ThereTwice(fmt::format("frame {}", frame_id)));
    }
  }
}

// The frame of each image, from rigs and frames that were read before the images.
struct FrameOfImage {
  frame_t frame_id;
  SensorId sensor;
};
std::unordered_map<uint64_t, FrameOfImage> FramesOfImages(const IdMap<frame_t, Frame>& all) {
  std::unordered_map<uint64_t, FrameOfImage> frames;
  for (const auto& [frame_id, frame] : all) {
    for (const Frame::Data& data : frame.data) {
      if (data.sensor.type == SensorType::kCamera) {
        frames.emplace(data.data_id, FrameOfImage{frame_id, data.sensor});
      }
    }
  }
  return frames;
}

// Puts the image into its frame and gives it the pose of frame and rig.
template <typename In>
void JoinFrame(In& in, const Reconstruction& model,
               const std::unordered_map<uint64_t, FrameOfImage>& frames, image_t image_id,
               Image* image) {
  const auto found = frames.find(image_id);
  if (found == frames.end()) {
    in.FailRecord(fmt::format(
        "image {} is in no frame; it must be in one, as the model has rigs and frames", image_id));
  }
  const SensorId sensor{SensorType::kCamera, image->camera_id};
  if (found->second.sensor != sensor) {
    in.FailRecord(FaultOf(fmt::format("image {}", image_id),
                          fmt::format("is of {}, but its frame {} says {}", ToString(sensor),
                                      found->second.frame_id, ToString(found->second.sensor))));
  }
  image->frame_id = found->second.frame_id;
  const Frame* registered = model.frames.Find(image->frame_id);
  if (registered == nullptr) return;
  const Frame& frame = *registered;
  const Rig& rig = model.rigs.at(frame.rig_id);
  Rigid3d pose = frame.rig_from_world;
  if (rig.ref_sensor != sensor) {
    const auto member = std::find_if(rig.sensors.begin(), rig.sensors.end(),
                                     [&](const Rig::Sensor& other) { return other.id == sensor; });
    if (!member->sensor_from_rig) {
      in.FailRecord(FaultOf(fmt::format("image {}", image_id),
                            fmt::format("is of {}, whose pose in rig {} is unknown",
                                        ToString(sensor), frame.rig_id)));
    }
    pose = *member->sensor_from_rig * frame.rig_from_world;
  }
  if (!SamePose(image->cam_from_world, pose)) image->cam_from_world = pose;
}

// What images may name: cameras of the model, or any, which are added.
enum class CamerasOfImages { kOfTheModel, kAny };

template <Registration kRegistration, typename In>
void ReadImageRecords(In& in, Reconstruction* model,
                      CamerasOfImages cameras = CamerasOfImages::kOfTheModel) {
  constexpr bool kHasPose = kRegistration == Registration::kRegistered;
  // As COLMAP: without any rig and frame a model is of the older form, whatever files there are.
  const bool has_frames = kHasPose ? !model->rigs.empty() || !model->frames.empty()
                                   : !model->unregistered_frames.empty();
  const auto frames = FramesOfImages(kHasPose ? model->frames : model->unregistered_frames);
  in.Begin("the number of images", kHasPose ? 73 : 17);
  while (in.NextRecord()) {
    const image_t image_id = in.Key32("IMAGE_ID");
    Image image;
    if constexpr (kHasPose) image.cam_from_world = ReadPose(in, fmt::format("image {}", image_id));
    image.camera_id = in.Key32("CAMERA_ID");
    if (cameras == CamerasOfImages::kAny) {
      model->cameras.Add(image.camera_id, {.model = FindCameraModel("SIMPLE_PINHOLE"),
                                           .width = 1,
                                           .height = 1,
                                           .params = {1, 0.5, 0.5}});
    } else if (!model->cameras.contains(image.camera_id)) {
      in.Fail(NamesWhatIsMissing(fmt::format("image {}", image_id),
                                 fmt::format("camera {}", image.camera_id)));
    }
    size_t list;
    if constexpr (In::kBinary) {
      image.name = in.ZeroTerminated("NAME");
      if (image.name.empty())
        in.Fail(fmt::format("expected NAME of image {}, found none", image_id));
      list = in.Count("NUM_POINTS2D", kHasPose ? 24 : 16);
      image.points2D.reserve(list);
    } else {
      image.name = in.Rest("NAME", "the name of the image file");
      if (image.name.find('\0') != std::string::npos) {
        in.Fail(fmt::format("expected NAME of image {}, found a zero byte in it", image_id));
      }
    }
    if (has_frames) JoinFrame(in, *model, frames, image_id, &image);
    if constexpr (!In::kBinary) {
      in.NextRawLine("POINTS2D");
      list = in.List("POINTS2D", kHasPose ? 24 : 16);
    }
    while (in.More(&list)) {
      Point2D point;
      point.xy.x() = in.Real("X");
      point.xy.y() = in.Real("Y");
      if constexpr (kHasPose) point.point3D_id = in.Id("POINT3D_ID");
      image.points2D.push_back(point);
    }
    in.EndRecord();
    auto& images = kHasPose ? model->images : model->unregistered_images;
    if ((!kHasPose && model->images.contains(image_id)) ||
        !images.Add(image_id, std::move(image))) {
      in.FailRecord(ThereTwice(fmt::format("image {}", image_id)));
    }
  }
  if (!has_frames) model->AddTrivialRigsAndFrames();
}

template <typename In>
void ReadPointRecords(In& in, Reconstruction* model) {
  in.Begin("the number of points", 51);
  model->points3D.Reserve(in.NumRecordsAtMost());
  while (in.NextRecord()) {
    const point3D_t point3D_id = in.Key("POINT3D_ID");
    Point3D point;
    point.xyz = ReadVector3(in, "X", "Y", "Z");
    point.rgb[0] = in.Byte("R");
    point.rgb[1] = in.Byte("G");
    point.rgb[2] = in.Byte("B");
    point.error = in.Real("ERROR");
    for (size_t list = in.List("TRACK_LENGTH", 8); in.More(&list);) {
      point.track.push_back(ReadObservation<PointObservation>(in, "POINT2D_IDX"));
    }
    in.EndRecord();
    if (!model->points3D.Add(point3D_id, std::move(point))) {
      in.FailRecord(ThereTwice(fmt::format("3D point {}", point3D_id)));
    }
  }
}

void CheckNameFitsText(image_t image_id, const std::string& name) {
  const auto is_blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  if (!name.empty() && name.find('\n') == std::string::npos && !is_blank(name.front()) &&
      !is_blank(name.back())) {
    return;
  }
  throw InputError(fmt::format(
      "image {} has the name '{}', which a text file cannot hold (it is empty, has a line break, "
      "or a blank at an end); write a binary model (--output_type bin), or rename the image",
      image_id, name));
}

}  // namespace

void ReadCameras(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                 Reconstruction* model) {
  WithInput(format, bytes, path, [&](auto& in) { ReadCameraRecords(in, model); });
}

void ReadRigs(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
              Reconstruction* model) {
  model->has_rig_files = true;
  WithInput(format, bytes, path, [&](auto& in) { ReadRigRecords(in, model); });
}

void ReadFrames(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                Reconstruction* model) {
  WithInput(format, bytes, path,
            [&](auto& in) { ReadFrameRecords<Registration::kRegistered>(in, model); });
}

void ReadImages(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                Reconstruction* model) {
  WithInput(format, bytes, path,
            [&](auto& in) { ReadImageRecords<Registration::kRegistered>(in, model); });
}

void ReadImagePoses(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                    Reconstruction* model) {
  WithInput(format, bytes, path, [&](auto& in) {
    ReadImageRecords<Registration::kRegistered>(in, model, CamerasOfImages::kAny);
  });
}

void ReadPoints3D(ModelFormat format, std::string_view bytes, const std::filesystem::path& path,
                  Reconstruction* model) {
  WithInput(format, bytes, path, [&](auto& in) { ReadPointRecords(in, model); });
}

void WriteCameras(ModelFormat format, const Reconstruction& model, std::ostream* stream) {
  WithOutput(format, stream, [&](auto& out) {
    if constexpr (!std::decay_t<decltype(out)>::kBinary) {
      out.Comment("Camera list with one line of data per camera:");
      out.Comment("  CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]");
      out.Comment(fmt::format("Number of cameras: {}", model.cameras.size()));
    }
    out.Begin(model.cameras.size());
    for (const auto& [camera_id, camera] : model.cameras) {
      out.Index(camera_id);
      if constexpr (std::decay_t<decltype(out)>::kBinary) {
        out.Int32(camera.model->id);
      } else {
        out.Word(camera.model->name);
      }
      out.Number(camera.width);
      out.Number(camera.height);
      for (const double param : camera.params) out.Real(param);
      out.EndRecord();
    }
  });
}

void WriteRigs(ModelFormat format, const Reconstruction& model, std::ostream* stream) {
  WithOutput(format, stream, [&](auto& out) {
    if constexpr (!std::decay_t<decltype(out)>::kBinary) {
      out.Comment("Rig calib list with one line of data per calib:");
      out.Comment(
          "  RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, SENSORS[] as (SENSOR_TYPE, "
          "SENSOR_ID, HAS_POSE, [QW, QX, QY, QZ, TX, TY, TZ])");
      out.Comment(fmt::format("Number of rigs: {}", model.rigs.size()));
    }
    out.Begin(model.rigs.size());
    for (const auto& [rig_id, rig] : model.rigs) {
      out.Index(rig_id);
      out.Index(static_cast<uint32_t>(rig.sensors.size() + (rig.ref_sensor ? 1 : 0)));
      if (rig.ref_sensor) WriteSensor(out, *rig.ref_sensor);
      for (const Rig::Sensor& sensor : rig.sensors) {
        WriteSensor(out, sensor.id);
        out.Byte(sensor.sensor_from_rig ? 1 : 0);
        if (sensor.sensor_from_rig) WritePose(out, *sensor.sensor_from_rig);
      }
      out.EndRecord();
    }
  });
}

namespace {

template <Registration kRegistration>
void WriteFrameRecords(ModelFormat format, const Reconstruction& model, std::ostream* stream) {
  constexpr bool kHasPose = kRegistration == Registration::kRegistered;
  const auto& frames = kHasPose ? model.frames : model.unregistered_frames;
  WithOutput(format, stream, [&](auto& out) {
    if constexpr (!std::decay_t<decltype(out)>::kBinary) {
      out.Comment(kHasPose ? "Frame list with one line of data per frame:"
                           : "Frames without a pose, one line of data per frame:");
      out.Comment(fmt::format(
          "  FRAME_ID, RIG_ID, {}NUM_DATA_IDS, DATA_IDS[] as (SENSOR_TYPE, SENSOR_ID, DATA_ID)",
          kHasPose ? "RIG_FROM_WORLD[QW, QX, QY, QZ, TX, TY, TZ], " : ""));
      out.Comment(fmt::format("Number of frames: {}", frames.size()));
    }
    out.Begin(frames.size());
    for (const auto& [frame_id, frame] : frames) {
      out.Index(frame_id);
      out.Index(frame.rig_id);
      if constexpr (kHasPose) WritePose(out, frame.rig_from_world);
      out.Index(static_cast<uint32_t>(frame.data.size()));
      for (const Frame::Data& data : frame.data) {
        WriteSensor(out, data.sensor);
        out.Number(data.data_id);
      }
      out.EndRecord();
    }
  });
}

template <Registration kRegistration>
void WriteImageRecords(ModelFormat format, const Reconstruction& model, std::ostream* stream) {
  constexpr bool kHasPose = kRegistration == Registration::kRegistered;
  const auto& images = kHasPose ? model.images : model.unregistered_images;
  WithOutput(format, stream, [&](auto& out) {
    constexpr bool kBinary = std::decay_t<decltype(out)>::kBinary;
    if constexpr (!kBinary && kHasPose) {
      out.Comment("Image list with two lines of data per image:");
      out.Comment("  IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME");
      out.Comment("  POINTS2D[] as (X, Y, POINT3D_ID)");
      out.Comment(fmt::format("Number of images: {}, mean observations per image: {}",
                              images.size(), Ratio(NumObservations(model), images.size())));
    } else if constexpr (!kBinary) {
      out.Comment("Images without a pose, two lines of data per image:");
      out.Comment("  IMAGE_ID, CAMERA_ID, NAME");
      out.Comment("  POINTS2D[] as (X, Y)");
      out.Comment(fmt::format("Number of images: {}", images.size()));
    }
    out.Begin(images.size());
    for (const auto& [image_id, image] : images) {
      out.Index(image_id);
      if constexpr (kHasPose) WritePose(out, image.cam_from_world);
      out.Index(image.camera_id);
      if constexpr (kBinary) {
        out.ZeroTerminated(image.name);
        out.Count(image.points2D.size());
      } else {
        CheckNameFitsText(image_id, image.name);
        out.Word(image.name);
        out.EndRecord();
      }
      for (const Point2D& point : image.points2D) {
        out.Real(point.xy.x());
        out.Real(point.xy.y());
        if constexpr (kHasPose) out.Id(point.point3D_id);
      }
      out.EndRecord();
    }
  });
}

}  // namespace

void WriteFrames(ModelFormat format, const Reconstruction& model, std::ostream* stream) {
  WriteFrameRecords<Registration::kRegistered>(format, model, stream);
}
void WriteImages(ModelFormat format, const Reconstruction& model, std::ostream* stream) {
  WriteImageRecords<Registration::kRegistered>(format, model, stream);
}
void ReadUnregisteredFrames(ModelFormat format, std::string_view bytes,
                            const std::filesystem::path& path, Reconstruction* model) {
  WithInput(format, bytes, path,
            [&](auto& in) { ReadFrameRecords<Registration::kUnregistered>(in, model); });
}
void ReadUnregisteredImages(ModelFormat format, std::string_view bytes,
                            const std::filesystem::path& path, Reconstruction* model) {
  WithInput(format, bytes, path,
            [&](auto& in) { ReadImageRecords<Registration::kUnregistered>(in, model); });
}
void WriteUnregisteredFrames(ModelFormat format, const Reconstruction& model,
                             std::ostream* stream) {
  WriteFrameRecords<Registration::kUnregistered>(format, model, stream);
}
void WriteUnregisteredImages(ModelFormat format, const Reconstruction& model,
                             std::ostream* stream) {
  WriteImageRecords<Registration::kUnregistered>(format, model, stream);
}

void WritePoints3D(ModelFormat format, const Reconstruction& model, std::ostream* stream) {
  WithOutput(format, stream, [&](auto& out) {
    if constexpr (!std::decay_t<decltype(out)>::kBinary) {
      out.Comment("3D point list with one line of data per point:");
      out.Comment("  POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)");
      out.Comment(fmt::format("Number of points: {}, mean track length: {}", model.points3D.size(),
                              Ratio(NumObservations(model), model.points3D.size())));
    }
    out.Begin(model.points3D.size());
    for (const auto& [point3D_id, point] : model.points3D) {
      out.Id(point3D_id);
      WriteVector3(out, point.xyz);
      for (const uint8_t channel : point.rgb) out.Byte(channel);
      out.Real(point.error);
      out.List(point.track.size());
      for (const PointObservation& observation : point.track) {
        out.Index(observation.image_id);
        out.Index(observation.point2D_idx);
      }
      out.EndRecord();
    }
  });
}

}  // namespace holba
