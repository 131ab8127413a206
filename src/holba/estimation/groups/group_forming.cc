// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/group_forming.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>
#include <unordered_map>
#include <vector>

#include "holba/estimation/groups/group_estimation.h"
#include "holba/geometry/angle.h"
#include "holba/robust/median.h"

namespace holba {
namespace {

// A region with its triangulated features, ascending.
struct Region {
  GroupObservation place;
  const GroupType* type;
  std::vector<point3D_t> points;
  std::vector<line3D_t> lines;
  size_t size() const { return points.size() + lines.size(); }
};

template <typename T>
void SortUnique(std::vector<T>* values) {
  std::sort(values->begin(), values->end());
  values->erase(std::unique(values->begin(), values->end()), values->end());
}

// Of two ascending lists.
template <typename T>
size_t NumCommon(const std::vector<T>& a, const std::vector<T>& b) {
  return static_cast<size_t>(std::count_if(
      a.begin(), a.end(), [&b](T value) { return std::binary_search(b.begin(), b.end(), value); }));
}

class GroupFormer {
 public:
  GroupFormer(const GroupFormingOptions& options, const GroupNormals& normals,
              Reconstruction* model)
      : options_(options), normals_(normals), model_(*model), lookup_(*model) {
    for (auto& [image_id, image] : model_.images) {
      for (group2D_t k = 0; k < image.groups2D.size(); ++k) {
        const Group2D& group = image.groups2D[k];
        Region region{{image_id, k}, group.type, {}, {}};
        for (const point2D_t idx : group.point2D_idxs) {
          const point3D_t id = image.points2D[idx].point3D_id;
          if (id != kNoId && lookup_.Point(id)) region.points.push_back(id);
        }
        for (const line2D_t idx : group.line2D_idxs) {
          const line3D_t id = image.lines2D[idx].line3D_id;
          if (id != kNoId && lookup_.Line(id)) region.lines.push_back(id);
        }
        SortUnique(&region.points);
        SortUnique(&region.lines);
        index_[{image_id, k}] = regions_.size();
        regions_.push_back(std::move(region));
      }
    }
  }

  GroupFormingReport Run(std::span<const GroupObservationPair> matches) {
    for (size_t r = 0; r < regions_.size(); ++r) report_.observations += IsFree(r);
    CountShared(matches);
    JoinKnown();
    FormNew();
    JoinKnown();
    Merge();
    for (size_t r = 0; r < regions_.size(); ++r) {
      if (!IsFree(r)) continue;
      ++report_.dropped[Name(r) + " region: " +
                        (regions_[r].size() == 0 ? "no triangulated features" : "no group")];
    }
    return std::move(report_);
  }

 private:
  std::string Name(size_t r) const { return std::string(regions_[r].type->name); }
  Group2D& InImage(size_t r) {
    const GroupObservation& o = regions_[r].place;
    return model_.images.at(o.image_id).groups2D[o.group2D_idx];
  }
  bool IsFree(size_t r) { return InImage(r).group3D_id == kNoId; }

  // Pairs of regions of one type in different images, with the number of features that both have.
  void CountShared(std::span<const GroupObservationPair> matches) {
    std::unordered_map<uint64_t, std::vector<size_t>> by_point, by_line;
    for (size_t r = 0; r < regions_.size(); ++r) {
      const auto visit = [&](auto& index, uint64_t id) {
        std::vector<size_t>& others = index[id];
        for (const size_t other : others) {
          if (regions_[other].type == regions_[r].type &&
              regions_[other].place.image_id != regions_[r].place.image_id) {
            ++shared_[{other, r}];
          }
        }
        others.push_back(r);
      };
      for (const point3D_t id : regions_[r].points) visit(by_point, id);
      for (const line3D_t id : regions_[r].lines) visit(by_line, id);
    }
    for (const auto& [first, second] : matches) {
      const auto a = index_.find({first.image_id, first.group2D_idx});
      const auto b = index_.find({second.image_id, second.group2D_idx});
      if (a == index_.end() || b == index_.end()) {
        ++report_.dropped["match: unknown region"];
      } else if (regions_[a->second].type != regions_[b->second].type) {
        ++report_.dropped["match: different types"];
      } else if (a->second != b->second) {
        matched_.insert(std::minmax(a->second, b->second));
      }
    }
  }

  // Whether the normal that was seen in the region, if one was, allows the plane.
  bool AgreesWithNormal(size_t r, const GroupType& type, const double* g) {
    const auto it = normals_.find({regions_[r].place.image_id, regions_[r].place.group2D_idx});
    if (it == normals_.end() || !type.HasDirection() || type.IsParallelism()) return true;
    const Eigen::Vector3d seen =
        lookup_.views().at(regions_[r].place.image_id).R().transpose() * it->second.normal_in_cam;
    Eigen::Vector3d n;
    type.direction(g, &n, nullptr);
    const double angle = std::atan2(n.cross(seen).norm(), std::abs(n.dot(seen)));
    return RadToDeg(angle) <= options_.max_normal_angle_deg;
  }

