// SPDX-License-Identifier: BSD-3-Clause
// Furnished rooms, and the table of objects.
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

// A loop about the middle that looks across it, now higher, now lower.
Walk Loop(double cx, double cy, double rx, double ry, double height, double target_z, double beyond,
          Random* random) {
  Walk walk;
  walk.closed = true;
  constexpr int kKnots = 10;
  const double start = random->Uniform(0, 2 * std::numbers::pi);
  for (int i = 0; i < kKnots; ++i) {
    const double angle = start + 2 * std::numbers::pi * i / kKnots;
    const double x = rx * std::cos(angle), y = ry * std::sin(angle);
    walk.places.emplace_back(cx + x, cy + y, height + random->Uniform(-0.15, 0.15));
    walk.targets.emplace_back(cx - beyond * x + random->Uniform(-0.2, 0.2),
                              cy - beyond * y + random->Uniform(-0.2, 0.2),
                              target_z + random->Uniform(-0.15, 0.15));
  }
  return walk;
}

// Places along a wall that pieces have not taken yet, from left to right.
class Row {
 public:
  Row(double from, double to) : at_(from), end_(to) {}
  bool Fits(double width) const { return at_ + width <= end_; }
  double Take(double width, double gap) {
    const double from = at_;
    at_ += width + gap;
    return from;
  }
  double left() const { return end_ - at_; }

 private:
  double at_, end_;
};

// Low pieces under windows, tall ones elsewhere, pictures above the low ones.
void FurnishWall(const Palette& palette, const WallFrame& wall, Row row, bool has_window,
                 int first_kind, PlaceBuilder* builder) {
  Random* random = builder->random();
  int kind = first_kind;
  while (row.left() > 0.75) {
    const double gap = random->Uniform(0.12, 0.4);
    double width = 0.0, top = 0.0, u = 0.0;
    switch (kind++ % 5) {
      case 0:
        if (has_window) continue;
        width = std::min(row.left(), random->Uniform(0.8, 1.5));
        u = row.Take(width, gap);
        top = random->Uniform(1.7, 2.15);
        AddBookshelf(palette, wall.Against(u), width, random->Uniform(0.26, 0.34), top, builder);
        break;
      case 1:
        width = std::min(row.left(), random->Uniform(1.7, 2.3));
        if (width < 1.5) continue;
        u = row.Take(width, gap);
        top = 0.85;
        AddSofa(palette, wall.Against(u, 0.0, 0.05), width, builder);
        break;
      case 2: {
        width = std::min(row.left(), random->Uniform(0.9, 1.7));
        u = row.Take(width, gap);
        top = random->Uniform(0.75, 0.95);
        const int wood = random->Uniform() < 0.4   ? palette.white
                         : random->Uniform() < 0.5 ? palette.wood
                                                   : palette.dark_wood;
        AddCabinet(palette, wall.Against(u, 0.0, 0.02), width, 0.42, top,
                   std::max(2, static_cast<int>(width / 0.45)), wood, builder);
        Pose at = wall.Against(u + 0.05, top, 0.04);
        AddClutter(palette, at, width - 0.1, 0.34, std::max(2, static_cast<int>(width / 0.3)),
                   builder);
        break;
      }
      case 3:
        width = std::min(row.left(), random->Uniform(1.3, 1.7));
        if (width < 1.2) continue;
        u = row.Take(width, gap);
        top = 1.25;
        AddDesk(palette, wall.Against(u, 0.0, 0.02), width, builder);
        {
          Pose chair = wall.Against(u + 0.4 * width, 0.0, 0.65);
          chair.linear() =
              chair.linear() *
              Eigen::AngleAxisd(std::numbers::pi + random->Uniform(-0.5, 0.5), Vector3d::UnitZ())
                  .toRotationMatrix();
          chair.translation() += 0.4 * wall.along;
          AddChair(palette, chair, palette.dark_wood, builder);
        }
        break;
      default: {
        width = 0.55;
        u = row.Take(width, gap);
        top = 1.7;
        Pose at = wall.Against(u + 0.28, 0.0, 0.32);
        if (random->Uniform() < 0.6) {
          AddPlant(palette, at, random->Uniform(1.0, 1.5), builder);
        } else {
          AddFloorLamp(palette, at, builder);
        }
      }
    }
    if (top < 1.3 && !has_window && palette.richness > 0.0) {
      // One picture, or two side by side.
      const int num = width > 1.3 && random->Uniform() < 0.6 ? 2 : 1;
      for (int i = 0; i < num; ++i) {
        const double w = std::min(random->Uniform(0.45, 0.9), width / num - 0.1),
                     h = random->Uniform(0.45, 0.75);
        const double at = u + width * (i + 0.5) / num - 0.5 * w;
        AddPicture(palette, wall, at, std::max(top + 0.2, 1.2) + random->Uniform(0, 0.1), w,
                   std::min(h, wall.height - 1.65), random->Uniform() < 0.3, builder);
      }
    }
  }
}

}  // namespace

