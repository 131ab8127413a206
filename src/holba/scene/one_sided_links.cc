// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/one_sided_links.h"

#include <fmt/format.h>

#include <algorithm>
#include <type_traits>
#include <unordered_map>
#include <utility>

namespace holba {
namespace {

constexpr size_t kNoIndex = static_cast<size_t>(-1);

// The kinds of features that are linked: how they are called, what the two ends are.
struct PointLinks {
  static constexpr const char* kName2d = "point";
  static constexpr const char* kName3d = "3D point";
  static auto& Map(Reconstruction& model) { return model.points3D; }
  static auto& Track(Point3D& point) { return point.track; }
  static auto& Features(Image& image) { return image.points2D; }
  static uint64_t& Named(Point2D& point) { return point.point3D_id; }
  static uint32_t& Idx(PointObservation& observation) { return observation.point2D_idx; }
};
struct LineLinks {
  static constexpr const char* kName2d = "line";
  static constexpr const char* kName3d = "3D line";
  static auto& Map(Reconstruction& model) { return model.lines3D; }
  static auto& Track(Line3D& line) { return line.track; }
  static auto& Features(Image& image) { return image.lines2D; }
  static uint64_t& Named(Line2D& line) { return line.line3D_id; }
  static uint32_t& Idx(LineObservation& observation) { return observation.line2D_idx; }
};
struct GroupLinks {
  static constexpr const char* kName2d = "group";
  static constexpr const char* kName3d = "3D group";
  static auto& Map(Reconstruction& model) { return model.groups3D; }
  static auto& Track(Group3D& group) { return group.observations; }
  static auto& Features(Image& image) { return image.groups2D; }
  static uint64_t& Named(Group2D& group) { return group.group3D_id; }
  static uint32_t& Idx(GroupObservation& observation) { return observation.group2D_idx; }
};

template <typename Links>
class Sweep {
 public:
  Sweep(bool with_list, Reconstruction* model, OneSidedLinks* found)
      : with_list_(with_list), model_(*model), found_(*found) {}

  void Run() {
    linked_.resize(model_.images.size());
    for (size_t i = 0; i < linked_.size(); ++i) linked_[i].resize(FeaturesOf(i).size());
    std::vector<uint64_t> faulty;  // 3D features whose track has elements that are not sound
    for (auto& [id, value] : Links::Map(model_)) {
      size_t num_unsound = 0;
      for (auto& element : Links::Track(value)) num_unsound += MarkIfSound(id, element) ? 0 : 1;
      if (num_unsound > 0) faulty.push_back(id);
      found_.num_sound += Links::Track(value).size() - num_unsound;
    }
    if (!faulty.empty()) MendTracks(faulty);
    DropBackReferences();
  }

 private:
  auto& FeaturesOf(size_t image_idx) {
    return Links::Features(
        (model_.images.begin() + static_cast<std::ptrdiff_t>(image_idx))->second);
  }
  size_t IndexOfImage(image_t image_id) const {
    return model_.images.contains(image_id) ? model_.images.IndexOf(image_id) : kNoIndex;
  }

  // Whether both ends know the link, and no element before this one was the same.
  template <typename Element>
  bool MarkIfSound(uint64_t id, Element& element) {
    const size_t image_idx = IndexOfImage(element.image_id);
    if (image_idx == kNoIndex) return false;
    auto& features = FeaturesOf(image_idx);
    const uint32_t idx = Links::Idx(element);
    if (idx >= features.size() || Links::Named(features[idx]) != id || linked_[image_idx][idx]) {
      return false;
    }
    linked_[image_idx][idx] = true;
    return true;
  }

  // For each image and 3D feature the one 2D feature that names it and is in no track (kNoIndex:
  // there are several).
  void FindUnlinked() {
    unlinked_.resize(linked_.size());
    for (size_t i = 0; i < linked_.size(); ++i) {
      auto& features = FeaturesOf(i);
      for (size_t idx = 0; idx < features.size(); ++idx) {
        const uint64_t id = Links::Named(features[idx]);
        if (id == kNoId || linked_[i][idx]) continue;
        const auto [it, is_new] = unlinked_[i].emplace(id, idx);
        if (!is_new) it->second = kNoIndex;
      }
    }
  }

