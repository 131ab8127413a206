// SPDX-License-Identifier: BSD-3-Clause
// A street of facades, seen from the pavement across.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "holba/render/furniture.h"
#include "holba/render/presets.h"
#include "holba/render/texture_recipes.h"

namespace holba {

using Eigen::Vector3d;
using Hole = PlaceBuilder::Hole;

namespace {

// What the windows of one house have in common.
struct House {
  double from, to, height, floor;  // along the street, to the eaves, of one storey
  int num_windows;
  double window_width, window_height;
  int wall, stone;
  bool has_shutters, has_pediments, has_balconies;
};

// The windows of the street side, per storey; on the ground a door, or a shop.
std::vector<Hole> WindowsOf(const House& house, Random* random, int* door) {
  std::vector<Hole> holes;
  const int num_storeys = static_cast<int>(house.height / house.floor);
  const double pitch = (house.to - house.from) / house.num_windows;
  *door = static_cast<int>(random->Index(static_cast<uint64_t>(house.num_windows)));
  for (int storey = 0; storey < num_storeys; ++storey) {
    for (int i = 0; i < house.num_windows; ++i) {
      const double middle = (i + 0.5) * pitch, bottom = storey * house.floor + 0.95;
      if (storey == 0 && i == *door) {
        holes.push_back({middle - 0.62, 0.0, middle + 0.62, 2.6});
      } else {
        const double shrink = storey == num_storeys - 1 ? 0.85 : 1.0;
        holes.push_back({middle - 0.5 * house.window_width, bottom,
                         middle + 0.5 * house.window_width, bottom + shrink * house.window_height});
      }
    }
  }
  return holes;
}

void AddHouse(const Palette& palette, const House& house, PlaceBuilder* builder) {
  Random* random = builder->random();
  // The street is at y < 0: the facade faces -y, and is seen from there.
  const double width = house.to - house.from;
  const WallFrame wall{
      {house.from, 0, 0}, Vector3d::UnitX(), Vector3d::UnitZ(), -Vector3d::UnitY(), width,
      house.height};
  int door = 0;
  const std::vector<Hole> holes = WindowsOf(house, random, &door);
  builder->AddWall(wall.origin, {width, 0, 0}, {0, 0, house.height}, house.wall, holes);
  builder->AddEdge(wall.At(0, 0, 0), wall.At(0, house.height, 0));
  builder->AddEdge(wall.At(width, 0, 0), wall.At(width, house.height, 0));
  // Sides, where a neighbour is lower, and the roof.
  constexpr double kDeep = 8.0;
  builder->AddRectangle({house.from, kDeep, 0}, {0, -kDeep, 0}, {0, 0, house.height}, house.wall);
  builder->AddRectangle({house.to, 0, 0}, {0, kDeep, 0}, {0, 0, house.height}, house.wall);
  const int tiles = TexturedMaterial(
      palette, BrickTexture(ColourOf(128, 62, 46), ColourOf(64, 34, 28), 0.3, 0.22, random->Bits()),
      builder);
  // Walls between the roofs, as they keep fires from spreading.
  for (const double side : {house.from, house.to - 0.2}) {
    builder->AddBox(Standing(side, 0.0, house.height), {0, -0.29, 0}, {0.2, 4.6, 1.75}, house.stone);
  }
  const Vector3d slope(0, 4.3, random->Uniform(0.9, 1.5));
  builder->AddRectangle({house.from, -0.3, house.height + 0.041}, {width, 0, 0}, slope, tiles);

  const double shade = random->Uniform(0.02, 0.05);
  const int glass =
      builder->AddMaterial(0, Colour::Constant(static_cast<float>(shade)), 0.12f, 0.008f);
  Palette panes = palette;
  panes.glass = glass;
  const int shutter = builder->AddPaint(
      random->Uniform() < 0.5 ? ColourOf(62, 92, 74) : ColourOf(92, 62, 48), 0.02f);
  for (size_t i = 0; i < holes.size(); ++i) {
    const Hole& hole = holes[i];
    const double w = hole.u1 - hole.u0, h = hole.v1 - hole.v0;
    if (hole.v0 == 0.0) {  // the door, two steps, a light above
      AddWindow(panes, wall, hole, 0.35, 0, Colour::Zero(), builder);
      const Pose leaf = wall.Against(hole.u0 + 0.055, 0.0, -0.33);
      builder->AddBox(leaf, {0, -0.06, 0}, {w - 0.11, 0, 2.1}, shutter);
      for (const double x : {0.1, 0.5 * w})
        builder->AddBox(leaf, {x, -0.08, 0.25}, {x + 0.4, -0.06, 1.0}, shutter);
      for (const double x : {0.1, 0.5 * w})
        builder->AddBox(leaf, {x, -0.08, 1.15}, {x + 0.4, -0.06, 1.95}, shutter);
      builder->AddBox(wall.Against(hole.u0 - 0.2, 0.0, 0.0), {0, -0.35, 0.0}, {w + 0.4, 0, 0.14},
                      house.stone);
      builder->AddBox(wall.Against(hole.u0 - 0.2, 0.0, 0.0), {0, -0.7, -0.0},
                      {w + 0.4, -0.35, 0.07}, house.stone);
      builder->AddBox(wall.Against(hole.u0 - 0.18, 0.0, 0.0), {0, -0.05, 0.14}, {0.18, 0, h + 0.2},
                      house.stone);
      builder->AddBox(wall.Against(hole.u1, 0.0, 0.0), {0, -0.05, 0.14}, {0.18, 0, h + 0.2},
                      house.stone);
      builder->AddBox(wall.Against(hole.u0 - 0.18, h, 0.0), {0.18, -0.05, 0}, {w + 0.18, 0, 0.2},
                      house.stone);
      continue;
    }
    AddWindow(panes, wall, hole, 0.18, w > 1.3 ? 2 : 1, Colour::Zero(), builder);
    builder->AddBox(wall.Against(hole.u0 - 0.1, hole.v0 - 0.09, 0.0), {0, -0.11, 0},
                    {w + 0.2, 0, 0.09}, house.stone);
    builder->AddBox(wall.Against(hole.u0 - 0.13, hole.v0, 0.0), {0, -0.035, 0}, {0.13, 0, h + 0.13},
                    house.stone);
    builder->AddBox(wall.Against(hole.u1, hole.v0, 0.0), {0, -0.035, 0}, {0.13, 0, h + 0.13},
                    house.stone);
    builder->AddBox(wall.Against(hole.u0, hole.v1, 0.0), {0, -0.035, 0}, {w, 0, 0.13}, house.stone);
    if (house.has_pediments && hole.v0 > house.floor) {
      builder->AddBox(wall.Against(hole.u0 - 0.2, hole.v1 + 0.16, 0.0), {0, -0.16, 0},
                      {w + 0.4, 0, 0.1}, house.stone);
    }
    if (house.has_shutters) {
      for (const double u : {hole.u0 - 0.14 - 0.5 * w, hole.u1 + 0.14}) {
        builder->AddBox(wall.Against(u, hole.v0, 0.0), {0, -0.04, 0}, {0.5 * w, -0.005, h},
                        shutter);
        for (double z = 0.06; z < h - 0.08; z += 0.11) {
          builder->AddBox(wall.Against(u, hole.v0, 0.0), {0.05, -0.055, z},
                          {0.5 * w - 0.05, -0.04, z + 0.06}, shutter);
        }
      }
    }
    if (house.has_balconies && hole.v0 > house.floor && hole.v0 < 2 * house.floor) {
      const Pose pose = wall.Against(hole.u0 - 0.25, hole.v0 - 0.3, 0.0);
      builder->AddBox(pose, {0, -0.75, 0}, {w + 0.5, 0, 0.14}, house.stone);
      for (double x = 0.02; x < w + 0.45; x += 0.13)
        builder->AddBox(pose, {x, -0.73, 0.14}, {x + 0.02, -0.71, 0.95}, palette.dark);
      builder->AddBox(pose, {0, -0.75, 0.95}, {w + 0.5, -0.69, 0.99}, palette.dark);
    }
  }
  // Plinth between door and ends, bands between storeys, the cornice.
  const double pitch = width / house.num_windows, middle = (door + 0.5) * pitch;
  if (middle - 0.85 > 0.1)
    builder->AddBox(wall.Against(0, 0, 0), {0, -0.06, 0}, {middle - 0.85, 0, 0.6}, house.stone);
  if (width - middle - 0.85 > 0.1)
    builder->AddBox(wall.Against(middle + 0.85, 0, 0), {0, -0.06, 0},
                    {width - middle - 0.85, 0, 0.6}, house.stone);
  builder->AddBox(wall.Against(0, house.floor + 0.18, 0), {0, -0.09, 0}, {width, 0, 0.2},
                  house.stone);
  builder->AddBox(wall.Against(0, house.height - 0.42, 0), {0, -0.14, 0}, {width, 0, 0.2},
                  house.stone);
  builder->AddBox(wall.Against(0, house.height - 0.22, 0), {0, -0.3, 0}, {width, 0, 0.26},
                  house.stone);
  builder->AddCylinder(Standing(house.to - 0.2, -0.12), 0.055, house.height - 0.5, palette.metal,
                       true);
}

}  // namespace

Place BuildFacade(uint64_t seed) {
  PlaceBuilder builder(seed);
  Random* random = builder.random();
  const Palette palette = MakePalette(1.0, &builder);
  const int asphalt =
      TexturedMaterial(palette, StoneTexture(ColourOf(92, 91, 90), 1.2, random->Bits()), &builder);
  const int paving = TexturedMaterial(
      palette,
      TileTexture(ColourOf(150, 146, 138), ColourOf(136, 131, 124), 0.4, false, random->Bits()),
      &builder);
  double x = 0.0;
  const int num_houses = 2 + static_cast<int>(random->Index(2));
  for (int i = 0; i < num_houses; ++i) {
    House house;
    house.from = x;
    house.num_windows = 3 + static_cast<int>(random->Index(3));
    house.to = x + house.num_windows * random->Uniform(2.3, 2.9);
    house.floor = random->Uniform(3.2, 3.7);
    house.height =
        house.floor * (2 + static_cast<int>(random->Index(2))) + random->Uniform(0.4, 0.9);
    house.window_width = random->Uniform(1.0, 1.4);
    house.window_height = random->Uniform(1.5, 1.85);
    const Colour walls[] = {ColourOf(206, 178, 138), ColourOf(196, 186, 170),
                            ColourOf(176, 120, 96), ColourOf(182, 190, 184)};
    const uint64_t kind = random->Index(3);
    const Colour wall = walls[random->Index(4)];
    house.wall =
        kind == 0 ? TexturedMaterial(palette,
                                     BrickTexture(ColourOf(156, 88, 66), ColourOf(186, 176, 160),
                                                  0.24, 0.077, random->Bits()),
                                     &builder)
        : kind == 1
            ? TexturedMaterial(
                  palette, BrickTexture(wall, 0.75f * wall, 0.62, 0.31, random->Bits()), &builder)
            : TexturedMaterial(palette, StoneTexture(wall, 0.7, random->Bits()), &builder);
    house.stone = TexturedMaterial(
        palette, StoneTexture(ColourOf(204, 196, 180), 0.6, random->Bits()), &builder);
    house.has_shutters = random->Uniform() < 0.35;
    house.has_pediments = !house.has_shutters && random->Uniform() < 0.6;
    house.has_balconies = random->Uniform() < 0.4;
    AddHouse(palette, house, &builder);
    x = house.to;
  }
  const double length = x;
  // Pavement with kerb, road, the other pavement.
  builder.AddBox(Standing(-12.0, 0.0, -0.14), {0, -2.6, 0}, {length + 24.0, 0, 0.14}, paving);
  builder.AddBox(Standing(-12.0, 0.0, -0.14), {0, -2.75, 0}, {length + 24.0, -2.6, 0.145},
                 palette.white);
  builder.AddRectangle({-40.0, -30.0, -0.14}, {length + 80.0, 0, 0}, {0, 38.0, 0}, asphalt);
  for (double at = 2.0; at < length; at += 7.0) {
    builder.AddCylinder(Standing(at, -2.3), 0.045, 4.2, palette.dark, true);
    builder.AddSphere({at, -2.3, 4.33}, 0.16, palette.white, false);
    if (at + 3.0 < length) {  // a bench, or a bin
      builder.AddBox(Standing(at + 2.5, -1.9), {0, -0.4, 0.42}, {1.6, 0, 0.47}, palette.wood);
      builder.AddBox(Standing(at + 2.5, -1.9), {0.1, -0.35, 0}, {0.18, -0.05, 0.42}, palette.dark);
      builder.AddBox(Standing(at + 2.5, -1.9), {1.42, -0.35, 0}, {1.5, -0.05, 0.42}, palette.dark);
      builder.AddCylinder(Standing(at + 4.9, -2.2), 0.22, 0.85, palette.metal, false);
    }
  }
  Place place = builder.Take();
  const double azimuth = random->Uniform(-2.3, -0.9), altitude = random->Uniform(0.6, 0.95);
  place.sun.direction = Vector3d(std::cos(altitude) * std::cos(azimuth),
                                 std::cos(altitude) * std::sin(azimuth), std::sin(altitude));
  // Sunshine or an overcast day.
  const bool is_sunny = random->Uniform() < 0.6;
  place.sun.irradiance = (is_sunny ? 2.6f : 0.0f) * Colour(1.06f, 1.0f, 0.9f);
  place.sky.zenith = is_sunny ? Colour(0.5f, 0.75f, 1.25f) : Colour(1.0f, 1.05f, 1.12f);
  place.sky.horizon = is_sunny ? Colour(1.1f, 1.25f, 1.45f) : Colour(1.15f, 1.18f, 1.22f);
  constexpr int kKnots = 8;
  const double far = random->Uniform(8.5, 11.0);
  for (int i = 0; i < kKnots; ++i) {
    const double s = static_cast<double>(i) / (kKnots - 1);
    const double along = -1.0 + (length + 2.0) * s;
    place.walk.places.emplace_back(along, -far + random->Uniform(-1.2, 1.2),
                                   1.6 + random->Uniform(-0.15, 0.15));
    place.walk.targets.emplace_back(
        0.5 * length + 0.62 * (along - 0.5 * length) + random->Uniform(-0.8, 0.8), 0.0,
        3.6 + random->Uniform(-0.5, 0.5));
  }
  place.num_images = 30;
  place.field_of_view_deg = 66;
  place.texel_m = 0.16;
  return place;
}

}  // namespace holba
