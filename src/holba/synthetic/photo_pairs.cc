// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/photo_pairs.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>

#include "holba/base/error.h"
#include "holba/base/random.h"
#include "holba/geometry/angle.h"
#include "holba/synthetic/random_streams.h"

namespace holba {
namespace {

// Images of a sequence that are so much later see the same place again.
constexpr uint32_t kLaterVisit = 50;
// Matches that a pair of a part and its copy has at least: fewer would not be verified often.
constexpr size_t kMinMatchesOfWrongPair = 20;

// A match that could be, of a pair of views.
struct Candidate {
  uint64_t pair = 0;  // view1 * number of views + view2
  std::array<uint32_t, 2> match{};
  friend auto operator<=>(const Candidate&, const Candidate&) = default;
};

// Candidates pair by pair.
struct PairCandidates {
  uint32_t view1 = 0, view2 = 0;
  std::span<const Candidate> points, lines;
};

// Whole numbers that add up to a share of all that was counted, up to rounding, at any time.
class Diffusion {
 public:
  explicit Diffusion(double share) : share_(share) {}
  // How many of `count` further ones.
  size_t Next(double count) {
    total_ += share_ * count;
    const auto next = static_cast<size_t>(std::max(0.0, std::round(total_) - taken_));
    taken_ += static_cast<double>(next);
    return next;
  }
  // Some of the last ones could not be had: they are asked for again.
  void GiveBack(size_t count) { taken_ -= static_cast<double>(count); }
  double Owed() const { return std::round(total_) - taken_; }

 private:
  double share_;
  double total_ = 0.0, taken_ = 0.0;
};

// `count` random ones of `items` are taken out; the order of the others stays.
template <typename Item>
void RemoveRandom(size_t count, Random* random, std::vector<Item>* items) {
  std::vector<bool> gone(items->size());
  for (size_t left = count; left > 0;) {
    const size_t i = random->Index(items->size());
    if (gone[i]) continue;
    gone[i] = true;
    --left;
  }
  size_t to = 0;
  for (size_t i = 0; i < items->size(); ++i) {
    if (!gone[i]) (*items)[to++] = (*items)[i];
  }
  items->resize(to);
}

class PairMaker {
 public:
  PairMaker(const PhotoSetOptions& options, const PhotoScene& scene, const FoundFeatures& found,
            const std::vector<PhotoSetImage>& images)
      : options_(options),
        scene_(scene),
        found_(found),
        images_(images),
        likeness_(scene, options.max_match_angle_deg, options.max_match_scale),
        random_(StreamOf(options.seed, 501)),
        missing_points_(options.missing_matches),
        missing_lines_(options.missing_matches),
        wrong_points_(Odds(options.wrong_matches)),
        wrong_lines_(Odds(options.wrong_line_matches)),
        rejected_(Odds(options.rejected_matches)) {
    for (size_t view = 0; view < images.size(); ++view) {
      const Camera& camera = scene.cameras[scene.camera_of_view[view]];
      std::vector<Eigen::Vector2d>& ideal = ideal_.emplace_back();
      for (size_t k = 0; k < images[view].keypoints.size(); ++k) {
        const auto at =
            IdealPixel(*camera.model, camera.params.data(), images[view].keypoints.Position(k));
        ideal.push_back(at.value_or(Eigen::Vector2d::Constant(-1e9)));
      }
      const IdealCalibration k = camera.model->ideal_calibration(camera.params.data());
      K_.push_back((Eigen::Matrix3d() << k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1).finished());
    }
  }