  // Number of the region's features that are members.
  static size_t NumMembers(const Region& region, const std::vector<point3D_t>& points,
                           const std::vector<line3D_t>& lines) {
    return NumCommon(region.points, points) + NumCommon(region.lines, lines);
  }

  // Free regions join the group of their type with which they share most, and bring it the features
  // that fit.
  void JoinKnown() {
    for (size_t r = 0; r < regions_.size(); ++r) {
      if (!IsFree(r)) continue;
      const Region& region = regions_[r];
      std::map<group3D_t, size_t> votes;
      const auto vote = [&](std::span<const group3D_t> groups) {
        for (const group3D_t id : groups) {
          if (model_.groups3D.at(id).type == region.type) ++votes[id];
        }
      };
      for (const point3D_t id : region.points) vote(model_.GroupsOfPoint(id));
      for (const line3D_t id : region.lines) vote(model_.GroupsOfLine(id));
      group3D_t best = kNoId;
      size_t most = static_cast<size_t>(options_.min_shared_with_group) - 1;
      for (const auto& [id, count] : votes) {
        if (count <= most) continue;
        most = count;
        best = id;
      }
      if (best == kNoId) continue;
      const Group3D& group = model_.groups3D.at(best);
      double g[kMaxGroupParams];
      if (!region.type->from_file(group.params.data(), g)) continue;
      if (!AgreesWithNormal(r, *region.type, g)) {
        ++report_.dropped[Name(r) + " region: contradicts its normal"];
        continue;
      }
      const GroupFeatures features = lookup_.Find(*region.type, region.points, region.lines);
      const GroupFit fit =
          EvaluateGroup(*region.type, g, features, options_.members.fit.Limit(*region.type));
      if (static_cast<double>(fit.num_inliers) <
          options_.members.min_inlier_ratio * static_cast<double>(features.size())) {
        ++report_.dropped[Name(r) + " region: most of it off its group"];
        continue;
      }
      model_.AddObservation(best, regions_[r].place);
      ++report_.joined;
      const double limit = options_.members.fit.Limit(*region.type);
      for (size_t i = 0; i < features.points.size(); ++i) {
        if (fit.residuals[i] < limit) model_.AddPointMember(best, features.point_ids[i]);
      }
      for (size_t i = 0; i < features.lines.size(); ++i) {
        if (fit.residuals[features.points.size() + i] < limit)
          model_.AddLineMember(best, features.line_ids[i]);
      }
    }
  }

  // Sets of free regions that are one surface: the strongest connections first, one region of each
  // image at most (the others may join the group later, if they fit it).
  std::vector<std::vector<size_t>> Clusters() {
    struct Edge {
      size_t weight, a, b;
    };
    std::vector<Edge> edges;
    const auto least = static_cast<size_t>(options_.min_shared);
    for (const auto& [pair, count] : shared_) {
      if (count >= least && !matched_.contains(pair)) {
        edges.push_back({count, pair.first, pair.second});
      }
    }
    for (const auto& pair : matched_) {
      const auto it = shared_.find(pair);
      edges.push_back({least + (it == shared_.end() ? 0 : it->second), pair.first, pair.second});
    }
    std::erase_if(edges, [this](const Edge& e) { return !IsFree(e.a) || !IsFree(e.b); });
    std::sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) {
      if (x.weight != y.weight) return x.weight > y.weight;
      return std::pair(x.a, x.b) < std::pair(y.a, y.b);
    });
    std::vector<std::vector<size_t>> clusters(regions_.size());
    std::vector<std::set<image_t>> images(regions_.size());
    std::vector<size_t> cluster_of(regions_.size());
    std::iota(cluster_of.begin(), cluster_of.end(), 0);
    for (size_t r = 0; r < regions_.size(); ++r) {
      clusters[r] = {r};
      images[r] = {regions_[r].place.image_id};
    }
    for (const Edge& edge : edges) {
      const size_t a = std::min(cluster_of[edge.a], cluster_of[edge.b]);
      const size_t b = std::max(cluster_of[edge.a], cluster_of[edge.b]);
      if (a == b) continue;
      const bool conflict = std::any_of(images[b].begin(), images[b].end(),
                                        [&](image_t id) { return images[a].contains(id); });
      if (conflict) continue;
      images[a].merge(images[b]);
      for (const size_t r : clusters[b]) cluster_of[r] = a;
      clusters[a].insert(clusters[a].end(), clusters[b].begin(), clusters[b].end());
      clusters[b].clear();
    }
    std::erase_if(clusters, [](const std::vector<size_t>& c) { return c.size() < 2; });
    for (std::vector<size_t>& cluster : clusters) std::sort(cluster.begin(), cluster.end());
    return clusters;
  }

