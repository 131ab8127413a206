// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/undistort.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "holba/base/check.h"

namespace holba {
namespace {

constexpr double kLargestCanvas = 2.0;  // times the photograph, either way
constexpr double kRoundTripPx = 0.01;
// Distance of the nodes at which the way back is tested; between good ones the formula is smooth.
constexpr int kCellPx = 16;

}  // namespace

IdealCanvas::IdealCanvas(const Camera& camera)
    : camera_(&camera),
      offset_(0, 0),
      width_(static_cast<int>(camera.width)),
      height_(static_cast<int>(camera.height)) {
  HOLBA_CHECK_MSG(width_ > 0 && height_ > 0, "a camera with the size of its images");
  if (is_photograph()) return;
  const Eigen::Vector2d size(width_, height_);
  const Eigen::Vector2d lowest = 0.5 * (1.0 - kLargestCanvas) * size;
  const Eigen::Vector2d highest = size - lowest;
  Eigen::Vector2d low = highest, high = lowest;
  // Not the border alone: in a fisheye image it may be without rays in front of the camera.
  constexpr int kNumSteps = 64;
  for (int row = 0; row <= kNumSteps; ++row) {
    for (int column = 0; column <= kNumSteps; ++column) {
      const Eigen::Vector2d pixel = size.cwiseProduct(Eigen::Vector2d(column, row) / kNumSteps);
      const auto ideal = IdealPixel(*camera.model, camera.params.data(), pixel);
      if (!ideal) continue;
      low = low.cwiseMin(*ideal);
      high = high.cwiseMax(*ideal);
    }
  }
  low = low.cwiseMax(lowest);
  high = high.cwiseMin(highest);
  offset_ = low.array().floor();
  // A camera without any ray gets an empty picture, not a failure.
  const Eigen::Vector2d extent = (high - offset_).array().ceil().max(2.0);
  width_ = static_cast<int>(extent.x());
  height_ = static_cast<int>(extent.y());
  MapPixels();
}

std::optional<Eigen::Vector2d> IdealCanvas::Project(const Eigen::Vector2d& on_canvas) const {
  const IdealCalibration k = camera_->model->ideal_calibration(camera_->params.data());
  const Eigen::Vector2d ideal = on_canvas + offset_;
  Eigen::Vector2d pixel;
  if (!camera_->model->project(camera_->params.data(),
                               {(ideal.x() - k.cx) / k.fx, (ideal.y() - k.cy) / k.fy, 1.0}, &pixel))
    return std::nullopt;
  return pixel;
}

bool IdealCanvas::LeadsBack(const Eigen::Vector2d& on_canvas, const Eigen::Vector2d& pixel) const {
  const auto back = FromPixel(pixel);
  return back && (*back - on_canvas).squaredNorm() < kRoundTripPx * kRoundTripPx;
}

std::optional<Eigen::Vector2d> IdealCanvas::ToPixel(const Eigen::Vector2d& on_canvas) const {
  const auto pixel = is_photograph() ? on_canvas : Project(on_canvas);
  if (!pixel || !(pixel->x() >= 0.0 && pixel->x() <= static_cast<double>(camera_->width) &&
                  pixel->y() >= 0.0 && pixel->y() <= static_cast<double>(camera_->height)))
    return std::nullopt;
  if (!is_photograph() && !LeadsBack(on_canvas, *pixel)) return std::nullopt;
  return pixel;
}

std::optional<Eigen::Vector2d> IdealCanvas::FromPixel(const Eigen::Vector2d& pixel) const {
  const auto ideal = IdealPixel(*camera_->model, camera_->params.data(), pixel);
  if (!ideal) return std::nullopt;
  return Eigen::Vector2d(*ideal - offset_);
}

void IdealCanvas::MapPixels() {
  const int node_columns = (width_ + kCellPx - 1) / kCellPx + 1;
  const int node_rows = (height_ + kCellPx - 1) / kCellPx + 1;
  std::vector<char> is_good(static_cast<size_t>(node_columns) * node_rows);
  for (int row = 0; row < node_rows; ++row) {
    for (int column = 0; column < node_columns; ++column) {
      const Eigen::Vector2d node(column * kCellPx, row * kCellPx);
      const auto pixel = Project(node);
      is_good[static_cast<size_t>(row) * node_columns + column] = pixel && LeadsBack(node, *pixel);
    }
  }
  const Eigen::Vector2f nowhere(-1e6f, -1e6f);
  const double width = static_cast<double>(camera_->width);
  const double height = static_cast<double>(camera_->height);
  const size_t size = static_cast<size_t>(width_) * height_;
  pixels_.reserve(size);
  is_shown_.reserve(size);
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const char* node = &is_good[static_cast<size_t>(y / kCellPx) * node_columns + x / kCellPx];
      const bool good = node[0] && node[1] && node[node_columns] && node[node_columns + 1];
      const Eigen::Vector2d position(x + 0.5, y + 0.5);
      auto pixel = Project(position);
      if (pixel && !good && !LeadsBack(position, *pixel)) pixel.reset();
      pixels_.push_back(pixel ? Eigen::Vector2f(pixel->cast<float>()) : nowhere);
      is_shown_.push_back(pixel && pixel->x() >= 0.0 && pixel->x() <= width && pixel->y() >= 0.0 &&
                          pixel->y() <= height);
    }
  }
}