  std::vector<PhotoSetPair> Make() {
    point_of_ = FeaturesOf(found_.points, [](const auto& image) { return image.keypoints.size(); });
    line_of_ = FeaturesOf(found_.lines, [](const auto& image) { return image.segments.size(); });
    const std::vector<Candidate> points =
        SharedFeatures(found_.points, [&](size_t i) { return scene_.content.structure.points[i]; });
    const std::vector<Candidate> lines = SharedFeatures(found_.lines, [&](size_t i) {
      const Segment3d& s = scene_.content.structure.segments[i];
      return Eigen::Vector3d(0.5 * (s[0] + s[1]));
    });
    const std::vector<PairCandidates> right = ByPair(points, lines);
    for (const PairCandidates& pair : Chosen(right)) AddPair(pair, nullptr);
    const size_t num_right = pairs_.size();
    AddWrongPairs(right, num_right);
    if (wrong_points_.Owed() > 0.5) {
      throw InputError(fmt::format(
          "--Database.wrong_matches: expected a share for which the images have enough other "
          "keypoints near the epipolar lines, found {}; use more --Database.points_per_image",
          options_.wrong_matches));
    }
    if (wrong_lines_.Owed() > 0.5) {
      throw InputError(fmt::format(
          "--Database.wrong_line_matches: expected a share for which the images have enough other "
          "segments, found {}; use a smaller one",
          options_.wrong_line_matches));
    }
    std::sort(pairs_.begin(), pairs_.end(), [](const PhotoSetPair& a, const PhotoSetPair& b) {
      return std::pair(a.image_id1, a.image_id2) < std::pair(b.image_id1, b.image_id2);
    });
    return std::move(pairs_);
  }

 private:
  // Wrong ones for each right one.
  static double Odds(double share) { return share / (1.0 - share); }
  uint64_t PairOf(uint32_t view1, uint32_t view2) const {
    return static_cast<uint64_t>(view1) * images_.size() + view2;
  }

  template <typename Place>
  std::vector<Candidate> SharedFeatures(const std::vector<std::vector<FoundFeature>>& tracks,
                                        const Place& place) const {
    std::vector<Candidate> candidates;
    const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
    for (size_t i = 0; i < tracks.size(); ++i) {
      const Eigen::Vector3d X = place(i);
      for (size_t a = 0; a < tracks[i].size(); ++a) {
        for (size_t b = a + 1; b < tracks[i].size(); ++b) {
          const FoundFeature &first = tracks[i][a], &second = tracks[i][b];
          if (likeness_.LookAlike(first.view, X, second.view, X, identity))
            candidates.push_back({PairOf(first.view, second.view), {first.idx, second.idx}});
        }
      }
    }
    std::sort(candidates.begin(), candidates.end());
    return candidates;
  }

  // Pairs with enough points.
  std::vector<PairCandidates> ByPair(std::span<const Candidate> points,
                                     std::span<const Candidate> lines) const {
    std::vector<PairCandidates> pairs;
    size_t line = 0;
    for (size_t begin = 0; begin < points.size();) {
      const uint64_t pair = points[begin].pair;
      size_t end = begin;
      while (end < points.size() && points[end].pair == pair) ++end;
      while (line < lines.size() && lines[line].pair < pair) ++line;
      size_t line_end = line;
      while (line_end < lines.size() && lines[line_end].pair == pair) ++line_end;
      if (NumAfterMissing(end - begin) >= static_cast<size_t>(options_.min_num_matches)) {
        pairs.push_back({static_cast<uint32_t>(pair / images_.size()),
                         static_cast<uint32_t>(pair % images_.size()),
                         points.subspan(begin, end - begin), lines.subspan(line, line_end - line)});
      }
      begin = end;
    }
    return pairs;
  }

  // At least, whatever the diffusion adds.
  size_t NumAfterMissing(size_t count) const {
    const double left = static_cast<double>(count) * (1.0 - options_.missing_matches);
    return static_cast<size_t>(std::max(0.0, std::floor(left) - 1.0));
  }

  std::vector<PairCandidates> Chosen(const std::vector<PairCandidates>& pairs) const {
    // Pairs of every image that others than its neighbours have, those with most points first.
    std::vector<std::vector<size_t>> of_image(images_.size());
    std::vector<bool> is_chosen(pairs.size());
    for (size_t k = 0; k < pairs.size(); ++k) {
      const uint32_t apart = pairs[k].view2 - pairs[k].view1;
      if (scene_.is_sequence) {
        is_chosen[k] = apart <= static_cast<uint32_t>(options_.sequential_overlap);
        if (apart < kLaterVisit) continue;
      }
      of_image[pairs[k].view1].push_back(k);
      of_image[pairs[k].view2].push_back(k);
    }
    for (std::vector<size_t>& list : of_image) {
      std::stable_sort(list.begin(), list.end(), [&](size_t a, size_t b) {
        return pairs[a].points.size() > pairs[b].points.size();
      });
      const size_t most = static_cast<size_t>(options_.max_pairs_per_image);
      if (list.size() > most) list.resize(most);
      for (const size_t k : list) is_chosen[k] = true;
    }
    std::vector<PairCandidates> chosen;
    for (size_t k = 0; k < pairs.size(); ++k) {
      if (is_chosen[k]) chosen.push_back(pairs[k]);
    }
    return chosen;
  }

