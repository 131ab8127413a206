// SPDX-License-Identifier: BSD-3-Clause
// The building's own parts are in fittings.cc.
#include "holba/render/furniture.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "holba/render/texture_recipes.h"

namespace holba {

using Eigen::Vector3d;

namespace {

Colour AnyColour(double low, double high, Random* random) {
  const auto grey = static_cast<float>(random->Uniform(low, high));
  return (grey * Colour(1.0f + static_cast<float>(random->Uniform(-0.35, 0.45)),
                        1.0f + static_cast<float>(random->Uniform(-0.25, 0.25)),
                        1.0f + static_cast<float>(random->Uniform(-0.45, 0.3))))
      .cwiseMax(0.01f)
      .cwiseMin(0.9f);
}

}  // namespace

int TexturedMaterial(const Palette& palette, Texture texture, PlaceBuilder* builder, float gloss) {
  if (palette.richness > 0.0)
    return builder->AddMaterial(builder->AddTexture(std::move(texture)), Colour::Ones(), gloss);
  return builder->AddPaint(texture.At(0.0, 0.0, 1e6) / 0.9f, gloss);
}

Palette MakePalette(double richness, PlaceBuilder* builder) {
  Random* random = builder->random();
  Palette palette;
  palette.richness = richness;
  const auto textured = [&](Texture texture, float gloss = 0.0f) {
    return TexturedMaterial(palette, std::move(texture), builder, gloss);
  };
  const Colour paints[] = {ColourOf(232, 226, 212), ColourOf(206, 214, 208),
                           ColourOf(222, 206, 186), ColourOf(196, 206, 220),
                           ColourOf(236, 234, 228)};
  const Colour paint = paints[random->Index(5)];
  palette.wall = textured(PlasterTexture(paint, 0.5 + random->Uniform(), random->Bits()));
  const uint64_t kind = random->Index(3);
  palette.wall2 =
      kind == 0   ? textured(WallpaperTexture(paint, AnyColour(0.15, 0.45, random), random->Bits()))
      : kind == 1 ? textured(BrickTexture(ColourOf(168, 98, 74), ColourOf(190, 182, 170), 0.24,
                                          0.08, random->Bits()))
                  : textured(PlasterTexture(AnyColour(0.2, 0.5, random), 1.0, random->Bits()));
  palette.ceiling = textured(PlasterTexture(ColourOf(240, 239, 234), 0.25, random->Bits()));
  palette.trim = builder->AddPaint(ColourOf(238, 236, 230), 0.03f);
  palette.wood = textured(WoodTexture(ColourOf(178, 128, 82), 0.0, random->Bits()), 0.03f);
  palette.dark_wood = textured(WoodTexture(ColourOf(98, 62, 40), 0.0, random->Bits()), 0.03f);
  palette.cloth = textured(
      ClothTexture(AnyColour(0.1, 0.4, random), AnyColour(0.1, 0.4, random), random->Bits()));
  const Colour plain_cloth = AnyColour(0.08, 0.35, random);
  palette.cloth2 = textured(ClothTexture(plain_cloth, plain_cloth, random->Bits()));
  palette.metal = builder->AddMaterial(0, Colour::Constant(0.35f), 0.25f, 0.12f);
  palette.dark = builder->AddMaterial(0, Colour::Constant(0.03f), 0.05f, 0.03f);
  palette.white = builder->AddPaint(ColourOf(236, 235, 232), 0.04f);
  palette.glass = builder->AddMaterial(0, Colour(0.02f, 0.025f, 0.03f), 0.10f, 0.01f);
  palette.paper = builder->AddPaint(ColourOf(244, 242, 236));
  const uint64_t floor = random->Index(4);
  palette.floor =
      floor < 2 ? textured(WoodTexture(floor == 0 ? ColourOf(170, 122, 78) : ColourOf(126, 88, 58),
                                       0.13, random->Bits()),
                           0.035f)
      : floor == 2 ? textured(TileTexture(ColourOf(206, 198, 184), ColourOf(150, 120, 100), 0.3,
                                          random->Index(2) == 0, random->Bits()),
                              0.04f)
                   : textured(StoneTexture(AnyColour(0.15, 0.35, random), 0.8, random->Bits()));
  return palette;
}

void AddBookshelf(const Palette& palette, const Pose& pose, double width, double depth,
                  double height, PlaceBuilder* builder) {
  Random* random = builder->random();
  const int wood = random->Uniform() < 0.5 ? palette.wood : palette.dark_wood;
  constexpr double kBoard = 0.022;
  builder->AddBox(pose, {0, -depth, 0}, {kBoard, 0, height}, wood, {.turn_texture = true});
  builder->AddBox(pose, {width - kBoard, -depth, 0}, {width, 0, height}, wood,
                  {.turn_texture = true});
  builder->AddBox(pose, {kBoard, -0.012, 0}, {width - kBoard, -0.002, height}, wood);
  const int num_boards = std::max(2, static_cast<int>(std::lround(height / 0.34)));
  for (int i = 0; i <= num_boards; ++i) {
    const double z = i == 0 ? 0.06 : (height - kBoard) * i / num_boards;
    builder->AddBox(pose, {kBoard, -depth + 0.002, z}, {width - kBoard, -0.012, z + kBoard}, wood);
    if (i == num_boards) break;
    const double room = (height - kBoard) * (i + 1) / num_boards - z - kBoard;
    double x = kBoard + random->Uniform(0.0, 0.06);
    while (x < width - kBoard - 0.12) {
      const double run = std::min(random->Uniform(0.1, 0.42), width - kBoard - x - 0.01);
      const double tall = room * random->Uniform(0.6, 0.9);
      if (random->Uniform() < 0.85) {
        const int books =
            TexturedMaterial(palette, BooksTexture(run, tall, random->Bits()), builder);
        const double rear = random->Uniform(0.015, 0.05), front = random->Uniform(0.02, 0.06);
        builder->AddBox(pose, {x, -depth + front, z + kBoard}, {x + run, -rear, z + kBoard + tall},
                        palette.paper, {.front = books, .fit_front = true});
      } else {
        Pose at = pose;
        at.translation() = pose * Vector3d(x, -0.03, z + kBoard);
        AddClutter(palette, at, run, depth - 0.08, 1, builder);
      }
      x += run + (random->Uniform() < 0.3 ? random->Uniform(0.05, 0.2) : 0.003);
    }
  }
}

void AddCabinet(const Palette& palette, const Pose& pose, double width, double depth, double height,
                int num_doors, int material, PlaceBuilder* builder) {
  builder->AddBox(pose, {0.01, -depth + 0.02, 0.0}, {width - 0.01, -0.005, 0.08}, palette.dark);
  builder->AddBox(pose, {0, -depth + 0.02, 0.08}, {width, 0, height - 0.025}, material,
                  {.turn_texture = true});
  builder->AddBox(pose, {-0.01, -depth - 0.01, height - 0.025}, {width + 0.01, 0, height},
                  material);
  const double door = width / num_doors;
  const bool has_drawers = builder->random()->Uniform() < 0.4;
  for (int i = 0; i < num_doors; ++i) {
    const int num_parts = has_drawers && i == 0 ? 3 : 1;
    const double tall = (height - 0.025 - 0.08) / num_parts;
    for (int j = 0; j < num_parts; ++j) {
      const double x = i * door + 0.004, z = 0.08 + j * tall + 0.004;
      builder->AddBox(pose, {x, -depth, z}, {x + door - 0.008, -depth + 0.02, z + tall - 0.008},
                      material, {.turn_texture = num_parts == 1});
      const double knob =
          num_parts > 1 ? x + 0.5 * door : (i % 2 == 0 ? x + door - 0.06 : x + 0.05);
      builder->AddSphere(pose * Vector3d(knob, -depth - 0.015, z + 0.6 * tall), 0.014,
                         palette.metal, false);
    }
  }
}

void AddTable(const Palette& palette, const Pose& pose, double width, double depth, double height,
              int material, PlaceBuilder* builder) {
  builder->AddBox(pose, {0, -depth, height - 0.032}, {width, 0, height}, material);
  constexpr double kLeg = 0.055, kInset = 0.04;
  for (const double x : {kInset, width - kInset - kLeg}) {
    for (const double y : {-depth + kInset, -kInset - kLeg}) {
      builder->AddBox(pose, {x, y, 0}, {x + kLeg, y + kLeg, height - 0.032}, material,
                      {.turn_texture = true});
    }
  }
  builder->AddBox(pose, {kInset + kLeg, -depth + kInset + 0.012, height - 0.11},
                  {width - kInset - kLeg, -depth + kInset + 0.032, height - 0.032}, material);
  builder->AddBox(pose, {kInset + kLeg, -kInset - 0.032, height - 0.11},
                  {width - kInset - kLeg, -kInset - 0.012, height - 0.032}, material);
}

void AddChair(const Palette& palette, const Pose& pose, int material, PlaceBuilder* builder) {
  constexpr double kWidth = 0.43, kDepth = 0.42, kSeat = 0.46, kLeg = 0.038;
  builder->AddBox(pose, {0, -kDepth, kSeat - 0.03}, {kWidth, 0, kSeat}, material);
  for (const double x : {0.0, kWidth - kLeg}) {
    builder->AddBox(pose, {x, -kDepth, 0}, {x + kLeg, -kDepth + kLeg, kSeat - 0.03}, material,
                    {.turn_texture = true});
    builder->AddBox(pose, {x, -kLeg, 0}, {x + kLeg, 0, kSeat - 0.03}, material,
                    {.turn_texture = true});
    builder->AddBox(pose, {x, -kLeg, kSeat}, {x + kLeg, 0, 0.92}, material, {.turn_texture = true});
  }
  for (const double z : {0.58, 0.70, 0.82}) {
    builder->AddBox(pose, {kLeg, -0.03, z}, {kWidth - kLeg, -0.01, z + 0.07}, material);
  }
  if (builder->random()->Uniform() < 0.6) {
    builder->AddBox(pose, {0.03, -kDepth + 0.02, kSeat}, {kWidth - 0.03, -0.05, kSeat + 0.035},
                    palette.cloth);
  }
}

void AddSofa(const Palette& palette, const Pose& pose, double width, PlaceBuilder* builder) {
  Random* random = builder->random();
  const int cloth = random->Uniform() < 0.4 ? palette.cloth : palette.cloth2;
  constexpr double kDepth = 0.85, kArm = 0.18;
  for (const double x : {0.05, width - 0.09}) {
    for (const double y : {-kDepth + 0.05, -0.09})
      builder->AddBox(pose, {x, y, 0}, {x + 0.04, y + 0.04, 0.08}, palette.dark_wood);
  }
  builder->AddBox(pose, {0, -kDepth + 0.03, 0.08}, {width, 0, 0.26}, cloth);
  builder->AddBox(pose, {0, -kDepth + 0.03, 0.26}, {kArm, 0, 0.6}, cloth);
  builder->AddBox(pose, {width - kArm, -kDepth + 0.03, 0.26}, {width, 0, 0.6}, cloth);
  builder->AddBox(pose, {kArm, -0.2, 0.26}, {width - kArm, 0, 0.8}, cloth);
  const int num = width > 1.9 ? 3 : 2;
  const double seat = (width - 2 * kArm) / num;
  for (int i = 0; i < num; ++i) {
    builder->AddBox(pose, {kArm + i * seat + 0.005, -kDepth, 0.26},
                    {kArm + (i + 1) * seat - 0.005, -0.205, 0.43}, cloth);
  }
  for (int i = 0; i < 3; ++i) {
    Pose at = pose;
    at.translation() =
        pose * Vector3d(random->Uniform(kArm + 0.25, width - kArm - 0.25), -0.36, 0.61);
    at.linear() =
        pose.linear() *
        Eigen::AngleAxisd(random->Uniform(-0.3, 0.3), Vector3d::UnitY()).toRotationMatrix() *
        Eigen::AngleAxisd(-0.35, Vector3d::UnitX()).toRotationMatrix();
    builder->AddEllipsoid(at, {0.22, 0.09, 0.19}, i == 0 ? palette.cloth : palette.cloth2, false);
  }
}

void AddBed(const Palette& palette, const Pose& pose, double width, PlaceBuilder* builder) {
  builder->AddBox(pose, {0, -0.05, 0}, {width, 0, 0.95}, palette.dark_wood);
  builder->AddBox(pose, {0, -2.05, 0.12}, {width, -0.05, 0.3}, palette.dark_wood);
  for (const double x : {0.0, width - 0.07})
    builder->AddBox(pose, {x, -2.05, 0}, {x + 0.07, -1.98, 0.12}, palette.dark_wood);
  builder->AddBox(pose, {0.03, -2.02, 0.3}, {width - 0.03, -0.06, 0.48}, palette.white);
  builder->AddBox(pose, {0.01, -2.04, 0.33}, {width - 0.01, -0.65, 0.52}, palette.cloth);
  const int num = width > 1.3 ? 2 : 1;
  for (int i = 0; i < num; ++i) {
    Pose at = pose;
    at.translation() = pose * Vector3d(width * (i + 0.5) / num, -0.36, 0.54);
    builder->AddEllipsoid(at, {0.33, 0.22, 0.09}, palette.white, false);
  }
}

void AddDesk(const Palette& palette, const Pose& pose, double width, PlaceBuilder* builder) {
  Random* random = builder->random();
  AddTable(palette, pose, width, 0.7, 0.74, palette.wood, builder);
  // Monitor, keyboard, lamp and papers.
  const double x = random->Uniform(0.25, 0.45) * width;
  builder->AddBox(pose, {x + 0.15, -0.38, 0.74}, {x + 0.37, -0.2, 0.752}, palette.dark);
  builder->AddBox(pose, {x + 0.23, -0.27, 0.752}, {x + 0.29, -0.24, 0.9}, palette.dark);
  const int screen =
      TexturedMaterial(palette, PosterTexture(0.52, 0.31, random->Bits()), builder, 0.04f);
  builder->AddBox(pose, {x, -0.30, 0.86}, {x + 0.54, -0.27, 1.19}, palette.dark);
  builder->AddBox(pose, {x + 0.012, -0.304, 0.872}, {x + 0.528, -0.3, 1.178}, palette.dark,
                  {.front = screen, .fit_front = true});
  const int keys = TexturedMaterial(
      palette, TileTexture(ColourOf(40, 40, 42), ColourOf(58, 58, 60), 0.019, false, 3), builder);
  builder->AddBox(pose, {x + 0.05, -0.62, 0.74}, {x + 0.48, -0.48, 0.758}, palette.dark,
                  {.top = keys});
  Pose at = pose;
  at.translation() = pose * Vector3d(0.04, -0.06, 0.74);
  AddClutter(palette, at, x - 0.06, 0.5, 2, builder);
  at.translation() = pose * Vector3d(x + 0.58, -0.06, 0.74);
  AddClutter(palette, at, width - x - 0.62, 0.5, 3, builder);
}

void AddPlant(const Palette& palette, const Pose& pose, double height, PlaceBuilder* builder) {
  Random* random = builder->random();
  const int pot = builder->AddPaint(AnyColour(0.15, 0.5, random), 0.04f);
  const int leaf = TexturedMaterial(
      palette, ClothTexture(ColourOf(52, 92, 40), ColourOf(70, 118, 52), random->Bits()), builder,
      0.03f);
  builder->AddCone(pose, 0.11, 0.16, 0.28, pot, false);
  Pose soil = pose;
  soil.translation() = pose * Vector3d(0, 0, 0.24);
  for (int i = 0; i < 46; ++i) {
    const double turn = random->Uniform(0, 2 * std::numbers::pi), rise = random->Uniform(0.1, 1.0);
    const double z = 0.3 + rise * (height - 0.3),
                 reach = random->Uniform(0.06, 0.3) * (1.15 - 0.6 * rise);
    Pose at = Pose::Identity();
    at.linear() = (Eigen::AngleAxisd(turn, Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(random->Uniform(-0.7, 0.9), Vector3d::UnitY()) *
                   Eigen::AngleAxisd(random->Uniform(-0.5, 0.5), Vector3d::UnitX()))
                      .toRotationMatrix();
    at.translation() = pose * Vector3d(reach * std::cos(turn), reach * std::sin(turn), z);
    builder->AddEllipsoid(at, {random->Uniform(0.07, 0.13), random->Uniform(0.03, 0.05), 0.004},
                          leaf, false);
  }
  builder->AddCylinder(Pose(Eigen::Translation3d(pose * Vector3d(0, 0, 0.25))), 0.012, height - 0.4,
                       palette.dark_wood, false);
}

void AddFloorLamp(const Palette& palette, const Pose& pose, PlaceBuilder* builder) {
  builder->AddCylinder(pose, 0.14, 0.02, palette.metal, false);
  Pose at = pose;
  at.translation() = pose * Vector3d(0, 0, 0.02);
  builder->AddCylinder(at, 0.011, 1.45, palette.metal, false);
  at.translation() = pose * Vector3d(0, 0, 1.4);
  builder->AddCone(at, 0.22, 0.14, 0.28, builder->AddLight(Colour(2.6f, 2.0f, 1.3f)), false);
}

void AddClutter(const Palette& palette, const Pose& pose, double width, double depth, int num,
                PlaceBuilder* builder) {
  Random* random = builder->random();
  if (width < 0.08 || num < 1) return;
  const double cell = width / num;
  for (int i = 0; i < num; ++i) {
    const double x = (i + random->Uniform(0.4, 0.6)) * cell,
                 y = -depth * random->Uniform(0.35, 0.65);
    const double room = std::min(0.42 * cell, 0.42 * depth);
    Pose at = pose;
    at.translation() = pose * Vector3d(x, y, 0);
    at.linear() =
        pose.linear() *
        Eigen::AngleAxisd(random->Uniform(-0.7, 0.7), Vector3d::UnitZ()).toRotationMatrix();
    switch (random->Index(6)) {
      case 0: {  // a pile of books
        double z = 0.0;
        for (int k = 0; k < 2 + static_cast<int>(random->Index(4)); ++k) {
          const double half = room * random->Uniform(0.6, 0.8),
                       thick = random->Uniform(0.015, 0.04);
          const int cover = TexturedMaterial(
              palette, PosterTexture(2 * half, 1.4 * half, random->Bits()), builder, 0.03f);
          Pose turned = at;
          turned.linear() =
              at.linear() *
              Eigen::AngleAxisd(random->Uniform(-0.25, 0.25), Vector3d::UnitZ()).toRotationMatrix();
          builder->AddBox(turned, {-half, -0.7 * half, z}, {half, 0.7 * half, z + thick}, cover);
          z += thick;
        }
        break;
      }
      case 1: {  // a tin
        const double radius = std::min(room, random->Uniform(0.035, 0.06)),
                     tall = random->Uniform(0.09, 0.16);
        const int label = TexturedMaterial(
            palette, LabelTexture(6.2831853 * radius, tall, random->Bits()), builder, 0.03f);
        builder->AddCylinder(at, radius, tall, label, false, palette.metal);
        break;
      }
      case 2: {  // a ball or a bowl's fruit
        const double radius = std::min(room, random->Uniform(0.035, 0.09));
        at.translation() += radius * pose.linear().col(2);
        builder->AddSphere(at.translation(), radius,
                           builder->AddPaint(AnyColour(0.1, 0.5, random), 0.04f), false);
        break;
      }
      case 3: {  // a vase
        const double radius = std::min(room, random->Uniform(0.04, 0.07)),
                     tall = random->Uniform(0.16, 0.3);
        const int glaze = builder->AddPaint(AnyColour(0.1, 0.6, random), 0.05f);
        builder->AddCone(at, radius, 0.55 * radius, 0.65 * tall, glaze, false);
        at.translation() += 0.65 * tall * pose.linear().col(2);
        builder->AddCone(at, 0.55 * radius, 0.8 * radius, 0.35 * tall, glaze, false);
        break;
      }
      default: {  // a carton
        const double half = std::min(room, random->Uniform(0.05, 0.14)),
                     tall = random->Uniform(0.06, 0.24);
        const int print =
            TexturedMaterial(palette, LabelTexture(2 * half, tall, random->Bits()), builder, 0.02f);
        builder->AddBox(at, {-half, -0.6 * half, 0}, {half, 0.6 * half, tall}, print,
                        {.front = print, .fit_front = true});
      }
    }
  }
}

}  // namespace holba
