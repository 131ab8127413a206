// SPDX-License-Identifier: BSD-3-Clause
// Rigid3d and Sim3d: values that do not change.
#include "geometry.h"

#include <fmt/format.h>
#include <nanobind/operators.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>

#include <Eigen/Geometry>
#include <cmath>

#include "module.h"

namespace holba::python {

Eigen::Quaterniond RotationFrom(nb::handle rotation) {
  Vec<4> quat{};
  if (nb::try_cast(rotation, quat)) {
    const double norm = quat.value.norm();
    if (!(norm > 0.0) || !std::isfinite(norm))
      throw nb::value_error("expected a quaternion x y z w that is finite and not 0");
    return Eigen::Quaterniond(Eigen::Vector4d(quat.value / norm));
  }
  ArrayArg<double, 3, 3> matrix;
  if (!nb::try_cast(rotation, matrix)) {
    throw nb::value_error("expected a quaternion x y z w or a rotation matrix of 3 x 3");
  }
  Eigen::Matrix3d R;
  for (int i = 0; i < 9; ++i) R(i / 3, i % 3) = matrix.data()[i];
  if (!((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-6) || R.determinant() < 0.0)
    throw nb::value_error("expected a rotation matrix: orthonormal to 1e-6, determinant 1");
  return Eigen::Quaterniond(R);
}

namespace {

using Points = ArrayArg<double, -1, 3>;

template <typename Transform>
Array<double, -1, 3> Apply(const Transform& transform, const Points& points) {
  std::vector<double> out(3 * points.shape(0));
  for (size_t i = 0; i < points.shape(0); ++i) {
    const Eigen::Vector3d x(points.data() + 3 * i);
    Eigen::Map<Eigen::Vector3d>(out.data() + 3 * i) = transform * x;
  }
  return OwnedRows<3>(std::move(out));
}

std::string Text(const Eigen::Quaterniond& q, const Eigen::Vector3d& t) {
  return fmt::format(
      "rotation=[{:.6g}, {:.6g}, {:.6g}, {:.6g}], translation=[{:.6g}, {:.6g}, {:.6g}]", q.x(),
      q.y(), q.z(), q.w(), t.x(), t.y(), t.z());
}

template <typename T, typename... Extra>
void BindCommon(nb::class_<T>* type) {
  type->def_prop_ro(
      "quat", [](const T& self) { return ToArray<4>(self.rotation.coeffs()); },
      "(4,) rotation as a quaternion [x y z w]; pycolmap's order, not that of the files.");
  type->def_prop_ro(
      "rotation",
      [](const T& self) { return ToArray<3, 3>(self.rotation.normalized().toRotationMatrix()); },
      "(3, 3) rotation matrix.");
  type->def_prop_ro(
      "translation", [](const T& self) { return ToArray<3>(self.translation); }, "(3,)");
  type->def("inverse", &T::Inverse, "a_from_b of b_from_a.");
  type->def(
      "__mul__",
      [](const T& self, const Vec<3>& x) { return ToArray<3>(Eigen::Vector3d(self * x.value)); },
      nb::arg("point"), "A point (3,) in the other frame.");
  type->def(
      "__mul__", [](const T& self, const Points& x) { return Apply(self, x); }, nb::arg("points"),
      "Points (n, 3) in the other frame.");
  type->def(
      "__eq__",
      [](const T& self, const T& other) {
        return self.rotation.coeffs() == other.rotation.coeffs() &&
               self.translation == other.translation && [&] {
                 if constexpr (requires { self.scale; }) return self.scale == other.scale;
                 return true;
               }();
      },
      nb::is_operator(), nb::sig("def __eq__(self, other: object, /) -> bool"));
}

}  // namespace

void BindGeometry(nb::module_& m) {
  nb::class_<Rigid3d> rigid(
      m, "Rigid3d",
      "x_b = R x_a + t, named b_from_a: the pose of a camera is cam_from_world, "
      "x right, y down, z ahead. It does not change.");
  rigid.def(nb::init<>(), "The identity.");
  rigid.def(
      "__init__",
      [](Rigid3d* self, nb::object rotation, const Vec<3>& translation) {
        new (self) Rigid3d(RotationFrom(rotation), translation.value);
      },
      nb::arg("rotation"), nb::arg("translation"),
      nb::sig("def __init__(self, rotation: holba._types.ArrayLike, translation: "
              "holba._types.ArrayLike) -> None"),
      "rotation: a quaternion [x y z w] of any length, or a matrix (3, 3); translation: (3,). "
      "Raises ValueError for what is no rotation.");
  BindCommon(&rigid);
  rigid.def(
      "__mul__", [](const Rigid3d& a, const Rigid3d& b) { return a * b; }, nb::arg("b_from_a"),
      "c_from_a = c_from_b * b_from_a.");
  rigid.def(
      "matrix",
      [](const Rigid3d& self) {
        Eigen::Matrix<double, 3, 4> m;
        m << self.RotationMatrix(), self.translation;
        return ToArray<3, 4>(m);
      },
      "(3, 4) [R t].");
  rigid.def(
      "centre", [](const Rigid3d& self) { return ToArray<3>(self.OriginInA()); },
      "(3,) the origin of b in a: of a cam_from_world the camera's centre in the world.");
  rigid.def("__repr__", [](const Rigid3d& self) {
    return fmt::format("Rigid3d({})", Text(self.rotation, self.translation));
  });
  rigid.def("__getstate__", [](const Rigid3d& self) {
    const auto& q = self.rotation;
    const auto& t = self.translation;
    return nb::make_tuple(q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z());
  });
  rigid.def(
      "__setstate__",
      [](Rigid3d* self, const Vec<7>& v) {
        new (self)
            Rigid3d(Eigen::Quaterniond(Eigen::Vector4d(v.value.head<4>())), v.value.tail<3>());
      },
      nb::sig("def __setstate__(self, state: tuple[float, ...]) -> None"));

  nb::class_<Sim3d> sim(m, "Sim3d", "x_b = s R x_a + t, named b_from_a. It does not change.");
  sim.def(nb::init<>(), "The identity.");
  sim.def(
      "__init__",
      [](Sim3d* self, double scale, nb::object rotation, const Vec<3>& translation) {
        if (!(scale > 0.0) || !std::isfinite(scale))
          throw nb::value_error("expected a scale greater than 0");
        new (self) Sim3d{scale, RotationFrom(rotation), translation.value};
      },
      nb::arg("scale"), nb::arg("rotation"), nb::arg("translation"),
      nb::sig("def __init__(self, scale: float, rotation: holba._types.ArrayLike, translation: "
              "holba._types.ArrayLike) -> None"),
      "rotation and translation as for Rigid3d. Raises ValueError.");
  sim.def_prop_ro("scale", [](const Sim3d& self) { return self.scale; });
  BindCommon(&sim);
  sim.def(
      "__mul__",
      [](const Sim3d& c_from_b, const Sim3d& b_from_a) {
        Sim3d c_from_a;
        c_from_a.scale = c_from_b.scale * b_from_a.scale;
        c_from_a.rotation = (c_from_b.rotation * b_from_a.rotation).normalized();
        c_from_a.translation = c_from_b * b_from_a.translation;
        return c_from_a;
      },
      nb::arg("b_from_a"), "c_from_a = c_from_b * b_from_a.");
  sim.def("transform_pose", &Sim3d::TransformPose, nb::arg("cam_from_old"),
          "cam_from_new of a cam_from_old, for this = new_from_old.");
  sim.def("__repr__", [](const Sim3d& self) {
    return fmt::format("Sim3d(scale={:.6g}, {})", self.scale,
                       Text(self.rotation, self.translation));
  });
  sim.def("__getstate__", [](const Sim3d& self) {
    const auto& q = self.rotation;
    const auto& t = self.translation;
    return nb::make_tuple(self.scale, q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z());
  });
  sim.def(
      "__setstate__",
      [](Sim3d* self, const Vec<8>& v) {
        new (self) Sim3d{v.value[0], Eigen::Quaterniond(Eigen::Vector4d(v.value.segment<4>(1))),
                         v.value.tail<3>()};
      },
      nb::sig("def __setstate__(self, state: tuple[float, ...]) -> None"));
}

}  // namespace holba::python