  void MendTracks(const std::vector<uint64_t>& faulty) {
    FindUnlinked();
    for (const uint64_t id : faulty) {
      auto& track = Links::Track(Links::Map(model_).at(id));
      std::remove_reference_t<decltype(track)> kept;
      kept.reserve(track.size());
      std::vector<std::pair<size_t, uint32_t>> sound;  // elements that were met
      for (auto& element : track) {
        const size_t image_idx = IndexOfImage(element.image_id);
        const uint32_t idx = Links::Idx(element);
        const std::string text = fmt::format("{} {} names {} {} of image {}", Links::kName3d, id,
                                             Links::kName2d, idx, element.image_id);
        if (image_idx == kNoIndex) {
          Drop("3D features that name a missing image",
               fmt::format("{}, which is not in the model", text));
          continue;
        }
        auto& features = FeaturesOf(image_idx);
        const uint64_t named = idx < features.size() ? Links::Named(features[idx]) : kNoId;
        if (named == id) {
          const std::pair<size_t, uint32_t> link{image_idx, idx};
          if (std::find(sound.begin(), sound.end(), link) == sound.end()) {
            sound.push_back(link);
            kept.push_back(element);
          } else {
            Drop("3D features that name a 2D feature twice", text + " twice");
          }
          continue;
        }
        const std::string fault =
            idx >= features.size() ? fmt::format(", which has {} of them", features.size())
            : named == kNoId       ? fmt::format(", which names no {}", Links::kName3d)
                                   : fmt::format(", which names {} {}", Links::kName3d, named);
        const auto other = unlinked_[image_idx].find(id);
        if (other != unlinked_[image_idx].end() && other->second != kNoIndex) {
          Links::Idx(element) = static_cast<uint32_t>(other->second);
          linked_[image_idx][other->second] = true;
          unlinked_[image_idx].erase(other);
          kept.push_back(element);
          ++found_.num_corrected;
          if (with_list_)
            found_.list.push_back(fmt::format("{}{}; {} {} names it", text, fault, Links::kName2d,
                                              Links::Idx(element)));
        } else {
          Drop("3D features that name a 2D feature that does not name them", text + fault);
        }
      }
      track = std::move(kept);
    }
  }

  void DropBackReferences() {
    for (size_t i = 0; i < linked_.size(); ++i) {
      auto& features = FeaturesOf(i);
      for (size_t idx = 0; idx < features.size(); ++idx) {
        uint64_t& id = Links::Named(features[idx]);
        if (id == kNoId || linked_[i][idx]) continue;
        const bool exists = Links::Map(model_).contains(id);
        Drop(exists ? "2D features that name a 3D feature that does not name them"
                    : "2D features that name a missing 3D feature",
             fmt::format("{} {} of image {} names {} {}, which {}", Links::kName2d, idx,
                         (model_.images.begin() + static_cast<std::ptrdiff_t>(i))->first,
                         Links::kName3d, id,
                         exists ? "does not name it back" : "is not in the model"));
        id = kNoId;
      }
    }
  }

  void Drop(const char* reason, std::string text) {
    ++found_.dropped[reason];
    if (with_list_) found_.list.push_back(std::move(text));
  }

  const bool with_list_;
  Reconstruction& model_;
  OneSidedLinks& found_;
  std::vector<std::vector<bool>> linked_;  // by position of the image and index of the 2D feature
  std::vector<std::unordered_map<uint64_t, size_t>> unlinked_;
};

}  // namespace

size_t OneSidedLinks::NumDropped() const {
  size_t sum = 0;
  for (const auto& [reason, count] : dropped) sum += count;
  return sum;
}

OneSidedLinks DropOneSidedLinks(bool with_list, Reconstruction* model) {
  OneSidedLinks found;
  Sweep<PointLinks>(with_list, model, &found).Run();
  Sweep<LineLinks>(with_list, model, &found).Run();
  Sweep<GroupLinks>(with_list, model, &found).Run();
  return found;
}

}  // namespace holba
