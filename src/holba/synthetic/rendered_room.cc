// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/rendered_room.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "holba/base/random.h"
#include "holba/base/threads.h"

namespace holba {
namespace {

using Eigen::Vector3d;

constexpr double kTexelsPerMetre = 300.0;  // finer than the photographs' pixels
constexpr int kSamples = 2;                // of a pixel in each direction

// A painted rectangle in space.
class Surface {
 public:
  // From the corner `origin` along two directions at right angles, whose lengths are its own.
  Surface(const Vector3d& origin, const Vector3d& u, const Vector3d& v, double shade,
          Random* random)
      : origin_(origin),
        u_(u.normalized()),
        v_(v.normalized()),
        normal_(u.cross(v).normalized()),
        size_u_(u.norm()),
        size_v_(v.norm()),
        columns_(static_cast<int>(std::lround(size_u_ * kTexelsPerMetre))),
        rows_(static_cast<int>(std::lround(size_v_ * kTexelsPerMetre))),
        texels_(static_cast<size_t>(columns_) * static_cast<size_t>(rows_)) {
    const Vector3d colour =
        shade * Vector3d(170 + random->Uniform(-20, 20), 165 + random->Uniform(-20, 20),
                         155 + random->Uniform(-20, 20));
    std::fill(texels_.begin(), texels_.end(), colour.cast<float>());
  }

  // A panel (metres from the origin) with a frame, bars and discs on it.
  void Paint(double a, double b, double width, double height, Random* random) {
    const auto colour = [&] {
      return Eigen::Vector3f(static_cast<float>(random->Uniform(20, 240)),
                             static_cast<float>(random->Uniform(20, 240)),
                             static_cast<float>(random->Uniform(20, 240)));
    };
    const Eigen::Vector3f frame = colour();
    FillRectangle(a, b, width, height, frame);
    FillRectangle(a + 0.03, b + 0.03, width - 0.06, height - 0.06, colour());
    const int num_shapes = static_cast<int>(60.0 * width * height) + 8;
    for (int i = 0; i < num_shapes; ++i) {
      const double w = random->Uniform(0.04, 0.3) * width, h = random->Uniform(0.04, 0.3) * height;
      const double x = a + 0.05 + random->Uniform() * (width - 0.1 - w);
      const double y = b + 0.05 + random->Uniform() * (height - 0.1 - h);
      if (i % 3 == 2) {
        FillDisc(x + w / 2, y + h / 2, std::min(w, h) / 2, colour());
      } else {
        FillRectangle(x, y, w, h, colour());
      }
    }
  }

  // Spots on all of it, as plaster and wood have them.
  void Speckle(double per_square_metre, double contrast, Random* random) {
    const auto num_spots = static_cast<int>(per_square_metre * size_u_ * size_v_);
    for (int i = 0; i < num_spots; ++i) {
      const double x = random->Uniform(0, size_u_), y = random->Uniform(0, size_v_);
      const auto change = static_cast<float>(random->Uniform(-contrast, contrast));
      ForDisc(x, y, random->Uniform(0.008, 0.03),
              [&](Eigen::Vector3f* texel) { texel->array() += change; });
    }
  }

  // Where the ray meets it, in lengths of `ray`. Empty: it does not.
  std::optional<double> Meet(const Vector3d& centre, const Vector3d& ray) const {
    const double across = normal_.dot(ray);
    if (across == 0.0) return std::nullopt;
    const double depth = normal_.dot(origin_ - centre) / across;
    if (!(depth > 1e-9)) return std::nullopt;
    const Vector3d at = centre + depth * ray - origin_;
    const double a = at.dot(u_), b = at.dot(v_);
    if (a < 0 || b < 0 || a >= size_u_ || b >= size_v_) return std::nullopt;
    return depth;
  }

  Eigen::Vector3f ColourAt(const Vector3d& point) const {
    const double a =
        std::clamp((point - origin_).dot(u_) * kTexelsPerMetre - 0.5, 0.0, columns_ - 1.001);
    const double b =
        std::clamp((point - origin_).dot(v_) * kTexelsPerMetre - 0.5, 0.0, rows_ - 1.001);
    const int i = static_cast<int>(a), j = static_cast<int>(b);
    const auto s = static_cast<float>(a - i), t = static_cast<float>(b - j);
    return (1 - t) * ((1 - s) * At(i, j) + s * At(i + 1, j)) +
           t * ((1 - s) * At(i, j + 1) + s * At(i + 1, j + 1));
  }