  // copy_from_original: of a wrong pair; null: a right one.
  void AddPair(const PairCandidates& candidates, const Rigid3d* copy_from_original) {
    PhotoSetPair& pair = pairs_.emplace_back();
    pair.image_id1 = candidates.view1 + 1;
    pair.image_id2 = candidates.view2 + 1;
    pair.is_wrong = copy_from_original != nullptr;
    const Rigid3d& pose1 = scene_.cam_from_world[candidates.view1];
    const Rigid3d& pose2 = scene_.cam_from_world[candidates.view2];
    pair.cam2_from_cam1 = (pair.is_wrong ? pose2 * *copy_from_original : pose2) * pose1.Inverse();

    for (const Candidate& c : candidates.points) pair.matches.push_back(c.match);
    RemoveRandom(missing_points_.Next(static_cast<double>(pair.matches.size())), &random_,
                 &pair.matches);
    std::vector<std::array<uint32_t, 2>> lines;
    for (const Candidate& c : candidates.lines) lines.push_back(c.match);
    RemoveRandom(missing_lines_.Next(static_cast<double>(lines.size())), &random_, &lines);
    const size_t num_right = pair.matches.size();
    // The matches of a wrong pair are wrong already.
    if (!pair.is_wrong) AddWrongMatches(&pair);
    SortWithFlags(num_right, &pair.matches, &pair.is_wrong_match);
    AddRejected(&pair);
    AddLineMatches(candidates, lines, &pair);
  }

  template <typename Match>
  static void SortWithFlags(size_t num_right, std::vector<Match>* matches,
                            std::vector<bool>* is_wrong) {
    std::vector<std::pair<Match, bool>> all;
    for (size_t i = 0; i < matches->size(); ++i) all.emplace_back((*matches)[i], i >= num_right);
    std::sort(all.begin(), all.end(),
              [](const auto& a, const auto& b) { return Key(a.first) < Key(b.first); });
    is_wrong->clear();
    for (size_t i = 0; i < all.size(); ++i) {
      (*matches)[i] = all[i].first;
      is_wrong->push_back(all[i].second);
    }
  }
  static std::pair<uint32_t, uint32_t> Key(const std::array<uint32_t, 2>& match) {
    return {match[0], match[1]};
  }
  static std::pair<uint32_t, uint32_t> Key(const LineMatch& match) {
    return {match.idx1, match.idx2};
  }

  // Keypoints of both images that no match has yet.
  struct Free {
    std::vector<bool> taken1, taken2;
  };
  Free FreeOf(const PhotoSetPair& pair) const {
    Free free{std::vector<bool>(images_[pair.image_id1 - 1].keypoints.size()),
              std::vector<bool>(images_[pair.image_id2 - 1].keypoints.size())};
    for (const auto& [idx1, idx2] : pair.matches) free.taken1[idx1] = free.taken2[idx2] = true;
    return free;
  }

