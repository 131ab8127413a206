// SPDX-License-Identifier: BSD-3-Clause
// Problems: what a solver sees of a model, with blocks and residuals of one's own.
#include "problem.h"

#include <fmt/format.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <map>
#include <memory>
#include <set>
#include <tuple>

#include "calls.h"
#include "holba/base/error.h"
#include "holba/bundle/losses.h"
#include "holba/solver/covariance.h"
#include "module.h"
#include "options.h"
#include "python_group.h"
#include "python_residual.h"
#include "records.h"
#include "summaries.h"

namespace holba::python {

BlockId PyProblem::CheckBlock(uint32_t block) const {
  if (block >= problem().num_blocks())
    throw nb::index_error(fmt::format("there is no block {} in the problem", block).c_str());
  return block;
}

ResidualBatch& PyProblem::CheckBatch(size_t batch) const {
  if (batch >= problem().batches().size())
    throw nb::index_error(fmt::format("there is no batch {} in the problem", batch).c_str());
  return *problem().batches()[batch];
}

namespace {

// Texts that outlive every problem.
std::string_view Lasting(const std::string& text) {
  static std::set<std::string> texts;
  return *texts.insert(text).first;
}

const ManifoldOps& ManifoldOf(const std::string& name, size_t size) {
  if (name == "euclidean") {
    if (size < 1 || size > kMaxTangent)
      throw InputError(
          fmt::format("values: expected 1 to {} numbers, found {}", kMaxTangent, size));
    return EuclideanOps(static_cast<int>(size));
  }
  const ManifoldOps* manifold = name == "pose"         ? &OpsOf<PoseManifold>()
                                : name == "quaternion" ? &OpsOf<UnitQuaternion>()
                                : name == "direction"  ? &OpsOf<UnitVector3>()
                                : name == "line"       ? &OpsOf<LineManifold>()
                                                       : nullptr;
  if (manifold == nullptr)
    throw InputError(fmt::format(
        "manifold: expected euclidean, pose, quaternion, direction or line, found '{}'", name));
  if (size != static_cast<size_t>(manifold->ambient))
    throw InputError(fmt::format("values of a {}: expected {} numbers, found {}", name,
                                 manifold->ambient, size));
  return *manifold;
}

LossType LossOf(const std::string& name) {
  for (const LossType type :
       {LossType::kTrivial, LossType::kHuber, LossType::kSoftL1, LossType::kCauchy}) {
    if (NameOf(type) == name) return type;
  }
  throw InputError(
      fmt::format("loss: expected trivial, huber, soft_l1 or cauchy, found '{}'", name));
}

std::string_view RoleName(BlockRole role) {
  switch (role) {
    case BlockRole::kFeature:
      return "feature";
    case BlockRole::kPose:
      return "pose";
    case BlockRole::kIntrinsics:
      return "intrinsics";
    case BlockRole::kSensorPose:
      return "sensor_pose";
    default:
      return "group";
  }
}

BlockRole RoleOf(const std::string& name) {
  for (const BlockRole role :
       {BlockRole::kFeature, BlockRole::kPose, BlockRole::kIntrinsics, BlockRole::kGroup}) {
    if (RoleName(role) == name) return role;
  }
  throw InputError(
      fmt::format("role: expected feature, pose, intrinsics or group, found '{}'", name));
}

uint32_t AddBlock(PyProblem& p, const std::string& kind, const std::vector<double>& values,
                  const std::string& manifold, const std::string& role, bool constant) {
  CheckUnpinned(p.problem().state().data());
  const BlockId id = p.problem().AddBlock(Lasting(kind), ManifoldOf(manifold, values.size()),
                                          RoleOf(role), values);
  p.problem().block(id).constant = constant;
  return id;
}

void CheckLoss(double loss_scale, double weight) {
  if (!(loss_scale > 0.0) || !(weight >= 0.0))
    throw InputError("loss_scale and weight: expected a scale above 0 and a weight of at least 0");
}

size_t AddResiduals(PyProblem& p, const std::string& term, int dim, nb::object values,
                    const ArrayArg<uint32_t, -1, -1>& blocks, nb::object jacobian,
                    const std::string& loss, double loss_scale, double weight,
                    double relative_step) {
  if (dim < 1 || dim > kMaxResidualDim)
    throw InputError(fmt::format("dim: expected 1 to {}, found {}", kMaxResidualDim, dim));
  const size_t n = blocks.shape(0), slots = blocks.shape(1);
  if (slots < 1 || slots > kMaxSlots)
    throw InputError(fmt::format("blocks: expected 1 to {} columns, found {}", kMaxSlots, slots));
  if (n == 0) throw InputError("blocks: expected at least one row, found none");
  CheckLoss(loss_scale, weight);
  std::vector<const ManifoldOps*> manifolds;
  std::vector<int> tangents;
  for (size_t s = 0; s < slots; ++s) {
    manifolds.push_back(p.problem().block(p.CheckBlock(blocks.data()[s])).manifold);
    tangents.push_back(manifolds.back()->tangent);
  }
  for (size_t i = 0; i < n; ++i) {
    for (size_t s = 0; s < slots; ++s) {
      const ParameterBlock& block = p.problem().block(p.CheckBlock(blocks.data()[i * slots + s]));
      if (block.manifold != manifolds[s])
        throw InputError(fmt::format(
            "blocks: expected blocks of one kind in each column, found {} in column {} of row {}",
            block.kind, s, i));
    }
  }
  auto batch = std::make_unique<PythonBatch>(
      term, dim, std::move(manifolds), std::move(tangents),
      PythonBatch::Functions{std::move(values), std::move(jacobian), relative_step});
  for (size_t i = 0; i < n; ++i) batch->Add({blocks.data() + i * slots, slots});
  batch->loss = {LossOf(loss), loss_scale};
  batch->weight = weight;
  p.problem().AddBatch(std::move(batch));
  return p.problem().batches().size() - 1;
}

template <typename Id>
std::map<Id, BlockId> BlockOfId(const std::vector<std::pair<Id, BlockId>>& pairs) {
  return {pairs.begin(), pairs.end()};
}

// One batch for each camera model.
uint32_t AddGroup(PyProblem& p, const std::string& kind, const std::vector<double>& values,
                  const std::vector<uint64_t>& point_ids, nb::object project, nb::object jacobian,
                  const std::string& manifold_name, bool constant, const std::string& loss,
                  double loss_scale, double weight, double relative_step) {
  if (p.model.is_none() || !p.model.is_valid())
    throw nb::value_error("this problem was built of no model: it has no observations of points");
  if (!p.bundle.sensors.empty())
    throw InputError(
        "add_group: poses of sensors are adjusted in this problem; build it with the "
        "sensors' poses held");
  CheckLoss(loss_scale, weight);
  const auto& scene = nb::cast<const Reconstruction&>(p.model);
  const std::map<point3D_t, BlockId> points = BlockOfId(p.bundle.points);
  const std::map<frame_t, BlockId> poses = BlockOfId(p.bundle.poses);
  const std::map<camera_t, BlockId> cameras = BlockOfId(p.bundle.cameras);
  for (const uint64_t id : point_ids) {
    if (!points.contains(id))
      throw InputError(
          fmt::format("points: there is no point {} in the problem; give ids of "
                      "Problem.point_blocks",
                      id));
  }
  const ManifoldOps& manifold = ManifoldOf(manifold_name, values.size());
  CheckUnpinned(p.problem().state().data());
  const LossType loss_type = LossOf(loss);
  const BlockId block = p.problem().AddBlock(Lasting(kind), manifold, BlockRole::kGroup, values);
  p.problem().block(block).constant = constant;
  std::map<const CameraModel*, std::unique_ptr<PythonGroupBatch>> batches;
  std::map<std::pair<rig_t, camera_t>, std::shared_ptr<const SensorPose>> sensors;
  for (const uint64_t id : point_ids) {
    for (const PointObservation& observation : scene.points3D.at(id).track) {
      const Image& image = scene.images.at(observation.image_id);
      const auto pose = poses.find(image.frame_id);
      const auto camera = cameras.find(image.camera_id);
      if (pose == poses.end() || camera == cameras.end()) continue;
      const Frame& frame = scene.frames.at(image.frame_id);
      const Rig& rig = scene.rigs.at(frame.rig_id);
      std::shared_ptr<const SensorPose> sensor;
      if (!(rig.ref_sensor && *rig.ref_sensor == SensorId{SensorType::kCamera, image.camera_id})) {
        std::shared_ptr<const SensorPose>& known = sensors[{frame.rig_id, image.camera_id}];
        if (!known) {
          const Rigid3d in_rig = scene.SensorFromRig(image);
          known =
              std::make_shared<SensorPose>(SensorPose{in_rig.RotationMatrix(), in_rig.translation});
        }
        sensor = known;
      }
      const CameraModel& model = *scene.cameras.at(image.camera_id).model;
      std::unique_ptr<PythonGroupBatch>& batch = batches[&model];
      if (!batch) {
        batch = std::make_unique<PythonGroupBatch>(
            kind, model, manifold, PythonBatch::Functions{project, jacobian, relative_step});
        batch->loss = {loss_type, loss_scale};
        batch->weight = weight;
      }
      batch->Add(points.at(id), pose->second, camera->second, block, std::move(sensor));
    }
  }
  // By the models' ids, so that their order is the same in every run.
  std::map<int, std::unique_ptr<PythonGroupBatch>> in_order;
  for (auto& [model, batch] : batches) in_order[model->id] = std::move(batch);
  for (auto& [id, batch] : in_order) p.problem().AddBatch(std::move(batch));
  return block;
}

template <typename Id>
std::map<uint64_t, uint32_t> Blocks(const std::vector<std::pair<Id, BlockId>>& pairs) {
  std::map<uint64_t, uint32_t> out;
  for (const auto& [id, block] : pairs) out[id] = block;
  return out;
}

SolverSummary SolveProblem(PyProblem& p, const SolveOptions& options, SolverWorkspace* workspace,
                           nb::object on_iteration) {
  SolverOptions solver = options.values;
  IterationCallback callback(std::move(on_iteration), /*logs=*/false);
  solver.on_iteration = [&](const IterationRecord& record) { return callback(record); };
  SolverSummary summary = Unlocked([&] { return Solve(solver, &p.problem(), workspace); });
  callback.Finish();
  return summary;
}

PyProblem Build(nb::object model, const AdjustOptions& options, const BundleSelection* selection) {
  PyProblem p;
  const auto& scene = nb::cast<const Reconstruction&>(model);
  BundleOptions bundle = options.values.bundle;
  bundle.SetDefaultLosses(false);
  p.bundle = Unlocked([&] {
    return selection != nullptr ? BuildProblem(scene, bundle, *selection)
                                : BuildProblem(scene, bundle);
  });
  p.model = std::move(model);
  return p;
}

void BindBlocks(nb::class_<PyProblem>* type) {
  type->def(
      "add_block", AddBlock, nb::arg("kind"), nb::arg("values"), nb::kw_only(),
      nb::arg("manifold") = "euclidean", nb::arg("role") = "group", nb::arg("constant") = false,
      nb::sig("def add_block(self, kind: str, values: collections.abc.Sequence[float] | "
              "numpy.typing.NDArray[numpy.float64], *, "
              "manifold: str = 'euclidean', role: str = 'group', constant: bool = False) -> int"),
      "A block of parameters; returns its number. kind: a word for messages. manifold: euclidean, "
      "pose "
      "([qx qy qz qw tx ty tz], moves by rotation and translation), quaternion, direction (unit, 3 "
      "numbers) or "
      "line ([d p]). role: feature (eliminated: a residual holds one at most), pose, intrinsics or "
      "group (kept). "
      "BufferError while arrays show the state. Raises InputError.");
  type->def("add_residuals", AddResiduals, nb::arg("term"), nb::arg("dim"), nb::arg("values"),
            nb::arg("blocks"), nb::kw_only(), nb::arg("jacobian").none() = nb::none(),
            nb::arg("loss") = "trivial", nb::arg("loss_scale") = 1.0, nb::arg("weight") = 1.0,
            nb::arg("relative_step") = 0.0,
            nb::sig("def add_residuals(self, term: str, dim: int, values: "
                    "collections.abc.Callable[..., numpy.typing.NDArray[numpy.float64]], "
                    "blocks: numpy.typing.NDArray[typing.Any], *, "
                    "jacobian: collections.abc.Callable[..., "
                    "collections.abc.Sequence[numpy.typing.NDArray[numpy.float64]]] | None = None, "
                    "loss: str = 'trivial', loss_scale: float = 1.0, weight: float = 1.0, "
                    "relative_step: float = 0.0) -> int"),
            "Residuals written in Python; returns the number of their batch. blocks (n, k): the k "
            "blocks of each of n "
            "residuals, those of a column alike. values(p_0, ..., p_{k-1}) gets the parameters of "
            "m of these residuals, "
            "p_s (m, numbers of the block), and returns (m, dim); a row with NaN is absent "
            "(undefined there). It must be "
            "a function of these alone, row by row. jacobian(p_0, ...) returns k arrays (m, dim, "
            "t): derivatives by the "
            "block's tangent or by its numbers; None: central differences (relative_step: of the "
            "size of the numbers; "
            "0: as the accuracy of doubles asks). loss: trivial, huber, soft_l1 or cauchy, which "
            "departs from the square "
            "at loss_scale; weight multiplies the robustified cost. Raises InputError, CheckError "
            "for two features in "
            "one residual; what the functions raise ends the solve.");
  type->def(
      "add_group", AddGroup, nb::arg("kind"), nb::arg("values"), nb::arg("points"),
      nb::arg("project"), nb::kw_only(), nb::arg("jacobian").none() = nb::none(),
      nb::arg("manifold") = "euclidean", nb::arg("constant") = false, nb::arg("loss") = "trivial",
      nb::arg("loss_scale") = 1.0, nb::arg("weight") = 1.0, nb::arg("relative_step") = 0.0,
      nb::sig("def add_group(self, kind: str, values: collections.abc.Sequence[float] | "
              "numpy.typing.NDArray[numpy.float64], points: "
              "collections.abc.Sequence[int], project: collections.abc.Callable[..., "
              "numpy.typing.NDArray[numpy.float64]], *, jacobian: collections.abc.Callable[..., "
              "collections.abc.Sequence[numpy.typing.NDArray[numpy.float64]]] | None = None, "
              "manifold: str = 'euclidean', constant: bool = False, loss: str = 'trivial', "
              "loss_scale: float = 1.0, weight: float = 1.0, relative_step: float = 0.0) -> int"),
      "A group of a type written in Python, with its members; returns the number of its block. The "
      "residual of each "
      "observation of a member is pi(X) - pi(project(X)), pixels (the term is called `kind`): the "
      "cameras' part is "
      "native. values: its parameters in memory (positive quantities best as logarithms); points: "
      "ids of members. "
      "project(X, g) gets m points (m, 3), in the model's frame, and parameters (m, k), and "
      "returns the projected "
      "points (m, 3); NaN: undefined. jacobian(X, g) returns [(m, 3, 3), (m, 3, t or k)], "
      "derivatives by the point and "
      "by the group; None: central differences. Others as for add_block and add_residuals. Raises "
      "InputError, "
      "ValueError for a problem of no model.");
  type->def_prop_ro("num_blocks", [](const PyProblem& p) { return p.problem().num_blocks(); });
  type->def_prop_ro(
      "num_residuals", [](const PyProblem& p) { return p.problem().num_residuals(); },
      "Over all batches; one observation is one residual.");
  type->def(
      "block",
      [](const PyProblem& p, uint32_t id) {
        const ParameterBlock& b = p.problem().block(p.CheckBlock(id));
        nb::dict d;
        d["kind"] = std::string(b.kind);
        d["role"] = std::string(RoleName(b.role));
        d["size"] = b.manifold->ambient;
        d["tangent"] = b.manifold->tangent;
        d["constant"] = b.constant;
        d["free"] = b.FreeTangent();
        return d;
      },
      nb::arg("block"), nb::sig("def block(self, block: int) -> dict[str, typing.Any]"),
      "Kind, role, numbers, tangent coordinates and whether it is held; free: variable tangent "
      "coordinates.");
  type->def(
      "set_constant",
      [](PyProblem& p, uint32_t id, bool constant) {
        p.problem().block(p.CheckBlock(id)).constant = constant;
      },
      nb::arg("block"), nb::arg("constant") = true);
  type->def(
      "hold",
      [](PyProblem& p, uint32_t id, const std::vector<int>& coordinates) {
        ParameterBlock& b = p.problem().block(p.CheckBlock(id));
        uint32_t held = 0;
        for (int c : coordinates) {
          if (c < 0 || c >= b.manifold->tangent)
            throw nb::index_error(
                fmt::format("block {} has no tangent coordinate {}", id, c).c_str());
          held |= uint32_t{1} << c;
        }
        b.held = held;
      },
      nb::arg("block"), nb::arg("coordinates"),
      "Holds these tangent coordinates, and frees the others.");
  type->def_prop_ro(
      "pose_blocks", [](const PyProblem& p) { return Blocks(p.bundle.poses); },
      "Block of each frame id.");
  type->def_prop_ro(
      "camera_blocks", [](const PyProblem& p) { return Blocks(p.bundle.cameras); },
      "Block of each camera id.");
  type->def_prop_ro(
      "point_blocks", [](const PyProblem& p) { return Blocks(p.bundle.points); },
      "Block of each point id.");
  type->def_prop_ro(
      "line_blocks", [](const PyProblem& p) { return Blocks(p.bundle.lines); },
      "Block of each line id.");
  type->def_prop_ro(
      "group_blocks", [](const PyProblem& p) { return Blocks(p.bundle.groups); },
      "Block of each group id.");
}

void BindCovariance(nb::module_& m) {
  nb::class_<Covariance> covariance(
      m, "Covariance", "Covariances of the blocks of a problem: blocks of (J^T J)^-1.");
  covariance.def(
      "of", [](const Covariance& c, uint32_t block) { return ToArray<-1, -1>(c.Of(block)); },
      nb::arg("block"),
      "(t, t) in tangent coordinates; 0 where it is held, infinite for a feature that nothing "
      "determines.");
  covariance.def(
      "between",
      [](const Covariance& c, uint32_t a, uint32_t b) -> std::optional<Array<double, -1, -1>> {
        const auto found = c.Between(a, b);
        if (!found) return std::nullopt;
        return ToArray<-1, -1>(*found);
      },
      nb::arg("a"), nb::arg("b"),
      "(t_a, t_b) of two kept blocks that share a residual or a feature; else None.");
}

}  // namespace

void BindProblem(nb::module_& m) {
  BindCovariance(m);
  nb::class_<PyProblem> type(
      m, "Problem",
      "A nonlinear least-squares problem: cost = 1/2 sum weight * rho(|r|^2) over batches of "
      "residuals, which are "
      "functions of blocks of parameters. Of a model (holba.build_problem) or of one's own.");
  type.def(nb::init<>(), "Without blocks and residuals.");
  BindBlocks(&type);
  BindProblemArrays(&type);
  BindReducedSystem(&type);
  type.def(
      "terms",
      [](const PyProblem& p) { return Unlocked([&] { return EvaluateTerms(p.problem()); }); },
      "The cost of each term at the state.");
  type.def("_solve", SolveProblem, nb::arg("options"), nb::arg("workspace").none(),
           nb::arg("on_iteration").none(),
           nb::sig("def _solve(self, options: SolveOptions, workspace: SolverWorkspace | None, "
                   "on_iteration: collections.abc.Callable[[IterationRecord], bool | None] | None) "
                   "-> SolverSummary"));
  type.def(
      "covariance",
      [](const PyProblem& p, int num_threads) {
        return Unlocked([&] { return Covariance::Compute(p.problem(), num_threads); });
      },
      nb::kw_only(), nb::arg("num_threads") = -1,
      "At the state. None: the system is singular (the gauge is free).");
  type.def(
      "write_back",
      [](const PyProblem& p) {
        if (p.model.is_none() || !p.model.is_valid())
          throw nb::value_error("this problem was built of no model");
        auto& model = nb::cast<Reconstruction&>(p.model);
        Unlocked([&] { WriteBack(p.bundle, &model); });
      },
      "Values of all variable blocks into the model that it was built of. ValueError: of none.");
  m.def("_build_problem", Build, nb::arg("model"), nb::arg("options"), nb::arg("selection").none(),
        nb::sig("def _build_problem(model: Reconstruction, options: AdjustOptions, selection: "
                "BundleSelection | None) -> Problem"));
}

}  // namespace holba::python
