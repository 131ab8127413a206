// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/drawing/canvas.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <opencv2/imgproc.hpp>

#include "holba/frontend/drawing/picture_parts.h"

namespace holba {
namespace {

constexpr Rgb kPalette[] = {{222, 40, 48},  {30, 110, 220}, {26, 160, 70},  {245, 140, 20},
                            {150, 50, 190}, {0, 175, 190},  {225, 60, 170}, {150, 105, 30},
                            {115, 190, 20}, {60, 60, 150},  {240, 195, 0},  {240, 120, 120}};
constexpr size_t kPaletteSize = std::size(kPalette);

constexpr int kFineness = 2;
constexpr int kShift = 4;  // positions in sixteenths of a pixel

cv::Scalar ToScalar(const Rgb& rgb) { return {double(rgb[0]), double(rgb[1]), double(rgb[2])}; }

cv::Point ToPoint(const Eigen::Vector2d& p) {
  return {static_cast<int>(std::lround((kFineness * p.x() - 0.5) * (1 << kShift))),
          static_cast<int>(std::lround((kFineness * p.y() - 0.5) * (1 << kShift)))};
}

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;

std::string PlainLetters(const std::string& text) {
  // What follows the first byte of a letter in UTF-8 is a part of it.
  std::string plain;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte & 0xc0) != 0x80) plain += byte >= 0x20 && byte < 0x7f ? c : '?';
  }
  return plain;
}

}  // namespace

Rgb PaletteColour(size_t index) {
  const double scale = std::max(0.4, 1.0 - 0.25 * static_cast<double>(index / kPaletteSize));
  Rgb colour = kPalette[index % kPaletteSize];
  for (uint8_t& channel : colour) channel = static_cast<uint8_t>(std::lround(scale * channel));
  return colour;
}

Canvas::Canvas(int width, int height)
    : width_(width),
      height_(height),
      pixels_(kFineness * height, kFineness * width, CV_8UC3, cv::Scalar(255, 255, 255)) {}

Canvas::Canvas(const ColourImage& photograph) : Canvas(photograph.width, photograph.height) {
  const ColourImage pale = Pale(photograph);
  const cv::Mat small(height_, width_, CV_8UC3, const_cast<uint8_t*>(pale.pixels.data()));
  if (!small.empty()) cv::resize(small, pixels_, pixels_.size(), 0, 0, cv::INTER_NEAREST);
}

double Canvas::Diagonal() const { return std::hypot(width_, height_); }

bool Canvas::IsNear(const Eigen::Vector2d& p) const {
  return p.allFinite() && p.cwiseAbs().maxCoeff() < 2.0 * Diagonal();
}

void Canvas::Line(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Rgb& colour,
                  double width) {
  if (!Drawable(a) || !Drawable(b)) return;
  cv::line(pixels_, ToPoint(a), ToPoint(b), ToScalar(colour), Width(width), cv::LINE_AA, kShift);
}

void Canvas::Dot(const Eigen::Vector2d& centre, const Rgb& colour, double radius) {
  if (!Drawable(centre)) return;
  cv::circle(pixels_, ToPoint(centre), Radius(radius), ToScalar(colour), cv::FILLED, cv::LINE_AA,
             kShift);
}

void Canvas::Ring(const Eigen::Vector2d& centre, const Rgb& colour, double radius, double width) {
  if (!Drawable(centre)) return;
  cv::circle(pixels_, ToPoint(centre), Radius(radius), ToScalar(colour), Width(width), cv::LINE_AA,
             kShift);
}

void Canvas::Fill(const std::vector<Eigen::Vector2d>& polygon, const Rgb& colour) {
  std::vector<cv::Point> points;
  for (const Eigen::Vector2d& corner : polygon) {
    if (!Drawable(corner)) return;
    points.push_back(ToPoint(corner));
  }
  cv::fillConvexPoly(pixels_, points, ToScalar(colour), cv::LINE_AA, kShift);
}

void Canvas::Text(const std::string& text, const Eigen::Vector2d& left, const Rgb& colour,
                  double height) {
  if (text.empty() || !Drawable(left)) return;
  const std::string plain = PlainLetters(text);
  int below = 0;
  const cv::Size at_scale_1 = cv::getTextSize(plain, kFont, 1.0, 1, &below);
  const double room = kFineness * (width_ - left.x() - height * Diagonal() / 1000.0);
  const double scale = std::min(kFineness * height * Diagonal() / 1000.0 / at_scale_1.height,
                                room / std::max(at_scale_1.width, 1));
  if (!(scale > 0.0)) return;
  const cv::Point origin(static_cast<int>(std::lround(kFineness * left.x())),
                         static_cast<int>(std::lround(kFineness * left.y())));
  cv::putText(pixels_, plain, origin, kFont, scale, ToScalar(colour),
              std::max(1, static_cast<int>(std::lround(1.5 * scale))), cv::LINE_AA);
}

double Canvas::TextWidth(const std::string& text, double height_px) {
  int below = 0;
  const cv::Size at_scale_1 = cv::getTextSize(PlainLetters(text), kFont, 1.0, 1, &below);
  return at_scale_1.width * height_px / std::max(at_scale_1.height, 1);
}

ColourImage Canvas::ToImage() const {
  if (pixels_.empty()) return {width_, height_, {}};
  cv::Mat small;
  cv::resize(pixels_, small, cv::Size(width_, height_), 0, 0, cv::INTER_AREA);
  return {width_, height_, std::vector<uint8_t>(small.data, small.data + small.total() * 3)};
}

bool Canvas::Drawable(const Eigen::Vector2d& p) const {
  return p.allFinite() && p.cwiseAbs().maxCoeff() < 20.0 * Diagonal() + 1000.0;
}

int Canvas::Width(double width) const {
  return std::max(1, static_cast<int>(std::lround(kFineness * width * Diagonal() / 1000.0)));
}

int Canvas::Radius(double radius) const {
  const double pixels = std::max(kFineness * radius * Diagonal() / 1000.0, 1.0);
  return static_cast<int>(std::lround(pixels * (1 << kShift)));
}

}  // namespace holba
