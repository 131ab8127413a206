// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/drawing/pair_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <set>

#include "holba/base/check.h"
#include "holba/base/words.h"
#include "holba/frontend/drawing/canvas.h"

namespace holba {
namespace {

constexpr Rgb kPointColour = {20, 90, 60}, kRejected = {200, 30, 30};
constexpr int kGapPx = 6;       // between the images of a row
constexpr int kCaptionPx = 26;  // height of the words above a row
constexpr double kLetterPx = 11.0;
constexpr double kSegmentWidth = 1.6, kMatchWidth = 0.7, kDotRadius = 1.1;
// Lines of hundreds of matches would hide the photographs.
constexpr double kMatchOpacity = 0.7;

// An image as it is drawn: scaled, and shifted to the right if it is the second of a row.
struct Panel {
  const ShownImage* image;
  ColourImage photograph;  // scaled
  double scale_x = 1.0, scale_y = 1.0;
  int left = 0;

  Eigen::Vector2d At(const Eigen::Vector2d& pixel) const {
    return {left + scale_x * pixel.x(), scale_y * pixel.y()};
  }
};

Panel MakePanel(const ShownImage& image, int size_px, int left) {
  HOLBA_CHECK(size_px > 0);
  const bool has_photograph = !image.photograph.pixels.empty();
  const int width = has_photograph ? image.photograph.width : std::max(1, image.width);
  const int height = has_photograph ? image.photograph.height : std::max(1, image.height);
  const double scale = std::min(1.0, size_px / static_cast<double>(std::max(width, height)));
  Panel panel{.image = &image, .left = left};
  panel.photograph.width = std::max(1, static_cast<int>(std::lround(scale * width)));
  panel.photograph.height = std::max(1, static_cast<int>(std::lround(scale * height)));
  const size_t num_bytes = size_t{3} * panel.photograph.width * panel.photograph.height;
  panel.photograph.pixels.assign(num_bytes, 255);
  if (has_photograph) {
    const cv::Mat from(height, width, CV_8UC3,
                       const_cast<uint8_t*>(image.photograph.pixels.data()));
    cv::Mat to(panel.photograph.height, panel.photograph.width, CV_8UC3,
               panel.photograph.pixels.data());
    cv::resize(from, to, to.size(), 0, 0, cv::INTER_AREA);
  }
  panel.scale_x = panel.photograph.width / static_cast<double>(std::max(1, image.width));
  panel.scale_y = panel.photograph.height / static_cast<double>(std::max(1, image.height));
  return panel;
}

ColourImage White(int width, int height) {
  return {width, height, std::vector<uint8_t>(size_t{3} * width * height, 255)};
}

// Both lie within the picture.
void Paste(const ColourImage& part, int left, int top, ColourImage* picture) {
  for (int y = 0; y < part.height; ++y) {
    const auto from = part.pixels.begin() + size_t{3} * y * part.width;
    std::copy(from, from + 3 * part.width,
              picture->pixels.begin() + 3 * (size_t(top + y) * picture->width + left));
  }
}

ColourImage SideBySide(const std::vector<Panel>& panels) {
  int width = 0, height = 0;
  for (const Panel& panel : panels) {
    width = std::max(width, panel.left + panel.photograph.width);
    height = std::max(height, panel.photograph.height);
  }
  ColourImage row = White(width, height);
  for (const Panel& panel : panels) Paste(panel.photograph, panel.left, 0, &row);
  return row;
}

ColourImage Below(const std::vector<ColourImage>& parts) {
  int width = 0, height = 0;
  for (const ColourImage& part : parts) {
    width = std::max(width, part.width);
    height += part.height;
  }
  ColourImage all = White(width, height);
  int top = 0;
  for (const ColourImage& part : parts) {
    Paste(part, 0, top, &all);
    top += part.height;
  }
  return all;
}

// Words above panels, each where its panel begins, up to where the next begins.
ColourImage Captions(int width, const std::vector<std::pair<int, std::string>>& texts) {
  ColourImage all = White(width, kCaptionPx);
  for (size_t i = 0; i < texts.size(); ++i) {
    const auto& [left, text] = texts[i];
    const int end = i + 1 < texts.size() ? texts[i + 1].first : width;
    Canvas canvas(std::max(1, end - left), kCaptionPx);
    canvas.Text(text, {4.0, 0.7 * kCaptionPx}, kBlack, kLetterPx * 1000.0 / canvas.Diagonal());
    Paste(canvas.ToImage(), left, 0, &all);
  }
  return all;
}

std::string InWords(const ShownImage& image) {
  const std::set<int32_t> labels(image.vp_of_segment.begin(), image.vp_of_segment.end());
  return fmt::format("{}: {}, {}, {}, {}", image.name, Counted(image.points.size(), "point"),
                     Counted(image.segments.size(), "segment"),
                     Counted(image.corners.size(), "corner"),
                     Counted(labels.size() - labels.count(-1), "vanishing point"));
}

ColourImage FeatureRow(const std::vector<Panel>& panels) {
  Canvas canvas(SideBySide(panels));
  std::vector<std::pair<int, std::string>> captions;
  int width = 0;
  for (const Panel& panel : panels) {
    const ShownImage& image = *panel.image;
    for (const Eigen::Vector2d& point : image.points)
      canvas.Dot(panel.At(point), kPointColour, kDotRadius);
    for (size_t i = 0; i < image.segments.size(); ++i) {
      const int32_t vp = i < image.vp_of_segment.size() ? image.vp_of_segment[i] : -1;
      canvas.Line(panel.At(image.segments[i].start), panel.At(image.segments[i].end),
                  vp < 0 ? kGrey : PaletteColour(static_cast<size_t>(vp)), kSegmentWidth);
    }
    for (const Eigen::Vector2d& corner : image.corners)
      canvas.Ring(panel.At(corner), kBlack, 2.6, 0.8);
    captions.emplace_back(panel.left, InWords(image));
    width = panel.left + panel.photograph.width;
  }
  return Below({Captions(width, captions), canvas.ToImage()});
}

ColourImage MatchRow(const Panel& panel1, const Panel& panel2, const PointMatches& matches,
                     const std::string& caption, bool in_colours) {
  Canvas canvas(SideBySide({panel1, panel2}));
  const auto draw = [&](const std::function<void(const Eigen::Vector2d&, const Eigen::Vector2d&,
                                                 const Rgb&)>& one) {
    for (size_t i = 0; i < matches.size(); ++i) {
      const auto& [idx1, idx2] = matches[i];
      if (idx1 >= panel1.image->points.size() || idx2 >= panel2.image->points.size()) continue;
      one(panel1.At(panel1.image->points[idx1]), panel2.At(panel2.image->points[idx2]),
          in_colours ? PaletteColour(i % 12) : kRejected);
    }
  };
  canvas.Translucent(kMatchOpacity, [&] {
    draw([&](const auto& a, const auto& b, const Rgb& colour) {
      canvas.Line(a, b, colour, kMatchWidth);
    });
  });
  draw([&](const auto& a, const auto& b, const Rgb& colour) {
    canvas.Dot(a, colour, kDotRadius);
    canvas.Dot(b, colour, kDotRadius);
  });
  const ColourImage row = canvas.ToImage();
  return Below({Captions(row.width, {{0, caption}}), row});
}

ColourImage SegmentRow(const Panel& panel1, const Panel& panel2,
                       const std::vector<LineMatch>& matches) {
  Canvas canvas(SideBySide({panel1, panel2}));
  const auto middle = [](const LineSegment2d& segment) {
    return Eigen::Vector2d(0.5 * (segment.start + segment.end));
  };
  const auto draw =
      [&](const std::function<void(const LineSegment2d&, const LineSegment2d&, const Rgb&)>& one) {
        for (size_t i = 0; i < matches.size(); ++i) {
          const LineMatch& match = matches[i];
          if (match.idx1 < panel1.image->segments.size() &&
              match.idx2 < panel2.image->segments.size())
            one(panel1.image->segments[match.idx1], panel2.image->segments[match.idx2],
                PaletteColour(i % 12));
        }
      };
  canvas.Translucent(0.5 * kMatchOpacity, [&] {
    draw([&](const LineSegment2d& a, const LineSegment2d& b, const Rgb& colour) {
      canvas.Line(panel1.At(middle(a)), panel2.At(middle(b)), colour, kMatchWidth);
    });
  });
  draw([&](const LineSegment2d& a, const LineSegment2d& b, const Rgb& colour) {
    canvas.Line(panel1.At(a.start), panel1.At(a.end), colour, kSegmentWidth);
    canvas.Line(panel2.At(b.start), panel2.At(b.end), colour, kSegmentWidth);
  });
  const ColourImage row = canvas.ToImage();
  return Below({Captions(row.width, {{0, Counted(matches.size(), "segment match")}}), row});
}

}  // namespace

ColourImage DrawImageFeatures(const ShownImage& image, int size_px) {
  return FeatureRow({MakePanel(image, size_px, 0)});
}

ColourImage DrawImagePair(const ShownImage& image1, const ShownImage& image2, const ShownPair& pair,
                          int size_px) {
  const Panel panel1 = MakePanel(image1, size_px, 0);
  const Panel panel2 = MakePanel(image2, size_px, panel1.photograph.width + kGapPx);
  std::vector<ColourImage> rows = {FeatureRow({panel1, panel2})};
  if (!pair.inliers.empty()) {
    std::string caption = Counted(pair.inliers.size(), "inlier");
    if (!pair.geometry.empty()) caption += ", " + pair.geometry;
    rows.push_back(MatchRow(panel1, panel2, pair.inliers, caption, true));
  }
  if (!pair.rejected.empty()) {
    rows.push_back(MatchRow(panel1, panel2, pair.rejected,
                            Counted(pair.rejected.size(), "rejected match"), false));
  }
  if (!pair.segments.empty()) rows.push_back(SegmentRow(panel1, panel2, pair.segments));
  return Below(rows);
}

}  // namespace holba
