#pragma once
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

namespace dashpot::analysis {

/// p + n: elastic coordinates, then velocities.
using Column = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxWidth, 1>;
using Coefficients = Eigen::Map<const Eigen::MatrixXd>;

/// The energy metric times x.
inline Column energy_image(const SymmetricPencil& pencil, const Column& x) {
  const int n = pencil.joints, p = pencil.rank;
  Column image = x;
  image.tail(n) = Coefficients(pencil.M, n, n).lazyProduct(x.tail(n));
  if (!pencil.factored) image.head(p) = Coefficients(pencil.W, p, p).lazyProduct(x.head(p));
  return image;
}

/// The two inner products of states: elastic coordinates' plus or minus velocities'.
struct Products {
  double elastic = 0, velocities = 0;
  double indefinite() const { return elastic - velocities; }
  double energy() const { return elastic + velocities; }
};

inline Products products(const SymmetricPencil& pencil, const Column& x, const Column& y) {
  const Column image = energy_image(pencil, y);
  return {x.head(pencil.rank).dot(image.head(pencil.rank)),
          x.tail(pencil.joints).dot(image.tail(pencil.joints))};
}

/// The state with position u and velocity v.
template <typename Position, typename Velocity>
Column state(const SymmetricPencil& pencil, const Position& u, const Velocity& v) {
  const int n = pencil.joints, p = pencil.rank;
  Column x(pencil.states());
  x.tail(n) = v;
  if (pencil.factored) {
    x.head(p) = Coefficients(pencil.W, p, n).lazyProduct(u);
  } else {
    x.head(p) = u;
  }
  return x;
}

/// A mode's two columns.
struct Plane {
  Column first, second;
};

/// Returns the columns of mode i.
inline Plane plane_of(const SymmetricPencil& pencil, const BlockEigenbasis& basis, int i) {
  Plane plane{Column(pencil.states()), Column(pencil.states())};
  for (int row = 0; row < pencil.states(); ++row) {
    plane.first[row] = basis.Z(row, basis.first(i));
    plane.second[row] = basis.Z(row, basis.second(i));
  }
  return plane;
}

inline void set_column(int j, const Column& x, BlockEigenbasis& basis) {
  for (int row = 0; row < x.size(); ++row) basis.Z(row, j) = x[row];
}

}  // namespace dashpot::analysis