Place BuildRoom(double richness, uint64_t seed) {
  PlaceBuilder builder(seed);
  Random* random = builder.random();
  const Palette palette = MakePalette(richness, &builder);
  const double width = random->Uniform(4.3, 5.8), depth = random->Uniform(4.3, 6.2),
               height = random->Uniform(2.5, 2.95);
  const std::array<WallFrame, 4> walls = InsideWalls(width, depth, height);

  builder.AddRectangle({0, 0, 0}, {width, 0, 0}, {0, depth, 0}, palette.floor);
  builder.AddRectangle({0, depth, height}, {width, 0, 0}, {0, -depth, 0}, palette.ceiling);
  const auto windowed = static_cast<size_t>(random->Index(4));
  const size_t with_door = (windowed + 2) % 4;
  const bool has_second = random->Uniform() < 0.5;  // windows round the corner
  const size_t also_windowed = (windowed + 1) % 4, papered = (windowed + 3) % 4;
  const float daylight = static_cast<float>(random->Uniform(5.0, 8.0));
  const Colour sky = daylight * Colour(0.92f, 1.0f, 1.1f);
  int kind = static_cast<int>(random->Index(5));
  for (size_t i = 0; i < 4; ++i) {
    const WallFrame& wall = walls[i];
    std::vector<Hole> holes;
    if (i == windowed || (has_second && i == also_windowed)) {
      const int num = i == windowed ? 2 : 1;
      const double size = std::min(1.35, (wall.width - 1.2) / num - 0.4);
      for (int k = 0; k < num; ++k) {
        const double middle = wall.width * (k + 0.5) / num + random->Uniform(-0.1, 0.1);
        holes.push_back(
            {middle - 0.5 * size, 0.9, middle + 0.5 * size, std::min(2.25, height - 0.2)});
      }
    }
    builder.AddWall(wall.origin, wall.width * wall.along, height * wall.up,
                    i == papered ? palette.wall2 : palette.wall, holes);
    for (const Hole& hole : holes) {
      AddWindow(palette, wall, hole, 0.2, 1, sky, &builder);
      builder.AddBox(wall.Against(hole.u0 - 0.06, hole.v0 - 0.03, 0.0), {0, -0.12, 0},
                     {hole.u1 - hole.u0 + 0.12, 0, 0.03}, palette.trim);
      AddRadiator(palette, wall.Against(hole.u0 + 0.1, 0.0, 0.0), hole.u1 - hole.u0 - 0.2,
                  &builder);
      if (random->Uniform() < 0.6) {
        AddCurtain(palette, wall, hole.u0 - 0.32, hole.u0 - 0.02, height - 0.1, palette.cloth2,
                   &builder);
        AddCurtain(palette, wall, hole.u1 + 0.02, hole.u1 + 0.32, height - 0.1, palette.cloth2,
                   &builder);
      }
    }
    const bool is_windowed = !holes.empty();
    if (i == with_door) {
      const double u = 0.35;
      AddDoor(palette, wall, u, 0.86, 2.02, random->Uniform() < 0.5 ? palette.white : palette.wood,
              &builder);
      AddSkirting(palette, wall, 0.015, u - 0.08, &builder);
      AddSkirting(palette, wall, u + 0.94, wall.width - 0.015, &builder);
      FurnishWall(palette, wall, Row(u + 1.2, wall.width - 0.5), false, kind, &builder);
    } else {
      AddSkirting(palette, wall, 0.015, wall.width - 0.015, &builder);
      if (!is_windowed)
        FurnishWall(palette, wall, Row(0.15, wall.width - 0.9), false, kind, &builder);
    }
    kind += 2;
  }

  // The middle: a carpet, and a table with chairs or a low one.
  const double cx = 0.5 * width, cy = 0.5 * depth;
  const double carpet_x = random->Uniform(1.7, 2.3), carpet_y = random->Uniform(1.3, 1.8);
  const int carpet =
      TexturedMaterial(palette, CarpetTexture(carpet_x, carpet_y, random->Bits()), &builder);
  builder.AddBox(Standing(cx - 0.5 * carpet_x, cy + 0.5 * carpet_y), {0, -carpet_y, 0},
                 {carpet_x, 0, 0.008}, carpet, {.top = carpet});
  const bool is_high = random->Uniform() < 0.6;
  const double tx = is_high ? random->Uniform(1.2, 1.5) : random->Uniform(0.8, 1.1),
               ty = is_high ? 0.8 : 0.55;
  const double top = is_high ? 0.74 : 0.44;
  const Pose table = Standing(cx - 0.5 * tx, cy + 0.5 * ty, 0.008, 0.0);
  AddTable(palette, table, tx, ty, top, random->Uniform() < 0.5 ? palette.wood : palette.dark_wood,
           &builder);
  Pose on_table = table;
  on_table.translation() = table * Vector3d(0.08, -0.08, top);
  AddClutter(palette, on_table, tx - 0.16, ty - 0.16, 4, &builder);
  if (is_high) {
    for (int i = 0; i < 4; ++i) {
      const double x = cx + (i % 2 == 0 ? -0.3 : 0.3) + random->Uniform(-0.05, 0.05),
                   side = i < 2 ? 1.0 : -1.0;
      const double y = cy + side * (0.5 * ty + random->Uniform(0.28, 0.4));
      const double turn = (side > 0 ? 0.0 : std::numbers::pi) + random->Uniform(-0.25, 0.25);
      // Its rear to the outside, about its middle.
      Pose chair = Standing(x, y, 0.008, turn);
      chair.translation() = chair * Vector3d(-0.215, 0.1, 0.0);
      AddChair(palette, chair, palette.dark_wood, &builder);
    }
  }
  const Colour lamp = static_cast<float>(random->Uniform(3.5, 6.0)) * Colour(1.08f, 1.0f, 0.86f);
  AddCeilingPanel(palette, cx, cy, height, 0.9, 0.5, lamp, &builder);

  Place place = builder.Take();
  place.walk = Loop(cx, cy, 0.5 * width - 1.05, 0.5 * depth - 1.05, 1.5, 1.05, 0.9, random);
  place.num_images = 30;
  place.field_of_view_deg = 68;
  place.texel_m = 0.07;
  return place;
}

