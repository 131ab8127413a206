// SPDX-License-Identifier: BSD-3-Clause
// Arrays between C++ and numpy: small vectors of arguments, arrays that own their numbers, and
// views of numbers that lie in a model.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace holba::python {

namespace nb = nanobind;

// What functions and properties return; it owns its numbers or knows who does. A const scalar is an
// array that cannot be written.
template <typename T, nb::ssize_t... kShape>
struct Array : nb::ndarray<nb::numpy, T, nb::shape<kShape...>> {
  using Base = nb::ndarray<nb::numpy, T, nb::shape<kShape...>>;
  using Base::Base;
};

// What functions take: any array of such numbers (converted where it has others), row by row.
template <typename T, nb::ssize_t... kShape>
using ArrayArg = nb::ndarray<const T, nb::shape<kShape...>, nb::c_contig, nb::device::cpu>;

// An argument of N numbers: an array, a list, a tuple.
template <int N>
struct Vec {
  Eigen::Matrix<double, N, 1> value;
};

// The array owns the numbers.
template <typename A, typename T>
A Owned(std::vector<T> values, std::initializer_list<size_t> shape) {
  auto held = std::make_unique<std::vector<T>>(std::move(values));
  T* data = held->data();
  nb::capsule owner(held.get(), [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  held.release();
  return A(data, shape, owner);
}
template <typename T>
Array<T, -1> Owned1(std::vector<T> values) {
  const size_t size = values.size();
  return Owned<Array<T, -1>>(std::move(values), {size});
}
template <nb::ssize_t kColumns, typename T>
Array<T, -1, kColumns> OwnedRows(std::vector<T> values) {
  const size_t rows = values.size() / kColumns;
  return Owned<Array<T, -1, kColumns>>(std::move(values), {rows, size_t{kColumns}});
}
template <int N>
Array<double, N> ToArray(const Eigen::Matrix<double, N, 1>& v) {
  return Owned<Array<double, N>>(std::vector<double>(v.data(), v.data() + N), {size_t{N}});
}
template <int kRows, int kColumns>
Array<double, kRows, kColumns> ToArray(const Eigen::Matrix<double, kRows, kColumns>& m) {
  std::vector<double> values;
  for (int r = 0; r < m.rows(); ++r) {
    for (int c = 0; c < m.cols(); ++c) values.push_back(m(r, c));
  }
  return Owned<Array<double, kRows, kColumns>>(
      std::move(values), {static_cast<size_t>(m.rows()), static_cast<size_t>(m.cols())});
}

}  // namespace holba::python

NAMESPACE_BEGIN(NB_NAMESPACE)
NAMESPACE_BEGIN(detail)
// As that of ndarray, but for properties, which would make their object the owner.
template <typename T, nanobind::ssize_t... kShape>
struct type_caster<holba::python::Array<T, kShape...>> {
  using Returned = holba::python::Array<T, kShape...>;
  NB_TYPE_CASTER(Returned, type_caster<typename Returned::Base>::Name)

  bool from_python(handle, uint32_t, cleanup_list*) noexcept { return false; }
  static handle from_cpp(const Returned& array, rv_policy, cleanup_list* cleanup) noexcept {
    return type_caster<typename Returned::Base>::from_cpp(array, rv_policy::automatic, cleanup);
  }
};
template <int N>
struct type_caster<holba::python::Vec<N>> {
  NB_TYPE_CASTER(holba::python::Vec<N>, const_name("holba._types.ArrayLike"))

  bool from_python(handle src, uint32_t, cleanup_list*) noexcept {
    if (!PySequence_Check(src.ptr()) || PySequence_Size(src.ptr()) != N) {
      PyErr_Clear();
      return false;
    }
    for (int i = 0; i < N; ++i) {
      PyObject* item = PySequence_GetItem(src.ptr(), i);
      const double x = item != nullptr ? PyFloat_AsDouble(item) : -1.0;
      Py_XDECREF(item);
      if (PyErr_Occurred() != nullptr) {
        PyErr_Clear();
        return false;
      }
      value.value[i] = x;
    }
    return true;
  }
  static handle from_cpp(const holba::python::Vec<N>&, rv_policy, cleanup_list*) noexcept {
    return none().release();
  }
};
NAMESPACE_END(detail)
NAMESPACE_END(NB_NAMESPACE)
