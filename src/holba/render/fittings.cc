// SPDX-License-Identifier: BSD-3-Clause
// What belongs to the building: windows, doors, skirting, radiators, lamps, and what hangs on
// walls.
#include <algorithm>
#include <cmath>

#include "holba/render/furniture.h"
#include "holba/render/texture_recipes.h"

namespace holba {

using Eigen::Vector3d;

Pose WallFrame::Against(double u, double v, double gap) const {
  Pose pose = Pose::Identity();
  pose.linear().col(0) = along;
  pose.linear().col(1) = -inwards;
  pose.linear().col(2) = up;
  pose.translation() = At(u, v, gap);
  return pose;
}

std::array<WallFrame, 4> InsideWalls(double width, double depth, double height) {
  const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY(), z = Vector3d::UnitZ();
  return {WallFrame{{width, 0, 0}, -x, z, y, width, height},
          WallFrame{{width, depth, 0}, -y, z, -x, depth, height},
          WallFrame{{0, depth, 0}, x, z, -y, width, height},
          WallFrame{{0, 0, 0}, y, z, x, depth, height}};
}

void AddWindow(const Palette& palette, const WallFrame& wall, const PlaceBuilder::Hole& hole,
               double reveal, int bars, const Colour& light, PlaceBuilder* builder) {
  const double width = hole.u1 - hole.u0, height = hole.v1 - hole.v0;
  const Vector3d along = width * wall.along, up = height * wall.up, in = reveal * wall.inwards;
  builder->AddRectangle(wall.At(hole.u0, hole.v0, 0), along, -in, palette.trim);
  builder->AddRectangle(wall.At(hole.u0, hole.v1, -reveal), along, in, palette.trim);
  builder->AddRectangle(wall.At(hole.u0, hole.v0, -reveal), up, in, palette.trim);
  builder->AddRectangle(wall.At(hole.u1, hole.v0, -reveal), in, up, palette.trim);
  // Sky above, what stands outside below.
  const double split = 0.45 * height;
  if (!light.isZero()) {
    builder->AddRectangle(wall.At(hole.u0, hole.v0 + split, -reveal), along, up - split * wall.up,
                          builder->AddLight(light), PlaceBuilder::kNoEntity);
    builder->AddRectangle(wall.At(hole.u0, hole.v0, -reveal), along, split * wall.up,
                          builder->AddLight(light.cwiseProduct(Colour(0.42f, 0.44f, 0.36f))),
                          PlaceBuilder::kNoEntity);
  } else {
    builder->AddRectangle(wall.At(hole.u0, hole.v0, -reveal), along, up, palette.glass);
  }
  for (const double u : {hole.u0, hole.u1}) {
    for (const double v : {hole.v0, hole.v1})
      builder->AddEdge(wall.At(u, v, 0), wall.At(u, v, -reveal));
  }
  // The frame lies against the reveal and stands 6 cm before the pane.
  const Pose pose = wall.Against(hole.u0, hole.v0, -reveal);
  constexpr double kFrame = 0.055, kThick = 0.06;
  const auto bar = [&](double x0, double z0, double x1, double z1, double thick) {
    builder->AddBox(pose, {x0, -thick, z0}, {x1, 0, z1}, palette.trim);
  };
  bar(0, 0, kFrame, height, kThick);
  bar(width - kFrame, 0, width, height, kThick);
  bar(kFrame, 0, width - kFrame, kFrame, kThick);
  bar(kFrame, height - kFrame, width - kFrame, height, kThick);
  for (int i = 1; i <= bars; ++i) {
    const double x = width * i / (bars + 1);
    bar(x - 0.03, kFrame, x + 0.03, height - kFrame, kThick - 0.012);
  }
  if (height > 1.2)
    bar(kFrame, 0.68 * height, width - kFrame, 0.68 * height + 0.05, kThick - 0.018);
}

void AddDoor(const Palette& palette, const WallFrame& wall, double u, double width, double height,
             int material, PlaceBuilder* builder) {
  const Pose pose = wall.Against(u, 0.0, 0.0);
  builder->AddBox(pose, {0, -0.025, 0}, {width, 0, height}, material, {.turn_texture = true});
  builder->AddBox(pose, {-0.08, -0.045, 0}, {0, 0, height + 0.08}, palette.trim);
  builder->AddBox(pose, {width, -0.045, 0}, {width + 0.08, 0, height + 0.08}, palette.trim);
  builder->AddBox(pose, {0, -0.045, height}, {width, 0, height + 0.08}, palette.trim);
  const double rim = 0.13;
  for (const auto& [z0, z1] :
       {std::pair{0.2, 0.42 * height}, std::pair{0.42 * height + rim, height - rim}}) {
    builder->AddBox(pose, {rim, -0.037, z0}, {width - rim, -0.025, z1}, material,
                    {.turn_texture = true});
  }
  builder->AddBox(pose, {width - 0.075, -0.032, 0.98}, {width - 0.04, -0.025, 1.16}, palette.metal);
  builder->AddSphere(pose * Vector3d(width - 0.058, -0.06, 1.05), 0.025, palette.metal, false);
}

void AddSkirting(const Palette& palette, const WallFrame& wall, double from, double to,
                 PlaceBuilder* builder) {
  if (to - from < 0.02) return;
  builder->AddBox(wall.Against(from, 0.0, 0.0), {0, -0.014, 0}, {to - from, 0, 0.085},
                  palette.trim);
}

void AddPicture(const Palette& palette, const WallFrame& wall, double u, double v, double width,
                double height, bool is_poster, PlaceBuilder* builder) {
  const uint64_t seed = builder->random()->Bits();
  const int face = TexturedMaterial(
      palette, is_poster ? PosterTexture(width, height, seed) : PictureTexture(width, height, seed),
      builder, 0.02f);
  builder->AddBox(wall.Against(u, v, 0.0), {0, is_poster ? -0.008 : -0.025, 0}, {width, 0, height},
                  palette.dark_wood, {.front = face, .fit_front = true});
}

void AddRadiator(const Palette& palette, const Pose& pose, double width, PlaceBuilder* builder) {
  const int num = static_cast<int>(width / 0.07);
  for (int i = 0; i < num; ++i) {
    builder->AddBox(pose, {i * 0.07 + 0.008, -0.13, 0.13}, {i * 0.07 + 0.062, -0.04, 0.68},
                    palette.white);
  }
  builder->AddBox(pose, {0.0, -0.1, 0.17}, {num * 0.07, -0.07, 0.2}, palette.white);
  builder->AddBox(pose, {0.0, -0.1, 0.61}, {num * 0.07, -0.07, 0.64}, palette.white);
}

void AddCurtain(const Palette& palette, const WallFrame& wall, double from, double to, double top,
                int material, PlaceBuilder* builder) {
  // Folds: cylinders that overlap, near and far in turns.
  Random* random = builder->random();
  bool is_near = false;
  for (double u = from; u < to; u += random->Uniform(0.045, 0.065)) {
    const double radius = random->Uniform(0.03, 0.04);
    builder->AddCylinder(wall.Against(u, 0.03, is_near ? 0.1 : 0.07), radius, top - 0.05, material,
                         false);
    is_near = !is_near;
  }
  // Its rail.
  builder->AddBox(wall.Against(from - 0.1, top, 0.0), {0, -0.16, -0.03},
                  {to - from + 0.2, -0.02, 0.0}, palette.trim);
}

void AddCeilingPanel(const Palette& palette, double x, double y, double z, double width,
                     double depth, const Colour& light, PlaceBuilder* builder) {
  const Pose pose = Standing(x - 0.5 * width, y + 0.5 * depth, z);
  builder->AddBox(pose, {-0.03, -depth - 0.03, -0.06}, {width + 0.03, 0.03, 0.0}, palette.white);
  // Faces down, a millimetre below its case.
  builder->AddRectangle(pose * Vector3d(0, 0, -0.061), {width, 0, 0}, {0, -depth, 0},
                        builder->AddLight(light), PlaceBuilder::kNoEntity);
}

}  // namespace holba
