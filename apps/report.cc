// SPDX-License-Identifier: BSD-3-Clause
#include "apps/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "apps/camera_choices.h"
#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/base/memory.h"
#include "holba/base/words.h"
#include "holba/bundle/plausibility.h"
#include "holba/io/files.h"

namespace holba {
namespace {

using nlohmann::json;

// Unknown times (negative) are null.
json Seconds(double seconds) { return seconds < 0 ? json(nullptr) : json(seconds); }

}  // namespace

json TermsToJson(std::span<const TermCost> terms) {
  json object = json::object();
  for (const TermCost& term : terms) {
    object[term.term] = {{"residuals", term.residuals - term.absent},
                         {"sum_squares", term.sum_squares},
                         {"absent", term.absent}};
  }
  return object;
}

namespace {

// Null: nothing was chosen.
json ChoiceToJson(const WeightChoice& choice) {
  const auto weights = [](const CameraWeights& w) {
    return json{{"points_alone", w.points_alone},
                {"lines", w.points_alone ? 0.0 : w.structure.lines},
                {"corners", w.points_alone ? 0.0 : w.structure.corners},
                {"groups", w.points_alone ? 0.0 : w.structure.groups}};
  };
  if (choice.trials.empty()) return nullptr;
  json trials = json::array();
  for (const WeightTrial& trial : choice.trials) {
    json entry = weights(trial.weights);
    entry["cost_from_points"] = trial.from_points.mean;
    entry["standard_error"] = trial.from_points.standard_error;
    trials.push_back(std::move(entry));
  }
  json result = weights(choice.weights);
  result["tracks_left_out"] = choice.num_tracks;
  result["without_points_of_two_images"] = choice.without_unverified;
  result["trials"] = std::move(trials);
  return result;
}

std::string ChoiceToText(const WeightChoice& choice) {
  if (choice.trials.empty()) return "";
  const auto chosen = std::find_if(choice.trials.begin(), choice.trials.end(),
                                   [&](const auto& t) { return t.weights == choice.weights; });
  std::string text = fmt::format("cameras moved by {}", choice.weights.Text());
  if (!choice.weights.points_alone) {
    text += fmt::format(
        ": {} tracks that were left out cost {:+.4f} +- {:.4f} each against points alone",
        choice.num_tracks, chosen->from_points.mean, chosen->from_points.standard_error);
  } else {
    text += fmt::format(": {} tracks that were left out cost more with lines and structure",
                        choice.num_tracks);
  }
  if (choice.without_unverified) text += "; not by points that only two images see";
  return text + '\n';
}

}  // namespace

// Of each process of an adjustment that several share; empty: it was one.
json RanksToJson(std::span<const RankShare> ranks) {
  json list = json::array();
  for (const RankShare& rank : ranks) {
    list.push_back({{"work", rank.work},
                    {"features", rank.features},
                    {"residuals", rank.residuals},
                    {"kept_unknowns", rank.kept_unknowns},
                    {"shared_unknowns", rank.shared_unknowns},
                    {"messages_per_iteration", rank.messages_per_iteration},
                    {"bytes_per_iteration", rank.bytes_per_iteration},
                    {"peak_memory_mb", rank.peak_memory_mb}});
  }
  return list;
}

json SummaryToJson(const BundleSummary& summary) {
  const SolverSummary& s = summary.solver;
  json terms = json::object();
  for (size_t t = 0; t < s.final_terms.size(); ++t) {
    const TermCost& before = s.initial_terms[t];
    const TermCost& after = s.final_terms[t];
    json& term = terms[after.term];
    term = {{"residuals", after.residuals},
            {"absent", after.absent},
            {"sum_squares_initial", before.sum_squares},
            {"sum_squares_final", after.sum_squares},
            {"cost_initial", before.cost},
            {"cost_final", after.cost}};
    const auto scale = summary.auto_scales.find(after.term);
    if (scale != summary.auto_scales.end()) {
      term["auto_scale"] = scale->second;
      term["auto_sigma"] = summary.auto_sigmas.at(after.term);
    }
  }
  json associations = json::object();
  for (const auto& [kind, count] : summary.associations) {
    associations[kind] = {{"tested", count.tested}, {"rejected", count.rejected}};
  }
  json held_intrinsics = json::array();
  for (const HeldIntrinsics& held : summary.held_intrinsics)
    held_intrinsics.push_back(held.camera_id);
  json held_sensors = json::array();
  for (const HeldSensor& held : summary.held_sensors)
    held_sensors.push_back({{"rig", held.rig_id}, {"camera", held.camera_id}});
  return {{"backend", s.backend},
          {"linear_solver", s.linear_solver},
          {"num_threads", s.num_threads},
          {"iterations", s.iterations},
          {"accepted_steps", s.accepted_steps},
          {"rounds", summary.rounds},
          {"stop_reason", NameOf(s.stop_reason)},
          {"message", s.message},
          {"cost", {{"initial", s.initial_cost}, {"final", s.final_cost}}},
          {"terms", terms},
          {"associations", associations},
          {"groups_dropped", summary.groups_dropped},
          {"camera_weights", ChoiceToJson(summary.weight_choice)},
          {"points_seen_once", summary.points_seen_once},
          {"lines_seen_once", summary.lines_seen_once},
          {"shared_cameras", SharedCamerasToJson(summary.shared_cameras)},
          {"camera_models", CameraModelsToJson(summary.camera_models)},
          {"cameras_with_held_intrinsics", held_intrinsics},
          {"sensors", summary.num_sensors},
          {"held_sensors", held_sensors},
          {"parts", summary.num_parts},
          {"angular_weight_factor", summary.angular_weight_factor},
          {"seconds",
           {{"build", s.build_seconds},
            {"linearise", s.linearise_seconds},
            {"eliminate", s.eliminate_seconds},
            {"factorise", Seconds(s.factorise_seconds)},
            {"back_substitute", Seconds(s.back_substitute_seconds)},
            {"total", s.total_seconds}}},
          {"seconds_per_iteration_median", s.MedianIterationSeconds()},
          {"reduced_system",
           {{"size", s.reduced_system.size},
            {"density", s.reduced_system.density},
            {"pose_density", s.reduced_system.pose_density},
            {"pose_density_without_wireframe", s.reduced_system.pose_density_without_wireframe}}},
          {"ranks", RanksToJson(s.ranks)},
          {"peak_memory_mb", PeakMemoryMb()}};
}

std::string ContentsText(const Reconstruction& model) {
  return fmt::format("{}, {}, {} and {}", Counted(model.images.size(), "image"),
                     Counted(model.points3D.size(), "point"), Counted(model.lines3D.size(), "line"),
                     Counted(model.groups3D.size(), "group"));
}

std::string SummaryToText(const BundleSummary& summary) {
  const SolverSummary& s = summary.solver;
  std::string text =
      fmt::format("{:<16} {:>10} {:>8} {:>14} {:>14} {:>11} {:>11}\n", "term", "residuals",
                  "absent", "cost before", "cost after", "rms before", "rms after");
  const auto rms = [](const TermCost& t) {
    const size_t present = t.residuals - t.absent;
    return present ? std::sqrt(t.sum_squares / static_cast<double>(present)) : 0.0;
  };
  for (size_t t = 0; t < s.final_terms.size(); ++t) {
    const TermCost& before = s.initial_terms[t];
    const TermCost& after = s.final_terms[t];
    text += fmt::format("{:<16} {:>10} {:>8} {:>14.6g} {:>14.6g} {:>11.4g} {:>11.4g}", after.term,
                        after.residuals, after.absent, before.cost, after.cost, rms(before),
                        rms(after));
    const auto scale = summary.auto_scales.find(after.term);
    if (scale != summary.auto_scales.end()) {
      text += fmt::format("  Cauchy {0:.3g}{2} (sigma {1:.3g}{2})", scale->second,
                          summary.auto_sigmas.at(after.term), after.angular ? "" : " px");
    }
    text += '\n';
  }
  text += fmt::format("{:<16} {:>10} {:>8} {:>14.8g} {:>14.8g}\n", "all", "", "", s.initial_cost,
                      s.final_cost);
  for (const auto& [kind, count] : summary.associations) {
    text += fmt::format("left out {} of {} {}\n", count.rejected, count.tested, kind);
  }
  if (summary.groups_dropped)
    text += fmt::format("left out {}\n", Counted(summary.groups_dropped, "group"));
  text += CameraChoicesToText(summary.shared_cameras, summary.camera_models);
  text += ChoiceToText(summary.weight_choice);
  if (summary.num_sensors > 0) {
    text +=
        fmt::format("adjusted the {} of {} in {}\n", summary.num_sensors == 1 ? "pose" : "poses",
                    Counted(summary.num_sensors, "sensor"),
                    summary.num_sensors == 1 ? "its rig" : "their rigs");
  }
  const bool has_angular = std::any_of(s.final_terms.begin(), s.final_terms.end(),
                                       [](const TermCost& t) { return t.angular; });
  if (has_angular && summary.angular_weight_factor != 1.0) {
    text += fmt::format("weights of angular terms times {:.3g}: the variance of the noise, px^2\n",
                        summary.angular_weight_factor);
  }
  text += fmt::format("{} ({} accepted) in {}, stopped: {}\n", Counted(s.iterations, "iteration"),
                      s.accepted_steps, Counted(summary.rounds, "round"), NameOf(s.stop_reason));
  text += fmt::format("{}, {}; reduced system {} unknowns, {:.1f} % dense", s.linear_solver,
                      Counted(s.num_threads, "thread"), s.reduced_system.size,
                      100.0 * s.reduced_system.density);
  text += fmt::format(" (pairs of poses {:.1f} %, without wireframe {:.1f} %)\n",
                      100.0 * s.reduced_system.pose_density,
                      100.0 * s.reduced_system.pose_density_without_wireframe);
  text += fmt::format(
      "{:.3f} s: build {:.3f}, linearise {:.3f}, linear solver {:.3f}; {:.2f} ms per iteration "
      "(median); peak memory "
      "{:.0f} MB\n",
      s.total_seconds, s.build_seconds, s.linearise_seconds, s.eliminate_seconds,
      1e3 * s.MedianIterationSeconds(), PeakMemoryMb());
  return text;
}

void WarnOfDoubts(const std::string& when, const Reconstruction& model) {
  for (const std::string& doubt : DoubtsOf(CheckReprojections(model), model))
    LogWarning("{}: {}", when, doubt);
}

void WarnOfWhatWasHeld(const BundleSummary& summary) {
  const size_t num_seen_once = summary.points_seen_once + summary.lines_seen_once;
  if (num_seen_once > 0) {
    LogWarning(
        "{} and {} are seen by fewer than two images (in front of them) and say nothing about the "
        "cameras, so that they take no part and follow the image that sees them",
        Counted(summary.points_seen_once, "point"), Counted(summary.lines_seen_once, "line"));
  }
  for (const HeldIntrinsics& held : summary.held_intrinsics) {
    LogWarning(
        "The intrinsics of camera {} stay as they are, as {} cannot determine them; let images "
        "share a camera, or triangulate more points",
        held.camera_id, Counted(held.num_observations, "observation"));
  }
  for (const HeldSensor& held : summary.held_sensors) {
    if (held.why == HeldSensor::Why::kStandsForReference) {
      LogWarning(
          "The pose of camera {} in rig {} stays as it is: the reference sensor of the rig sees "
          "too "
          "little to say where the rig is, and this camera stands in for it",
          held.camera_id, held.rig_id);
    } else {
      LogWarning(
          "The pose of camera {} in rig {} stays as it is: {} observations in frames whose place "
          "others tell are too few to estimate it",
          held.camera_id, held.rig_id, held.num_observations);
    }
  }
  if (summary.num_parts > 1) {
    LogWarning(
        "The model has {} that share no point, line or group, so that nothing says how they stand "
        "to each other, and each keeps its own position, orientation and scale",
        Counted(summary.num_parts, "part"));
  }
}

void RefuseWithoutResiduals(const std::string& path, const Reconstruction& model) {
  if (!model.lines3D.empty()) return;
  const ReprojectionCheck check = CheckReprojections(model);
  if (check.num_absent == check.num_observations) throw InputError(path, WhyNothingIsLeft(model));
}

bool NothingWasAdjusted(const BundleSummary& summary) {
  const auto is_absent = [](const TermCost& term) { return term.absent == term.residuals; };
  const auto& before = summary.solver.initial_terms;
  const auto& after = summary.solver.final_terms;
  return std::all_of(before.begin(), before.end(), is_absent) &&
         std::all_of(after.begin(), after.end(), is_absent);
}

std::string IterationHeader(const IterationRecord& record) {
  std::string text = fmt::format("{:>5} {:>14} {:>10} {:>9} {:>9} {:>9} {:>8}", "iter", "cost",
                                 "change", "gradient", "step", "damping", "ms");
  for (const TermCost& term : record.terms) text += fmt::format(" {:>15}", term.term);
  return text;
}

std::string IterationLine(const IterationRecord& record) {
  std::string text = fmt::format("{:>4}{} {:>14.8g} {:>10.2e} {:>9.2e} {:>9.2e} {:>9.2e} {:>8.2f}",
                                 record.iteration, record.accepted ? ' ' : '-', record.cost,
                                 record.cost_change, record.gradient_max_norm, record.step_norm,
                                 1.0 / record.trust_radius, 1e3 * record.seconds);
  for (const TermCost& term : record.terms) text += fmt::format(" {:>15.6g}", term.cost);
  return text;
}

std::vector<GroupMeasurement> ReadGroupMeasurements(const std::string& path,
                                                    const Reconstruction& model) {
  std::istringstream file(ReadFileBytes(path));
  std::vector<GroupMeasurement> measurements;
  std::string line;
  for (uint64_t number = 1; std::getline(file, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    fields.imbue(std::locale::classic());
    GroupMeasurement m;
    Eigen::Vector3d& d = m.direction_in_cam;
    std::string rest;
    if (!(fields >> m.image_id >> m.group3D_id >> d.x() >> d.y() >> d.z() >> m.sigma_deg) ||
        (fields >> rest)) {
      throw InputError::AtLine(path, number, "expected IMAGE_ID GROUP3D_ID DX DY DZ SIGMA_DEG");
    }
    if (!d.allFinite() || !(d.norm() > 0) || !(m.sigma_deg > 0) || !std::isfinite(m.sigma_deg)) {
      throw InputError::AtLine(path, number,
                               "the direction must not be zero and SIGMA_DEG must be positive");
    }
    if (!model.images.contains(m.image_id)) {
      throw InputError::AtLine(
          path, number, fmt::format("expected IMAGE_ID as in the model, found {}", m.image_id));
    }
    const Group3D* group = model.groups3D.Find(m.group3D_id);
    if (!group || !group->type->HasDirection()) {
      throw InputError::AtLine(
          path, number,
          fmt::format("expected GROUP3D_ID of a group of the model with a direction, found {}",
                      m.group3D_id));
    }
    measurements.push_back(m);
  }
  return measurements;
}

}  // namespace holba
