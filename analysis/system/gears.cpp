#include <dashpot/analysis/base/require.hpp>
#include <dashpot/analysis/gears.hpp>

#include <cmath>
#include <limits>

namespace dashpot::analysis {

using Eigen::Index;

Gears::Gears(Data data) : data_(std::move(data)), n_(data_.stiffness.size()) {
  require("gears",
          data_.damping.size() == n_ && data_.inertia.size() == n_ &&
              (data_.friction.size() == 0 ||
               (data_.friction.rows() == n_ && data_.friction.cols() == n_)),
          "stiffness, damping and inertia have n entries, friction is n x n");
  for (Index i = 0; i < n_; ++i) {
    motor_.push_back(i);
    require("gears", data_.stiffness[i] > 0 && data_.damping[i] >= 0,
            "stiffness has to be positive, and damping must not be negative");
    if (std::isinf(data_.stiffness[i])) continue;
    require("gears", data_.inertia[i] > 0, "an elastic joint needs the inertia of its motor");
    motor_.back() = n_ + count();
    joints_.push_back(static_cast<int>(i));
  }
  require("gears", coordinates() <= kMaxDof,
          std::to_string(n_) + " joints, of which at most " +
              std::to_string(std::max<Index>(0, kMaxDof - n_)) + " can be elastic");
}

/// W' = [W S_m; sqrt(K_J) (theta - q)]
template <int N>
void Gears::extend_factor(System<N>& system) const noexcept {
  const StiffnessFactor<N> W = system.stiffness_factor;
  const Index rows = W.rows();
  system.stiffness_factor.setZero(rows + count(), coordinates());
  for (Index j = 0; j < n_; ++j) {
    for (Index i = 0; i < rows; ++i) system.stiffness_factor(i, motor(j)) = W(i, j);
  }
  for (Index k = 0; k < count(); ++k) {
    const double root = std::sqrt(data_.stiffness[joint(k)]);
    system.stiffness_factor(rows + k, joint(k)) = -root;
    system.stiffness_factor(rows + k, n_ + k) = root;
  }
}

template <int N>
void Gears::extend_damping(const Square<kMaxDof>& passive, System<N>& system) const noexcept {
  Square<kMaxDof> C = system.damping;
  C -= passive;
  if (data_.friction.size() > 0) C -= data_.friction;
  system.damping.setZero(coordinates(), coordinates());
  add_on_links(passive, system.damping);
  add_of_controller(C, system.damping);
  add_friction(system.damping);
  add_gears(data_.damping, system.damping);
}

template <int N>
void Gears::extend(const PassivePart& passive, System<N>& system) const noexcept {
  const bool factored =
      !data_.link_sensor && system.stiffness_factor.rows() > 0 && passive.stiffness.isZero(0);
  extend_mass(system.mass);
  extend_damping(passive.damping, system);
  Square<kMaxDof> K = system.stiffness;
  K -= passive.stiffness;
  system.stiffness.setZero(coordinates(), coordinates());
  add_on_links(passive.stiffness, system.stiffness);
  add_of_controller(K, system.stiffness);
  add_gears(data_.stiffness, system.stiffness);
  if (factored) {
    extend_factor(system);
  } else {
    system.stiffness_factor.resize(0, coordinates());
  }
  system.has_low_words = false;
  for (auto* error : {&system.mass_error, &system.damping_error, &system.stiffness_error}) {
    error->resize(0, 0);
  }
}

template void Gears::extend(const PassivePart&, System<kMaxDof>&) const noexcept;
template void Gears::extend(const PassivePart&, System<kDynamic>&) const noexcept;

void Gears::extend_factored(System<kMaxDof>& system) const noexcept {
  const Square<kMaxDof> none = Square<kMaxDof>::Zero(n_, n_);
  extend_mass(system.mass);
  extend_damping(none, system);
  if (!data_.link_sensor) {
    extend_factor(system);
    return;
  }
  const auto& W = system.stiffness_factor;
  Square<kMaxDof> K(n_, n_);
  for (Index j = 0; j < n_; ++j) {
    for (Index i = 0; i <= j; ++i) {
      double sum = 0;
      for (Index k = 0; k < W.rows(); ++k) sum += W(k, i) * W(k, j);
      K(i, j) = K(j, i) = sum;
    }
  }
  system.stiffness.setZero(coordinates(), coordinates());
  add_of_controller(K, system.stiffness);
  add_gears(data_.stiffness, system.stiffness);
  system.stiffness_factor.resize(0, coordinates());
}

}  // namespace dashpot::analysis