  // A free keypoint of the second image near the epipolar line of keypoint idx1, in front of both
  // cameras. Empty: there is none.
  std::optional<uint32_t> NearEpipolarLine(const PhotoSetPair& pair, const Eigen::Matrix3d& F,
                                           uint32_t idx1, const Free& free) {
    const uint32_t view1 = pair.image_id1 - 1, view2 = pair.image_id2 - 1;
    const Eigen::Vector3d x1 = ideal_[view1][idx1].homogeneous();
    Eigen::Vector3d line = F * x1;
    const double norm = line.head<2>().norm();
    if (!(norm > 0.0)) return std::nullopt;
    line /= norm;
    near_.clear();
    const Eigen::Vector3d ray1 =
        pair.cam2_from_cam1.rotation * (K_[view1].inverse() * x1).normalized();
    const Eigen::Vector3d& t = pair.cam2_from_cam1.translation;
    for (uint32_t idx2 = 0; idx2 < ideal_[view2].size(); ++idx2) {
      if (free.taken2[idx2]) continue;
      const Eigen::Vector3d x2 = ideal_[view2][idx2].homogeneous();
      if (!(std::abs(line.dot(x2)) < kWrongMatchMaxErrorPx)) continue;
      // Depths a, b of a ray1 + t ~ b ray2.
      const Eigen::Vector3d ray2 = (K_[view2].inverse() * x2).normalized();
      const double c = ray1.dot(ray2), det = 1.0 - c * c;
      const double a = (-ray1.dot(t) + c * ray2.dot(t)) / det;
      const double b = (ray2.dot(t) - c * ray1.dot(t)) / det;
      if (det > 1e-6 && a > 0.0 && b > 0.0) near_.push_back(idx2);
    }
    if (near_.empty()) return std::nullopt;
    return near_[random_.Index(near_.size())];
  }

  void AddWrongMatches(PhotoSetPair* pair) {
    const size_t wanted = wrong_points_.Next(static_cast<double>(pair->matches.size()));
    if (wanted == 0) return;
    const uint32_t view1 = pair->image_id1 - 1, view2 = pair->image_id2 - 1;
    const Eigen::Vector3d& t = pair->cam2_from_cam1.translation;
    const Eigen::Matrix3d F = K_[view2].inverse().transpose() * CrossMatrix<double>(t) *
                              pair->cam2_from_cam1.RotationMatrix() * K_[view1].inverse();
    Free free = FreeOf(*pair);
    size_t num_found = 0;
    for (size_t tries = 0; tries < 10 * wanted && num_found < wanted; ++tries) {
      const auto idx1 = static_cast<uint32_t>(random_.Index(free.taken1.size()));
      if (free.taken1[idx1]) continue;
      const auto idx2 = NearEpipolarLine(*pair, F, idx1, free);
      // Nothing is wrong with a right match that is missing.
      if (!idx2 || AreOne(point_of_, view1, idx1, view2, *idx2)) continue;
      pair->matches.push_back({idx1, *idx2});
      free.taken1[idx1] = free.taken2[*idx2] = true;
      ++num_found;
    }
    wrong_points_.GiveBack(wanted - num_found);
  }

  // The feature of each keypoint (segment) of each view; kInvalidId32: none.
  template <typename Count>
  std::vector<std::vector<uint32_t>> FeaturesOf(
      const std::vector<std::vector<FoundFeature>>& tracks, const Count& count) const {
    std::vector<std::vector<uint32_t>> features;
    for (const PhotoSetImage& image : images_) features.emplace_back(count(image), kInvalidId32);
    for (size_t i = 0; i < tracks.size(); ++i) {
      for (const FoundFeature& f : tracks[i]) features[f.view][f.idx] = static_cast<uint32_t>(i);
    }
    return features;
  }
  // Whether two keypoints (segments) are of one feature.
  static bool AreOne(const std::vector<std::vector<uint32_t>>& features, uint32_t view1,
                     uint32_t idx1, uint32_t view2, uint32_t idx2) {
    const uint32_t feature = features[view1][idx1];
    return feature != kInvalidId32 && feature == features[view2][idx2];
  }

  void AddRejected(PhotoSetPair* pair) {
    pair->raw_matches = pair->matches;
    const size_t wanted = rejected_.Next(static_cast<double>(pair->matches.size()));
    Free free = FreeOf(*pair);
    for (size_t k = 0; k < wanted; ++k) {
      const auto idx1 = static_cast<uint32_t>(random_.Index(free.taken1.size()));
      const auto idx2 = static_cast<uint32_t>(random_.Index(free.taken2.size()));
      if (free.taken1[idx1] || free.taken2[idx2]) continue;
      free.taken1[idx1] = free.taken2[idx2] = true;
      pair->raw_matches.push_back({idx1, idx2});
    }
    std::sort(pair->raw_matches.begin(), pair->raw_matches.end());
  }