 private:
  const Eigen::Vector3f& At(int column, int row) const {
    return texels_[static_cast<size_t>(row) * static_cast<size_t>(columns_) +
                   static_cast<size_t>(column)];
  }
  template <typename Change>
  void ForDisc(double x, double y, double radius, const Change& change) {
    ForBox(x - radius, y - radius, 2 * radius, 2 * radius, [&](double a, double b, auto* texel) {
      if ((a - x) * (a - x) + (b - y) * (b - y) < radius * radius) change(texel);
    });
  }
  void FillDisc(double x, double y, double radius, const Eigen::Vector3f& colour) {
    ForDisc(x, y, radius, [&](Eigen::Vector3f* texel) { *texel = colour; });
  }
  void FillRectangle(double x, double y, double width, double height,
                     const Eigen::Vector3f& colour) {
    ForBox(x, y, width, height, [&](double, double, auto* texel) { *texel = colour; });
  }
  // Texels whose centres are in the box, with their places in metres.
  template <typename Change>
  void ForBox(double x, double y, double width, double height, const Change& change) {
    const auto first = [](double metres) {
      return static_cast<int>(std::ceil(metres * kTexelsPerMetre - 0.5));
    };
    for (int row = std::max(0, first(y)); row < std::min(rows_, first(y + height)); ++row) {
      for (int column = std::max(0, first(x)); column < std::min(columns_, first(x + width));
           ++column) {
        change((column + 0.5) / kTexelsPerMetre, (row + 0.5) / kTexelsPerMetre,
               &texels_[static_cast<size_t>(row) * static_cast<size_t>(columns_) +
                        static_cast<size_t>(column)]);
      }
    }
  }