Place BuildTable(uint64_t seed) {
  PlaceBuilder builder(seed);
  Random* random = builder.random();
  const Palette palette = MakePalette(1.0, &builder);
  const double width = 4.4, depth = 4.0, height = 2.8;
  const std::array<WallFrame, 4> walls = InsideWalls(width, depth, height);
  builder.AddRectangle({0, 0, 0}, {width, 0, 0}, {0, depth, 0}, palette.floor);
  builder.AddRectangle({0, depth, height}, {width, 0, 0}, {0, -depth, 0}, palette.ceiling);
  for (size_t i = 0; i < 4; ++i) {
    const WallFrame& wall = walls[i];
    const double middle = 0.5 * wall.width;
    std::vector<Hole> holes;
    if (i == 2) holes.push_back({middle - 1.0, 0.95, middle + 1.0, 2.3});
    builder.AddWall(wall.origin, wall.width * wall.along, height * wall.up, palette.wall, holes);
    for (const Hole& hole : holes)
      AddWindow(palette, wall, hole, 0.2, 2, 6.0f * Colour(0.93f, 1.0f, 1.08f), &builder);
    AddSkirting(palette, wall, 0.015, wall.width - 0.015, &builder);
    if (i != 2) {
      AddPicture(palette, wall, middle - 1.3, 1.05, 0.9, 0.7, false, &builder);
      AddPicture(palette, wall, middle + 0.3, 1.0, 0.7, 0.95, true, &builder);
    }
  }
  AddCeilingPanel(palette, 2.2, 2.0, height, 1.2, 0.6, 5.0f * Colour(1.05f, 1.0f, 0.9f), &builder);

  const double tx = 1.7, ty = 1.0, top = 0.74;
  const Pose table = Standing(0.5 * (width - tx), 0.5 * (depth + ty));
  AddTable(palette, table, tx, ty, top, palette.wood, &builder);
  // Cells on the table, one thing in each: spheres, cylinders, cones, ellipsoids and boxes in
  // turns.
  constexpr int kColumns = 6, kRows = 3;
  std::vector<int> kinds;
  for (int i = 0; i < kColumns * kRows; ++i) kinds.push_back(i % 5);
  for (size_t i = kinds.size() - 1; i > 0; --i)
    std::swap(kinds[i], kinds[static_cast<size_t>(random->Index(i + 1))]);
  const auto printed = [&](double w, double h) {
    return TexturedMaterial(palette, LabelTexture(w, h, random->Bits()), &builder, 0.03f);
  };
  for (int i = 0; i < kColumns * kRows; ++i) {
    const double x = tx * (i % kColumns + 0.5 + random->Uniform(-0.12, 0.12)) / kColumns;
    const double y = -ty * (i / kColumns + 0.5 + random->Uniform(-0.12, 0.12)) / kRows;
    Pose at = Standing(0, 0, 0, random->Uniform(-std::numbers::pi, std::numbers::pi));
    at.translation() = table * Vector3d(x, y, top);
    const double radius = random->Uniform(0.05, 0.095);
    switch (kinds[static_cast<size_t>(i)]) {
      case 0: {
        const Vector3d centre = at.translation() + radius * Vector3d::UnitZ();
        builder.AddSphere(centre, radius, printed(6.2831853 * radius, 3.1415927 * radius), true);
        break;
      }
      case 1: {
        const double tall = random->Uniform(0.1, 0.22), r = 0.75 * radius;
        builder.AddCylinder(at, r, tall, printed(6.2831853 * r, tall), true, palette.metal);
        break;
      }
      case 2: {
        const double tall = random->Uniform(0.14, 0.24), slant = std::hypot(tall, radius);
        builder.AddCone(at, radius, random->Uniform(0.0, 0.25) * radius, tall,
                        printed(3.1415927 * radius, slant), true);
        break;
      }
      case 3: {
        const Vector3d semi_axes(radius * random->Uniform(0.7, 0.85),
                                 radius * random->Uniform(0.55, 0.68),
                                 radius * random->Uniform(1.0, 1.25));
        at.translation() += semi_axes.z() * Vector3d::UnitZ();
        builder.AddEllipsoid(
            at, semi_axes,
            printed(3.1415927 * (semi_axes.x() + semi_axes.y()), 3.1415927 * semi_axes.z()), true);
        break;
      }
      default: {
        const Vector3d half(radius * random->Uniform(0.7, 1.1), radius * random->Uniform(0.5, 0.8),
                            0.0);
        const double tall = random->Uniform(0.08, 0.22);
        const int print = printed(0.3, 0.25);
        builder.AddBox(at, {-half.x(), -half.y(), 0}, {half.x(), half.y(), tall}, print,
                       {.is_cuboid = true});
      }
    }
  }
  Place place = builder.Take();
  place.walk = Loop(0.5 * width, 0.5 * depth, 1.45, 1.25, 1.5, top + 0.05, 0.05, random);
  place.num_images = 36;
  place.field_of_view_deg = 60;
  place.texel_m = 0.05;
  return place;
}

}  // namespace holba
