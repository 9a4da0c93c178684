#pragma once
// Conversions between C++ and numpy.

#include <dashpot/analysis/task_space.hpp>

#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/complex.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace dashpot::python {

namespace nb = nanobind;

using OptionalMatrix = std::optional<Eigen::MatrixXd>;
using OptionalVector = std::optional<Eigen::VectorXd>;

/// Each adds its part to the module dashpot._core.
void add_analysis(nb::module_& m);
void add_design(nb::module_& m);
void add_robot(nb::module_& m);
void add_controller(nb::module_& m);
void add_log(nb::module_& m);
void add_audit(nb::module_& m);
void add_identification(nb::module_& m);

/// Returns a numpy array with the entries of a matrix or vector of any storage.
template <class Derived>
nb::object to_array(const Eigen::MatrixBase<Derived>& matrix) {
  using Plain = Eigen::Matrix<typename Derived::Scalar, Eigen::Dynamic,
                              Derived::ColsAtCompileTime == 1 ? 1 : Eigen::Dynamic>;
  return nb::cast(Plain(matrix));
}

/// Returns the array of `of(item)`, a number, for each item of a list.
template <class List, class Of>
nb::object to_column(const List& list, Of of) {
  using Number = decltype(of(*list.begin()));
  Eigen::Matrix<Number, Eigen::Dynamic, 1> column(static_cast<Eigen::Index>(list.size()));
  Eigen::Index i = 0;
  for (const auto& item : list) column[i++] = of(item);
  return nb::cast(column);
}

/// Returns the list of `of(item)`, any Python object, for each item of a list.
template <class List, class Of>
nb::list to_list(const List& list, Of of) {
  nb::list result;
  for (const auto& item : list) result.append(of(item));
  return result;
}

/// Returns an m x 2 array of pairs of complex numbers.
template <class List, class Of>
nb::object to_pairs(const List& list, Of of) {
  using Number = std::decay_t<decltype(of(*list.begin())[0])>;
  Eigen::Matrix<Number, Eigen::Dynamic, Eigen::Dynamic> pairs(
      static_cast<Eigen::Index>(list.size()), 2);
  Eigen::Index i = 0;
  for (const auto& item : list) {
    pairs(i, 0) = of(item)[0];
    pairs(i++, 1) = of(item)[1];
  }
  return nb::cast(pairs);
}

}  // namespace dashpot::python
