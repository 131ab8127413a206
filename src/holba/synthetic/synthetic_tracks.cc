// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/synthetic_tracks.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "holba/base/check.h"
#include "holba/base/error.h"

namespace holba {
namespace {

// Images near each other from which the lines of one plane draw theirs.
constexpr size_t kNearPool = 18;

using Pool = std::span<const uint32_t>;

// For each image those before and after it, itself first, then by distance along the sequence.
std::vector<std::vector<uint32_t>> NearestInSequence(size_t num_images, size_t count) {
  std::vector<std::vector<uint32_t>> nearest(num_images);
  for (size_t i = 0; i < num_images; ++i) {
    for (size_t step = 0; step < num_images && nearest[i].size() < count; ++step) {
      if (i + step < num_images) nearest[i].push_back(static_cast<uint32_t>(i + step));
      if (step > 0 && step <= i && nearest[i].size() < count)
        nearest[i].push_back(static_cast<uint32_t>(i - step));
    }
  }
  return nearest;
}

class TrackMaker {
 public:
  TrackMaker(const SyntheticCameras& cameras, SceneLayout layout, Visibility visibility,
             Random* random)
      : cameras_(cameras),
        layout_(layout),
        is_near_(visibility != Visibility::kRandom),
        random_(*random) {
    all_.resize(cameras.cam_from_world.size());
    std::iota(all_.begin(), all_.end(), 0);
    if (layout != SceneLayout::kSphere) return;
    if (visibility == Visibility::kCluster)
      nearest_ = NearestCameras(cameras.cam_from_world, kNearPool);
    if (visibility == Visibility::kNear) nearest_ = NearestInSequence(all_.size(), kNearPool);
  }

  // Near images are nearest to one of `beside`; if this is empty, to any.
  std::vector<uint32_t> Track(std::span<const Eigen::Vector3d> extent, Pool beside = {}) {
    const size_t length = Length();
    const Pool pool = PoolFor(extent, is_near_ ? length : all_.size(), beside);
    std::vector<uint32_t> track;
    Draw(pool, length, extent, &track);
    return track;
  }

  std::vector<std::vector<uint32_t>> SharedTracks(std::span<const Eigen::Vector3d> extent,
                                                  size_t count) {
    const Pool pool = PoolFor(extent, is_near_ ? kNearPool : all_.size(), {});
    std::vector<uint32_t> common;
    Draw(pool, NumCommon(pool.size()), extent, &common);
    std::vector<std::vector<uint32_t>> tracks(count, common);
    for (auto& track : tracks) Draw(pool, Length(), extent, &track);
    return tracks;
  }

 private:
  size_t Length() { return kMinTrackLength + random_.Index(kMaxTrackLength - kMinTrackLength + 1); }

  // With c images common and the rest drawn from the other images of the pool, two tracks of mean
  // length m share c + (m - c)^2 / (pool - c) images.
  static size_t NumCommon(size_t pool_size) {
    constexpr double kMean = 0.5 * (kMinTrackLength + kMaxTrackLength);
    size_t best = 0;
    double best_error = INFINITY;
    for (size_t c = 0; c < kMinTrackLength; ++c) {
      const double own = kMean - static_cast<double>(c);
      const double shared = c + own * own / static_cast<double>(pool_size - c);
      const double error = std::abs(shared - 0.5 * kMean);
      if (error < best_error) {
        best = c;
        best_error = error;
      }
    }
    return best;
  }

  bool Sees(uint32_t image, std::span<const Eigen::Vector3d> extent) const {
    return std::all_of(extent.begin(), extent.end(), [&](const Eigen::Vector3d& X) {
      return cameras_.Project(image, X).has_value();
    });
  }

  // At most max_size images that may see the extent; valid until the next call.
  Pool PoolFor(std::span<const Eigen::Vector3d> extent, size_t max_size, Pool beside) {
    if (layout_ == SceneLayout::kCorridor) return CorridorPool(extent, max_size);
    if (!is_near_) return all_;
    const Pool centres = beside.empty() ? Pool(all_) : beside;
    const std::vector<uint32_t>& pool = nearest_[centres[random_.Index(centres.size())]];
    return Pool(pool).first(std::min(max_size, pool.size()));
  }

