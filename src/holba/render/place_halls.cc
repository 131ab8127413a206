// SPDX-License-Identifier: BSD-3-Clause
// Public buildings: a hall with stairs and columns, a corridor with doors.
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

Place BuildHall(uint64_t seed) {
  PlaceBuilder builder(seed);
  Random* random = builder.random();
  const Palette palette = MakePalette(1.0, &builder);
  const double width = 11.0, depth = 16.0, height = 5.6;
  const int stone = builder.AddMaterial(
      builder.AddTexture(
          TileTexture(ColourOf(196, 190, 178), ColourOf(150, 142, 130), 0.6, true, random->Bits())),
      Colour::Ones(), 0.05f, 0.04f);
  const int concrete = builder.AddMaterial(
      builder.AddTexture(StoneTexture(ColourOf(170, 166, 158), 0.8, random->Bits())));
  const int brick = builder.AddMaterial(builder.AddTexture(
      BrickTexture(ColourOf(172, 110, 84), ColourOf(196, 190, 180), 0.24, 0.08, random->Bits())));
  builder.AddRectangle({0, 0, 0}, {width, 0, 0}, {0, depth, 0}, stone);
  builder.AddRectangle({0, depth, height}, {width, 0, 0}, {0, -depth, 0}, palette.ceiling);
  const std::array<WallFrame, 4> walls = InsideWalls(width, depth, height);
  for (size_t i = 0; i < 4; ++i) {
    const WallFrame& wall = walls[i];
    std::vector<Hole> holes;
    if (i == 3) {
      for (int k = 0; k < 5; ++k) holes.push_back({1.1 + 3.0 * k, 1.0, 2.9 + 3.0 * k, 4.6});
    }
    builder.AddWall(wall.origin, wall.width * wall.along, height * wall.up,
                    i == 1 ? brick : palette.wall, holes);
    for (const Hole& hole : holes)
      AddWindow(palette, wall, hole, 0.35, 2, 5.0f * Colour(0.93f, 1.0f, 1.1f), &builder);
    AddSkirting(palette, wall, 0.015, wall.width - 0.015, &builder);
  }
  // Stairs along the far wall up to a gallery.
  const double rise = 0.17, tread = 0.29;
  constexpr int kSteps = 16;
  const double gallery = kSteps * rise;
  for (int i = 0; i < kSteps; ++i) {
    builder.AddBox(Standing(1.2 + i * tread, depth), {0, -2.2, 0}, {tread, -0.0, (i + 1) * rise},
                   concrete);
    if (i % 2 == 0) {
      builder.AddCylinder(Standing(1.2 + (i + 0.5) * tread, depth - 2.14, (i + 1) * rise), 0.016,
                          0.95, palette.metal, false);
    }
  }
  const double start = 1.2 + kSteps * tread;
  builder.AddBox(Standing(start, depth), {0, -2.2, gallery - 0.3}, {width - start, 0, gallery},
                 concrete);
  {
    // The handrail rises with the stairs.
    Pose rail = Pose::Identity();
    const Vector3d way = Vector3d(tread, 0, rise).normalized();
    rail.linear().col(2) = way;
    rail.linear().col(1) = Vector3d::UnitY();
    rail.linear().col(0) = Vector3d::UnitY().cross(way);
    rail.translation() = Vector3d(1.2 + 0.5 * tread, depth - 2.14, rise + 0.95);
    builder.AddCylinder(rail, 0.025, std::hypot(tread, rise) * (kSteps - 1), palette.wood, false);
  }
  for (double x = start + 0.1; x < width; x += 0.32) {
    builder.AddBox(Standing(x, depth - 2.15, gallery), {0, -0.03, 0}, {0.03, 0, 0.92},
                   palette.metal);
  }
  builder.AddBox(Standing(start + 0.1, depth - 2.14, gallery + 0.92), {0, -0.05, 0},
                 {width - start - 0.1, 0, 0.04}, palette.wood);
  // Two rows of columns on plinths.
  for (int i = 0; i < 4; ++i) {
    for (const double x : {3.2, 7.8}) {
      const double y = 1.8 + 3.2 * i;
      builder.AddBox(Standing(x, y), {-0.34, -0.34, 0}, {0.34, 0.34, 0.3}, concrete);
      builder.AddCylinder(Standing(x, y, 0.3), 0.25, height - 0.75, concrete, true);
      builder.AddBox(Standing(x, y, height - 0.45), {-0.36, -0.36, 0}, {0.36, 0.36, 0.45},
                     concrete);
    }
    // Beams across.
    builder.AddBox(Standing(0, 1.8 + 3.2 * i, height - 0.3), {0.0, -0.18, 0}, {2.84, 0.18, 0.3},
                   palette.ceiling);
    builder.AddBox(Standing(0, 1.8 + 3.2 * i, height - 0.3), {3.56, -0.18, 0}, {7.44, 0.18, 0.3},
                   palette.ceiling);
    builder.AddBox(Standing(0, 1.8 + 3.2 * i, height - 0.3), {8.16, -0.18, 0}, {width, 0.18, 0.3},
                   palette.ceiling);
  }
  for (int i = 0; i < 4; ++i) {
    AddCeilingPanel(palette, 5.5, 3.4 + 3.2 * i, height - 0.02, 2.0, 0.5,
                    7.0f * Colour(1.06f, 1.0f, 0.9f), &builder);
  }
  // Doors, posters, benches, plants, a counter.
  AddDoor(palette, walls[0], 1.0, 1.0, 2.2, palette.dark_wood, &builder);
  AddDoor(palette, walls[0], 2.2, 1.0, 2.2, palette.dark_wood, &builder);
  AddDoor(palette, walls[1], 6.0, 0.95, 2.1, palette.wood, &builder);
  AddDoor(palette, walls[1], 10.5, 0.95, 2.1, palette.wood, &builder);
  for (int i = 0; i < 5; ++i) {
    const double u = i < 2 ? 2.9 + 1.5 * i : 2.4 + 2.2 * (i + 1);
    if (std::abs(u - 10.5) < 1.3 || std::abs(u - 6.0) < 1.2) continue;
    AddPicture(palette, walls[1], u, 1.2, 0.9, 1.25, random->Uniform() < 0.6, &builder);
  }
  for (int i = 0; i < 4; ++i)
    AddPicture(palette, walls[0], 4.4 + 1.5 * i, 1.3, 1.0, 1.3, i % 2 == 0, &builder);
  for (int i = 0; i < 3; ++i) {
    const double y = 3.4 + 3.2 * i;
    builder.AddBox(Standing(9.9, y), {-0.2, -0.75, 0.4}, {0.25, 0.75, 0.46}, palette.wood);
    builder.AddBox(Standing(9.9, y), {-0.16, -0.65, 0}, {0.2, -0.55, 0.4}, concrete);
    builder.AddBox(Standing(9.9, y), {-0.16, 0.55, 0}, {0.2, 0.65, 0.4}, concrete);
    AddPlant(palette, Standing(0.6, y + 0.9), 1.5, &builder);
  }
  AddCabinet(palette, Standing(4.4, 8.2), 2.2, 0.7, 1.05, 4, palette.dark_wood, &builder);
  AddClutter(palette, Standing(4.5, 8.15, 1.05), 2.0, 0.55, 6, &builder);

  Place place = builder.Take();
  Walk walk;
  walk.closed = true;
  // Between the columns, round the counter.
  for (const auto& [x, y, tx, ty] :
       {std::array{5.5, 1.2, 5.5, 12.0}, std::array{5.6, 3.2, 4.0, 14.0},
        std::array{6.6, 5.2, 2.0, 14.5}, std::array{7.0, 7.6, 1.5, 13.5},
        std::array{6.6, 9.9, 0.5, 10.0}, std::array{4.6, 10.2, 4.0, 3.0},
        std::array{3.0, 9.8, 9.0, 3.0}, std::array{1.7, 8.4, 10.5, 4.0},
        std::array{1.6, 5.8, 11.0, 5.5}, std::array{1.9, 3.9, 10.5, 8.0},
        std::array{3.6, 3.2, 9.0, 11.0}, std::array{4.9, 1.9, 7.0, 12.0}}) {
    walk.places.emplace_back(x, y, 1.6 + random->Uniform(-0.1, 0.1));
    walk.targets.emplace_back(tx, ty, 1.9 + random->Uniform(-0.3, 0.3));
  }
  place.walk = walk;
  place.num_images = 48;
  place.field_of_view_deg = 70;
  place.texel_m = 0.15;
  return place;
}