  // Distances of descriptors: right ones are smaller in the mean, but not always.
  void AddLineMatches(const PairCandidates& candidates,
                      const std::vector<std::array<uint32_t, 2>>& right, PhotoSetPair* pair) {
    const auto distance = [&](double mean) {
      return static_cast<float>(std::clamp(mean + random_.Normal(0.1), 0.02, 1.4));
    };
    for (const auto& match : right)
      pair->line_matches.push_back({match[0], match[1], distance(0.3)});
    const std::vector<LineSegment2d>& segments1 = images_[candidates.view1].segments;
    const std::vector<LineSegment2d>& segments2 = images_[candidates.view2].segments;
    const size_t wanted = wrong_lines_.Next(static_cast<double>(right.size()));
    size_t num_found = 0;
    const double min_cosine = std::cos(DegToRad(20.0));
    const size_t max_tries = segments1.empty() || segments2.empty() ? 0 : 50 * wanted;
    for (size_t tries = 0; tries < max_tries && num_found < wanted; ++tries) {
      const auto idx1 = static_cast<uint32_t>(random_.Index(segments1.size()));
      const auto idx2 = static_cast<uint32_t>(random_.Index(segments2.size()));
      const Eigen::Vector2d d1 = segments1[idx1].end - segments1[idx1].start;
      const Eigen::Vector2d d2 = segments2[idx2].end - segments2[idx2].start;
      if (d1.dot(d2) < min_cosine * d1.norm() * d2.norm()) continue;
      const bool is_there =
          std::any_of(pair->line_matches.begin(), pair->line_matches.end(),
                      [&](const LineMatch& m) { return m.idx1 == idx1 && m.idx2 == idx2; });
      if (is_there || AreOne(line_of_, candidates.view1, idx1, candidates.view2, idx2)) continue;
      pair->line_matches.push_back({idx1, idx2, distance(0.45)});
      ++num_found;
    }
    wrong_lines_.GiveBack(wanted - num_found);
    SortWithFlags(right.size(), &pair->line_matches, &pair->is_wrong_line_match);
  }

  void AddWrongPairs(const std::vector<PairCandidates>& right, size_t num_right) {
    const auto wanted = static_cast<size_t>(
        std::round(Odds(options_.wrong_pairs) * static_cast<double>(num_right)));
    if (wanted == 0) return;
    std::vector<uint64_t> seen_together;
    for (const PairCandidates& pair : right)
      seen_together.push_back(PairOf(pair.view1, pair.view2));
    struct WrongPair {
      uint64_t pair = 0;
      size_t copy = 0;
      std::vector<Candidate> points, lines;
    };
    std::vector<WrongPair> candidates;
    for (size_t c = 0; c < scene_.copies.size(); ++c) {
      // By ordered pair of views: of the original first or of the copy first.
      std::unordered_map<uint64_t, WrongPair> by_pair[2];
      CollectCopies(scene_.copies[c], [&](bool is_line, uint32_t view1, uint32_t view2, bool turned,
                                          const std::array<uint32_t, 2>& match) {
        WrongPair& entry = by_pair[turned][PairOf(view1, view2)];
        entry.pair = PairOf(view1, view2);
        entry.copy = c;
        (is_line ? entry.lines : entry.points).push_back({entry.pair, match});
      });
      for (const bool turned : {false, true}) {
        for (auto& [pair, entry] : by_pair[turned]) {
          if (NumAfterMissing(entry.points.size()) < kMinMatchesOfWrongPair) continue;
          if (std::binary_search(seen_together.begin(), seen_together.end(), pair)) continue;
          entry.copy = 2 * c + turned;
          candidates.push_back(std::move(entry));
        }
      }
    }
    // Of the copies that a pair could be taken for, the one with most matches.
    std::sort(candidates.begin(), candidates.end(), [](const WrongPair& a, const WrongPair& b) {
      if (a.pair != b.pair) return a.pair < b.pair;
      if (a.points.size() != b.points.size()) return a.points.size() > b.points.size();
      return a.copy < b.copy;
    });
    candidates.erase(std::unique(candidates.begin(), candidates.end(),
                                 [](const auto& a, const auto& b) { return a.pair == b.pair; }),
                     candidates.end());
    if (candidates.size() < wanted) {
      const auto most = static_cast<double>(candidates.size());
      throw InputError(fmt::format(
          "--Database.wrong_pairs: expected at most {:.4f}, the share of pairs of this scene that "
          "see a part and its copy, found {}",
          most / (most + static_cast<double>(num_right)), options_.wrong_pairs));
    }
    RemoveRandom(candidates.size() - wanted, &random_, &candidates);
    for (WrongPair& wrong : candidates) {
      std::sort(wrong.points.begin(), wrong.points.end());
      std::sort(wrong.lines.begin(), wrong.lines.end());
      const SceneCopy& copy = scene_.copies[wrong.copy / 2];
      const bool turned = wrong.copy % 2 == 1;
      const Rigid3d transform =
          turned ? copy.copy_from_original.Inverse() : copy.copy_from_original;
      AddPair({static_cast<uint32_t>(wrong.pair / images_.size()),
               static_cast<uint32_t>(wrong.pair % images_.size()), wrong.points, wrong.lines},
              &transform);
    }
  }