  Pool CorridorPool(std::span<const Eigen::Vector3d> extent, size_t max_size) {
    double low = INFINITY, high = -INFINITY;
    for (const Eigen::Vector3d& X : extent) {
      low = std::min(low, X.x());
      high = std::max(high, X.x());
    }
    const double rig_size = static_cast<double>(cameras_.sensor_from_rig.size());
    const double first_frame = std::max(0.0, (high - kCorridorMaxDepth) / kCorridorSpacing);
    const double last_frame = std::max(0.0, (low - kCorridorMinDepth) / kCorridorSpacing);
    scratch_.clear();
    const size_t end = std::min(all_.size(), static_cast<size_t>((last_frame + 1.0) * rig_size));
    for (size_t i = static_cast<size_t>(first_frame) * cameras_.sensor_from_rig.size(); i < end;
         ++i) {
      if (Sees(static_cast<uint32_t>(i), extent)) scratch_.push_back(static_cast<uint32_t>(i));
    }
    HOLBA_CHECK_MSG(scratch_.size() >= kMaxTrackLength,
                    "too few images see a part of the corridor");
    const size_t size = std::min(max_size, scratch_.size());
    return Pool(scratch_).subspan(random_.Index(scratch_.size() - size + 1), size);
  }

  // Adds images of the pool that see the extent until the track has `length`, then sorts it.
  void Draw(Pool pool, size_t length, std::span<const Eigen::Vector3d> extent,
            std::vector<uint32_t>* track) {
    if (length > pool.size()) {
      throw InputError("--num_images: a feature is to be seen by " + std::to_string(length) +
                       " images, but fewer can see it; use more images");
    }
    // A pool of just the wanted size (near visibility) is taken whole.
    size_t attempts = 0;
    while (track->size() < length) {
      const uint32_t image = pool[random_.Index(pool.size())];
      HOLBA_CHECK_MSG(++attempts < 100000, "a feature is not seen by enough cameras");
      if (std::find(track->begin(), track->end(), image) != track->end()) continue;
      if (Sees(image, extent)) track->push_back(image);
    }
    std::sort(track->begin(), track->end());
  }

  const SyntheticCameras& cameras_;
  const SceneLayout layout_;
  const bool is_near_;
  Random& random_;
  std::vector<uint32_t> all_, scratch_;
  std::vector<std::vector<uint32_t>> nearest_;
};

}  // namespace

SyntheticTracks MakeTracks(const SyntheticCameras& cameras, const SyntheticStructure& structure,
                           SceneLayout layout, Visibility visibility, Random* random) {
  TrackMaker maker(cameras, layout, visibility, random);
  SyntheticTracks tracks;
  tracks.lines.resize(structure.segments.size());
  for (size_t line = 0; line < tracks.lines.size(); ++line) {
    const int plane = structure.plane_of_line[line];
    if (plane < 0) {
      tracks.lines[line] = maker.Track(structure.segments[line]);
      continue;
    }
    const std::vector<uint32_t>& members = structure.groups[plane].lines;
    if (line != members.front()) continue;  // made together with the first one
    std::vector<Eigen::Vector3d> extent;
    for (const uint32_t member : members) {
      const Segment3d& segment = structure.segments[member];
      extent.insert(extent.end(), segment.begin(), segment.end());
    }
    auto shared = maker.SharedTracks(extent, members.size());
    for (size_t k = 0; k < members.size(); ++k) tracks.lines[members[k]] = std::move(shared[k]);
  }
  // A junction is seen from where its line is seen.
  std::vector<Pool> beside(structure.points.size());
  for (const SyntheticEdge& edge : structure.edges) {
    if (beside[edge.point].empty()) beside[edge.point] = tracks.lines[edge.line];
  }
  for (size_t p = 0; p < structure.points.size(); ++p) {
    tracks.points.push_back(maker.Track({&structure.points[p], 1}, beside[p]));
  }
  return tracks;
}

}  // namespace holba