GreyImage IdealCanvas::Resample(const GreyImage& photograph) const {
  HOLBA_CHECK_MSG(photograph.width == static_cast<int>(camera_->width) &&
                      photograph.height == static_cast<int>(camera_->height),
                  "an image of its camera's size");
  if (is_photograph()) return photograph;
  // OpenCV counts from the centre of the first pixel.
  cv::Mat map(height_, width_, CV_32FC2);
  for (int y = 0; y < height_; ++y) {
    const Eigen::Vector2f* in = &pixels_[static_cast<size_t>(y) * width_];
    for (int x = 0; x < width_; ++x)
      map.at<cv::Vec2f>(y, x) = cv::Vec2f(in[x].x() - 0.5f, in[x].y() - 0.5f);
  }
  const cv::Mat in(photograph.height, photograph.width, CV_8UC1,
                   const_cast<uint8_t*>(photograph.pixels.data()));
  GreyImage result{width_, height_, std::vector<uint8_t>(static_cast<size_t>(width_) * height_)};
  cv::Mat out(height_, width_, CV_8UC1, result.pixels.data());
  // Cubic: bilinear interpolation would blur edges by as much as the photograph does itself.
  // Continuing the border would bend the edges that run out of it; this way they end there.
  cv::remap(in, out, map, cv::noArray(), cv::INTER_CUBIC, cv::BORDER_CONSTANT, cv::mean(in));
  return result;
}

bool IdealCanvas::IsShown(const Eigen::Vector2d& on_canvas) const {
  const int x = static_cast<int>(std::floor(on_canvas.x()));
  const int y = static_cast<int>(std::floor(on_canvas.y()));
  return x >= 0 && x < width_ && y >= 0 && y < height_ &&
         is_shown_[static_cast<size_t>(y) * width_ + x];
}

std::optional<LineSegment2d> IdealCanvas::ShownPart(const LineSegment2d& on_canvas,
                                                    double margin_px) const {
  if (is_photograph()) return on_canvas;
  const int count = std::max(2, static_cast<int>(std::ceil(on_canvas.Length())) + 1);
  const Eigen::Vector2d step = (on_canvas.end - on_canvas.start) / (count - 1);
  const Eigen::Vector2d across = on_canvas.Line().head<2>() * margin_px;
  int best_first = 0, best_size = 0, size = 0;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d p = on_canvas.start + i * step;
    size = IsShown(p) && IsShown(p + across) && IsShown(p - across) ? size + 1 : 0;
    if (size > best_size) {
      best_size = size;
      best_first = i - size + 1;
    }
  }
  if (best_size < 2) return std::nullopt;
  if (best_size == count) return on_canvas;
  return LineSegment2d{on_canvas.start + best_first * step,
                       on_canvas.start + (best_first + best_size - 1) * step};
}

}  // namespace holba
