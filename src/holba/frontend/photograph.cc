// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photograph.h"

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "holba/base/error.h"

namespace holba {
namespace {

cv::Mat ReadMatrix(const std::filesystem::path& path, int flags) {
  if (!std::filesystem::is_regular_file(path)) {
    throw InputError(path,
                     "there is no such image; --image_path must be the folder that the image "
                     "names of the model belong to");
  }
  cv::Mat image;
  try {
    image = cv::imread(path.string(), flags | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception& error) {
    throw InputError(path, std::string("the image cannot be decoded: ") + error.what());
  }
  if (image.empty()) {
    throw InputError(path,
                     "this is no image of a known format (jpg, png, tif, ...), or it is damaged");
  }
  return image;
}

}  // namespace

GreyImage ReadGreyImage(const std::filesystem::path& path) {
  const cv::Mat image = ReadMatrix(path, cv::IMREAD_GRAYSCALE);
  GreyImage result{image.cols, image.rows, {}};
  for (int y = 0; y < image.rows; ++y)
    result.pixels.insert(result.pixels.end(), image.ptr<uint8_t>(y),
                         image.ptr<uint8_t>(y) + image.cols);
  return result;
}

ColourImage ReadColourImage(const std::filesystem::path& path) {
  cv::Mat image = ReadMatrix(path, cv::IMREAD_COLOR), rgb;
  cv::cvtColor(image, rgb, cv::COLOR_BGR2RGB);
  ColourImage result{rgb.cols, rgb.rows, {}};
  for (int y = 0; y < rgb.rows; ++y)
    result.pixels.insert(result.pixels.end(), rgb.ptr<uint8_t>(y),
                         rgb.ptr<uint8_t>(y) + 3 * rgb.cols);
  return result;
}

void WriteImage(const ColourImage& image, const std::filesystem::path& path) {
  const cv::Mat rgb(image.height, image.width, CV_8UC3, const_cast<uint8_t*>(image.pixels.data()));
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  bool written = false;
  try {
    written = cv::imwrite(path.string(), bgr);
  } catch (const cv::Exception&) {
  }
  if (!written) throw InputError(path, "the picture cannot be written");
}

}  // namespace holba