Place BuildCorridor(uint64_t seed) {
  PlaceBuilder builder(seed);
  Random* random = builder.random();
  const Palette palette = MakePalette(1.0, &builder);
  const double width = 2.3, depth = 22.0, height = 2.75;
  const int lino = builder.AddMaterial(
      builder.AddTexture(
          StoneTexture(random->Uniform() < 0.5 ? ColourOf(126, 118, 104) : ColourOf(96, 112, 116),
                       0.9, random->Bits())),
      Colour::Ones(), 0.05f, 0.05f);
  builder.AddRectangle({0, 0, 0}, {width, 0, 0}, {0, depth, 0}, lino);
  builder.AddRectangle({0, depth, height}, {width, 0, 0}, {0, -depth, 0}, palette.ceiling);
  const std::array<WallFrame, 4> walls = InsideWalls(width, depth, height);
  for (size_t i = 0; i < 4; ++i) {
    const WallFrame& wall = walls[i];
    std::vector<Hole> holes;
    if (i == 2) holes.push_back({0.45, 0.95, 1.85, 2.35});
    builder.AddWall(wall.origin, wall.width * wall.along, height * wall.up, palette.wall, holes);
    for (const Hole& hole : holes)
      AddWindow(palette, wall, hole, 0.25, 1, 7.0f * Colour(0.93f, 1.0f, 1.1f), &builder);
  }
  for (const size_t side : {size_t{1}, size_t{3}}) {
    const WallFrame& wall = walls[side];
    double last = 0.015, u = side == 1 ? 1.2 : 2.3;
    const int door = random->Uniform() < 0.5 ? palette.wood : palette.white;
    while (u + 1.2 < depth) {
      AddSkirting(palette, wall, last, u - 0.08, &builder);
      AddDoor(palette, wall, u, 0.92, 2.06, door, &builder);
      AddPicture(palette, wall, u + 1.08, 1.5, 0.16, 0.12, true, &builder);  // whose room it is
      last = u + 1.0;
      const double next = u + random->Uniform(2.9, 3.8);
      const double room = next - 0.3 - (u + 1.4);
      switch (random->Index(4)) {
        case 0:
          AddPicture(palette, wall, u + 1.4, 1.1, std::min(room, 1.5), 0.95, true, &builder);
          break;
        case 1:
          AddPicture(palette, wall, u + 1.45, 1.3, 0.6, 0.8, false, &builder);
          if (room > 1.4) AddPicture(palette, wall, u + 2.2, 1.3, 0.6, 0.8, true, &builder);
          break;
        case 2:
          AddCabinet(palette, wall.Against(u + 1.4, 0.0, 0.02), std::min(room, 1.2), 0.32, 0.95, 2,
                     palette.wood, &builder);
          AddClutter(palette, wall.Against(u + 1.45, 0.95, 0.03), std::min(room, 1.2) - 0.1, 0.26,
                     3, &builder);
          AddPicture(palette, wall, u + 1.5, 1.4, 0.8, 0.6, random->Uniform() < 0.5, &builder);
          break;
        default:
          AddRadiator(palette, wall.Against(u + 1.4), std::min(room, 1.2), &builder);
          AddPicture(palette, wall, u + 1.5, 1.3, 0.7, 0.9, true, &builder);
      }
      u = next;
    }
    AddSkirting(palette, wall, last, wall.width - 0.015, &builder);
    // A handrail's board, and a pipe under the ceiling.
    if (side == 3) {
      Pose pipe = Pose::Identity();
      pipe.linear().col(2) = Vector3d::UnitY();
      pipe.linear().col(0) = Vector3d::UnitX();
      pipe.linear().col(1) = -Vector3d::UnitZ();
      pipe.linear().col(1) = pipe.linear().col(2).cross(pipe.linear().col(0));
      pipe.translation() = Vector3d(0.14, 0.02, height - 0.16);
      builder.AddCylinder(pipe, 0.05, depth - 0.04, palette.metal, true);
    }
  }
  AddDoor(palette, walls[0], 0.7, 0.95, 2.06, palette.dark_wood, &builder);
  for (double y = 1.8; y < depth; y += 2.9) {
    AddCeilingPanel(palette, 0.5 * width, y, height, 0.3, 1.2, 7.0f * Colour(1.0f, 1.0f, 0.94f),
                    &builder);
    builder.AddBox(Standing(0, y + 1.45, height - 0.12), {0, -0.06, 0}, {width, 0.06, 0.12},
                   palette.ceiling);
  }
  Place place = builder.Take();
  for (int i = 0; i < 12; ++i) {
    const double y = 0.8 + 1.45 * i;
    const double side = (i % 2 == 0 ? 0.18 : -0.18);
    place.walk.places.emplace_back(0.5 * width + side, y, 1.55 + random->Uniform(-0.1, 0.1));
    place.walk.targets.emplace_back(0.5 * width - 4.0 * side, y + 4.0,
                                    1.35 + random->Uniform(-0.1, 0.1));
  }
  place.num_images = 40;
  place.field_of_view_deg = 68;
  place.texel_m = 0.08;
  return place;
}

}  // namespace holba
