// SPDX-License-Identifier: BSD-3-Clause
// Pieces that places are furnished with. A pose is of the piece's left rear corner on the floor,
// seen from its front: x to the right, y to the rear (the piece is at y < 0), z up. Metres.
#pragma once

#include "holba/render/place.h"

namespace holba {

// Materials of one place, of one taste. `richness` 1: everything has its texture; 0: nothing has.
struct Palette {
  double richness = 1.0;
  int wall, wall2, ceiling, floor, trim;            // the building
  int wood, dark_wood, cloth, cloth2, metal, dark;  // pieces
  int white, glass, paper;
};
Palette MakePalette(double richness, PlaceBuilder* builder);
// A texture, or its mean colour where there is no texture.
int TexturedMaterial(const Palette& palette, Texture texture, PlaceBuilder* builder,
                     float gloss = 0.0f);

// A wall as a frame: along (to the right, seen from inside), up, and into the place.
struct WallFrame {
  Eigen::Vector3d origin, along, up, inwards;
  double width = 0.0, height = 0.0;

  Eigen::Vector3d At(double u, double v, double in) const {
    return origin + u * along + v * up + in * inwards;
  }
  // Of a piece that stands with its back to the wall, its left rear corner at u.
  Pose Against(double u, double v = 0.0, double gap = 0.01) const;
};

// The inside of a box [0, width] x [0, depth] x [0, height]: y = 0 (south), x = width (east), y =
// depth (north), x = 0.
std::array<WallFrame, 4> InsideWalls(double width, double depth, double height);

// A window in a hole of the wall (which the caller leaves): reveal, frame with `bars` across and a
// pane that shines as the sky does.
void AddWindow(const Palette& palette, const WallFrame& wall, const PlaceBuilder::Hole& hole,
               double reveal, int bars, const Colour& light, PlaceBuilder* builder);
void AddDoor(const Palette& palette, const WallFrame& wall, double u, double width, double height,
             int material, PlaceBuilder* builder);
void AddSkirting(const Palette& palette, const WallFrame& wall, double from, double to,
                 PlaceBuilder* builder);
void AddPicture(const Palette& palette, const WallFrame& wall, double u, double v, double width,
                double height, bool is_poster, PlaceBuilder* builder);
void AddBookshelf(const Palette& palette, const Pose& pose, double width, double depth,
                  double height, PlaceBuilder* builder);
void AddCabinet(const Palette& palette, const Pose& pose, double width, double depth, double height,
                int num_doors, int material, PlaceBuilder* builder);
void AddTable(const Palette& palette, const Pose& pose, double width, double depth, double height,
              int material, PlaceBuilder* builder);
void AddChair(const Palette& palette, const Pose& pose, int material, PlaceBuilder* builder);
void AddSofa(const Palette& palette, const Pose& pose, double width, PlaceBuilder* builder);
void AddBed(const Palette& palette, const Pose& pose, double width, PlaceBuilder* builder);
void AddDesk(const Palette& palette, const Pose& pose, double width, PlaceBuilder* builder);
void AddPlant(const Palette& palette, const Pose& pose, double height, PlaceBuilder* builder);
void AddRadiator(const Palette& palette, const Pose& pose, double width, PlaceBuilder* builder);
void AddCurtain(const Palette& palette, const WallFrame& wall, double from, double to, double top,
                int material, PlaceBuilder* builder);
void AddFloorLamp(const Palette& palette, const Pose& pose, PlaceBuilder* builder);
// A shining panel under the ceiling, about (x, y), facing down from z.
void AddCeilingPanel(const Palette& palette, double x, double y, double z, double width,
                     double depth, const Colour& light, PlaceBuilder* builder);
// Things as they lie about, on a surface of that size.
void AddClutter(const Palette& palette, const Pose& pose, double width, double depth, int num,
                PlaceBuilder* builder);

}  // namespace holba