  // Features that at least half of the cluster's images in which they are seen have in the region;
  // `track_images(id)`: images that see the feature.
  template <typename Id, typename TrackImages>
  std::vector<Id> Voted(const std::vector<size_t>& cluster, std::vector<Id> Region::*ids,
                        const TrackImages& track_images) {
    std::set<image_t> images;
    std::map<Id, size_t> votes;
    for (const size_t r : cluster) {
      images.insert(regions_[r].place.image_id);
      for (const Id id : regions_[r].*ids) ++votes[id];
    }
    std::vector<Id> voted;
    for (const auto& [id, count] : votes) {
      size_t seen = 0;
      for (const image_t image_id : track_images(id)) seen += images.contains(image_id);
      if (2 * count >= seen) voted.push_back(id);
    }
    return voted;
  }

  void FormNew() {
    for (const std::vector<size_t>& cluster : Clusters()) {
      const GroupType& type = *regions_[cluster[0]].type;
      const std::string name(type.name);
      const auto images_of = [](const auto& track) {
        std::set<image_t> images;
        for (const auto& o : track) images.insert(o.image_id);
        return images;
      };
      const auto points = Voted(cluster, &Region::points, [&](point3D_t id) {
        return images_of(model_.points3D.at(id).track);
      });
      const auto lines = Voted(cluster, &Region::lines,
                               [&](line3D_t id) { return images_of(model_.lines3D.at(id).track); });
      const GroupFeatures features = lookup_.Find(type, points, lines);
      GroupFitOptions fit_options = options_.members.fit;
      fit_options.seed += model_.groups3D.NextId();
      const std::optional<GroupFit> fit = FitGroup(type, features, fit_options);
      if (!fit) {
        ++report_.dropped[name + " group: no parameters fit"];
        continue;
      }
      const MemberTest test = TestMembers(type, fit->residuals, options_.members);
      std::vector<point3D_t> point3D_ids;
      std::vector<line3D_t> line3D_ids;
      for (size_t i = 0; i < features.points.size(); ++i) {
        if (test.is_inlier[i]) point3D_ids.push_back(features.point_ids[i]);
      }
      for (size_t i = 0; i < features.lines.size(); ++i) {
        if (test.is_inlier[features.points.size() + i]) line3D_ids.push_back(features.line_ids[i]);
      }
      const char* fault = FaultOfSupport(type, point3D_ids.size(), line3D_ids.size(),
                                         features.size(), options_.members);
      if (fault) {
        ++report_.dropped[name + " group: " + fault];
        continue;
      }
      std::vector<size_t> agreeing;
      for (const size_t r : cluster) {
        if (AgreesWithNormal(r, type, fit->g.data())) agreeing.push_back(r);
      }
      if (2 * agreeing.size() <= cluster.size()) {
        ++report_.dropped[name + " group: contradicts its normals"];
        continue;
      }
      std::vector<size_t> observing;
      for (const size_t r : agreeing) {
        if (2 * NumMembers(regions_[r], point3D_ids, line3D_ids) >= regions_[r].size()) {
          observing.push_back(r);
        } else {
          ++report_.dropped[name + " region: most of it off its group"];
        }
      }
      if (observing.size() < 2) {
        ++report_.dropped[name + " group: seen in one image"];
        continue;
      }
      report_.dropped[name + " region: contradicts its normal"] += cluster.size() - agreeing.size();
      if (report_.dropped[name + " region: contradicts its normal"] == 0) {
        report_.dropped.erase(name + " region: contradicts its normal");
      }
      const group3D_t id =
          model_.AddGroup3D(type, fit->FileParams(type), std::move(point3D_ids), std::move(line3D_ids));
      for (const size_t r : observing) model_.AddObservation(id, regions_[r].place);
      report_.joined += observing.size();
      ++report_.formed;
      ++report_.formed_by_type[name];
    }
  }