  // Calls add(is_line, view1, view2, turned, match) for each feature of the original in one view
  // and of the copy in another that look alike; turned: the copy is in the first view.
  template <typename Add>
  void CollectCopies(const SceneCopy& copy, const Add& add) const {
    const SyntheticStructure& structure = scene_.content.structure;
    const Eigen::Matrix3d turn = copy.copy_from_original.RotationMatrix();
    const auto collect = [&](bool is_line, const std::vector<FoundFeature>& original,
                             const std::vector<FoundFeature>& of_copy, const Eigen::Vector3d& X,
                             const Eigen::Vector3d& X_of_copy) {
      for (const FoundFeature& a : original) {
        for (const FoundFeature& b : of_copy) {
          if (a.view == b.view) continue;
          if (!likeness_.LookAlike(a.view, X, b.view, X_of_copy, turn)) continue;
          const bool turned = a.view > b.view;
          turned ? add(is_line, b.view, a.view, true, std::array{b.idx, a.idx})
                 : add(is_line, a.view, b.view, false, std::array{a.idx, b.idx});
        }
      }
    };
    for (uint32_t k = 0; k < copy.num_points; ++k) {
      const uint32_t a = copy.first_point + k, b = copy.first_point_of_copy + k;
      collect(false, found_.points[a], found_.points[b], structure.points[a], structure.points[b]);
    }
    for (uint32_t k = 0; k < copy.num_lines; ++k) {
      const uint32_t a = copy.first_line + k, b = copy.first_line_of_copy + k;
      const auto middle = [&](uint32_t line) {
        const Segment3d& s = structure.segments[line];
        return Eigen::Vector3d(0.5 * (s[0] + s[1]));
      };
      collect(true, found_.lines[a], found_.lines[b], middle(a), middle(b));
    }
  }

  const PhotoSetOptions& options_;
  const PhotoScene& scene_;
  const FoundFeatures& found_;
  const std::vector<PhotoSetImage>& images_;
  const Likeness likeness_;
  Random random_;
  Diffusion missing_points_, missing_lines_, wrong_points_, wrong_lines_, rejected_;
  std::vector<std::vector<Eigen::Vector2d>> ideal_;        // of keypoints, by view
  std::vector<Eigen::Matrix3d> K_;                         // of ideal pixels, by view
  std::vector<std::vector<uint32_t>> point_of_, line_of_;  // by view and keypoint, segment
  std::vector<uint32_t> near_;
  std::vector<PhotoSetPair> pairs_;
};

}  // namespace

std::vector<PhotoSetPair> MakePairs(const PhotoSetOptions& options, const PhotoScene& scene,
                                    const FoundFeatures& found,
                                    const std::vector<PhotoSetImage>& images) {
  return PairMaker(options, scene, found, images).Make();
}

}  // namespace holba