  Vector3d origin_, u_, v_, normal_;
  double size_u_, size_v_;
  int columns_, rows_;
  std::vector<Eigen::Vector3f> texels_;
};

// y points down, the corner of the walls is at x = -2.4, z = 4, the floor at y = 1.2.
std::vector<Surface> Furnish(Random* random) {
  std::vector<Surface> surfaces;
  const auto add = [&](const Vector3d& origin, const Vector3d& u, const Vector3d& v,
                       double shade) -> Surface& {
    Surface& surface = surfaces.emplace_back(origin, u, v, shade, random);
    surface.Speckle(60, 18, random);
    return surface;
  };
  Surface& back = add({-2.4, -1.5, 4}, {5, 0, 0}, {0, 2.7, 0}, 1.15);
  back.Paint(0.4, 0.35, 1.1, 0.8, random);
  back.Paint(1.8, 0.25, 0.8, 1.1, random);
  back.Paint(2.9, 0.45, 1.3, 0.7, random);
  back.Paint(3.1, 1.5, 0.9, 0.6, random);
  Surface& left = add({-2.4, -1.5, 0.4}, {0, 0, 3.6}, {0, 2.7, 0}, 0.85);
  left.Paint(0.8, 0.5, 1.0, 0.9, random);
  left.Paint(2.2, 0.4, 0.9, 1.2, random);
  Surface& floor = add({-2.4, 1.2, 0.4}, {5, 0, 0}, {0, 0, 3.6}, 0.7);
  floor.Paint(1.4, 0.6, 1.8, 1.3, random);
  const auto add_box = [&](const Vector3d& low, const Vector3d& size) {
    const Vector3d x(size.x(), 0, 0), y(0, size.y(), 0), z(0, 0, size.z());
    const auto face = [&](const Vector3d& origin, const Vector3d& u, const Vector3d& v,
                          double shade) {
      Surface& surface = add(origin, u, v, shade);
      surface.Paint(0.08, 0.08, u.norm() - 0.16, v.norm() - 0.16, random);
    };
    face(low, x, y, 1.05);      // towards the cameras
    face(low, z, y, 0.8);       // left
    face(low + x, z, y, 0.75);  // right
    face(low, x, z, 1.2);       // top
  };
  add_box({-1.9, 0.0, 2.7}, {0.9, 1.2, 0.8});
  add_box({0.9, 0.5, 2.3}, {1.1, 0.7, 0.9});
  return surfaces;
}

// On an arc before the corner, alternately higher and lower.
Rigid3d PoseOf(int i, int num_images) {
  const double s = num_images > 1 ? static_cast<double>(i) / (num_images - 1) - 0.5 : 0.0;
  const Vector3d centre(0.6 + 2.8 * s, -0.45 + 0.5 * (i % 2), -0.6 + 0.8 * std::abs(s));
  const Vector3d target(-0.3 - 0.5 * s, 0.0, 3.4);
  Eigen::Matrix3d R;
  R.row(2) = (target - centre).normalized();
  R.row(0) = Vector3d::UnitY().cross(Vector3d(R.row(2))).normalized();
  R.row(1) = R.row(2).cross(R.row(0));
  const Eigen::Quaterniond q = Eigen::Quaterniond(R).normalized();
  return {q, -(q * centre)};
}

RenderedPhotograph Photograph(const RoomOptions& options, const std::vector<Surface>& surfaces,
                              const Camera& camera, const Image& image, uint64_t seed) {
  RenderedPhotograph photograph{image.name, options.width, options.height, {}};
  photograph.rgb.resize(3 * static_cast<size_t>(options.width) *
                        static_cast<size_t>(options.height));
  const Rigid3d world_from_cam = image.cam_from_world.Inverse();
  Random random(seed);
  size_t at = 0;
  for (int row = 0; row < options.height; ++row) {
    for (int column = 0; column < options.width; ++column) {
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      for (int sample = 0; sample < kSamples * kSamples; ++sample) {
        const Eigen::Vector2d pixel(column + (sample % kSamples + 0.5) / kSamples,
                                    row + (sample / kSamples + 0.5) / kSamples);
        const auto in_cam = camera.model->unproject(camera.params.data(), pixel);
        if (!in_cam) continue;
        const Vector3d ray = world_from_cam.rotation * *in_cam;
        double nearest = std::numeric_limits<double>::infinity();
        const Surface* hit = nullptr;
        for (const Surface& surface : surfaces) {
          const auto depth = surface.Meet(world_from_cam.translation, ray);
          if (depth && *depth < nearest) {
            nearest = *depth;
            hit = &surface;
          }
        }
        sum += hit != nullptr ? hit->ColourAt(world_from_cam.translation + nearest * ray)
                              : Eigen::Vector3f::Constant(90.0f);
      }
      for (int channel = 0; channel < 3; ++channel) {
        const double value = sum[channel] / (kSamples * kSamples) + random.Normal(options.noise);
        photograph.rgb[at++] = static_cast<uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
      }
    }
  }
  return photograph;
}

}  // namespace

void RoomOptions::Describe(OptionTable* table) const {
  table->Section("Room");
  table->Field("num_images", &num_images, AtLeast(1), "Photographs of the room.");
  table->Field("width", &width, AtLeast(16), "Width of a photograph in pixels.");
  table->Field("height", &height, AtLeast(16), "Height of a photograph in pixels.");
  table->Field("noise", &noise, AtLeast(0),
               "Standard deviation of the noise of a colour value between 0 and 255.");
  table->Section("");
}

RenderedRoom RenderRoom(const RoomOptions& options, int num_threads) {
  RenderedRoom room;
  Random random(options.seed);
  const std::vector<Surface> surfaces = Furnish(&random);
  // A lens of 36 mm on film of the old size, a little barrel-shaped.
  const double focal_px = 0.9 * std::max(options.width, options.height);
  room.truth.cameras.Add(1, {FindCameraModel("SIMPLE_RADIAL"),
                             static_cast<uint64_t>(options.width),
                             static_cast<uint64_t>(options.height),
                             {focal_px, options.width / 2.0, options.height / 2.0, -0.03}});
  for (int i = 0; i < options.num_images; ++i) {
    Image image{.name = fmt::format("room{:03}.jpg", i + 1), .camera_id = 1};
    image.cam_from_world = PoseOf(i, options.num_images);
    room.truth.images.Add(static_cast<image_t>(i + 1), std::move(image));
  }
  room.truth.AddTrivialRigsAndFrames();
  room.photographs.resize(static_cast<size_t>(options.num_images));
  ParallelTasks(num_threads, room.photographs.size(), [&](size_t i) {
    const Image& image = room.truth.images.at(static_cast<image_t>(i + 1));
    room.photographs[i] =
        Photograph(options, surfaces, room.truth.cameras.at(1), image, options.seed + 1 + i);
  });
  return room;
}

}  // namespace holba