  // Groups of one type that share a member, or whose regions share a feature or are matched.
  std::set<std::pair<group3D_t, group3D_t>> Connected() {
    std::set<std::pair<group3D_t, group3D_t>> pairs;
    const auto add = [&](group3D_t a, group3D_t b) {
      if (a != kNoId && b != kNoId && a != b) pairs.insert(std::minmax(a, b));
    };
    for (const auto& [regions, count] : shared_) {
      add(InImage(regions.first).group3D_id, InImage(regions.second).group3D_id);
    }
    for (const auto& regions : matched_) {
      add(InImage(regions.first).group3D_id, InImage(regions.second).group3D_id);
    }
    std::unordered_map<point3D_t, std::vector<group3D_t>> by_point;
    std::unordered_map<line3D_t, std::vector<group3D_t>> by_line;
    for (const auto& [id, group] : model_.groups3D) {
      const auto visit = [&, id = id, type = group.type](std::vector<group3D_t>& others) {
        for (const group3D_t other : others) {
          if (model_.groups3D.at(other).type == type) add(other, id);
        }
        others.push_back(id);
      };
      for (const point3D_t point_id : group.point3D_ids) visit(by_point[point_id]);
      for (const line3D_t line_id : group.line3D_ids) visit(by_line[line_id]);
    }
    return pairs;
  }

  std::vector<double> Residuals(const GroupType& type, const double* g, const Group3D& group) {
    return EvaluateGroup(type, g, lookup_.Find(type, group.point3D_ids, group.line3D_ids),
                         options_.members.fit.Limit(type))
        .residuals;
  }

  // The common parameters of two groups. Empty: they do not fit both.
  std::optional<GroupFit> FitBoth(const Group3D& a, const Group3D& b) {
    const GroupType& type = *a.type;
    std::vector<point3D_t> points = a.point3D_ids;
    points.insert(points.end(), b.point3D_ids.begin(), b.point3D_ids.end());
    SortUnique(&points);
    std::vector<line3D_t> lines = a.line3D_ids;
    lines.insert(lines.end(), b.line3D_ids.begin(), b.line3D_ids.end());
    SortUnique(&lines);
    double start[kMaxGroupParams];
    if (!type.from_file(a.params.data(), start)) return std::nullopt;
    std::optional<GroupFit> both =
        FitGroup(type, lookup_.Find(type, points, lines), options_.members.fit, start);
    if (!both) return both;
    for (const Group3D* part : {&a, &b}) {
      double own[kMaxGroupParams];
      if (!type.from_file(part->params.data(), own)) return std::nullopt;
      const std::vector<double> residuals = Residuals(type, both->g.data(), *part);
      const double before = Median(Residuals(type, own, *part));
      if (Median(residuals) > std::max(options_.max_merge_growth * before, before + 0.25)) {
        return std::nullopt;
      }
      const double limit = options_.members.fit.Limit(type);
      const auto inliers =
          std::count_if(residuals.begin(), residuals.end(), [&](double r) { return r < limit; });
      if (static_cast<double>(inliers) < 0.8 * static_cast<double>(residuals.size())) {
        return std::nullopt;
      }
    }
    return both;
  }

  void Merge() {
    std::set<std::pair<group3D_t, group3D_t>> refused;
    for (bool changed = true; changed;) {
      changed = false;
      for (const auto& pair : Connected()) {
        if (refused.contains(pair)) continue;
        Group3D &a = model_.groups3D.at(pair.first), &b = model_.groups3D.at(pair.second);
        const std::optional<GroupFit> both = FitBoth(a, b);
        if (!both) {
          refused.insert(pair);
          continue;
        }
        a.params = both->FileParams(*a.type);
        model_.MergeGroups3D(pair.first, pair.second);
        ++report_.merged;
        // A pair that was refused before may fit the new parameters.
        std::erase_if(refused, [&](const auto& other) {
          return other.first == pair.first || other.second == pair.first;
        });
        changed = true;
        break;
      }
    }
  }

  const GroupFormingOptions& options_;
  const GroupNormals& normals_;
  Reconstruction& model_;
  FeatureLookup lookup_;
  std::vector<Region> regions_;
  std::map<std::pair<image_t, group2D_t>, size_t> index_;
  std::map<std::pair<size_t, size_t>, size_t> shared_;
  std::set<std::pair<size_t, size_t>> matched_;
  GroupFormingReport report_;
};

}  // namespace

GroupFormingReport FormGroups(const GroupFormingOptions& options,
                              std::span<const GroupObservationPair> matches,
                              const GroupNormals& normals, Reconstruction* model) {
  return GroupFormer(options, normals, model).Run(matches);
}

void GroupFormingOptions::Describe(OptionTable* table) const {
  members.Describe(table);
  table->Section("Groups");
  table->Field("min_shared_with_group", &min_shared_with_group, AtLeast(1),
               "Triangulated features by which a region joins a known group.");
  table->Field("min_shared", &min_shared, AtLeast(1),
               "Triangulated features by which regions of two images become one group.");
  table->Field("max_normal_angle_deg", &max_normal_angle_deg, Between(0, 90),
               "Widest angle between a plane and the normal that was seen in its region.");
  table->Field("max_merge_growth", &max_merge_growth, AtLeast(1),
               "Growth of the median distance of members up to which two groups become one.");
}

}  // namespace holba
