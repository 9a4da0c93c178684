#include <dashpot/controller/plugin_fields.hpp>
#include <dashpot/lcmtypes/plugin_samples.hpp>

namespace dashpot::lcmtypes {
namespace {

using controller::JointVector;

/// Copies fields from C structs of n joints.
struct FromC {
  std::uint32_t n;

  static JointVector vector(const double* from, std::uint32_t size) noexcept {
    return Eigen::Map<const Eigen::VectorXd>(from, size);
  }
  template <class To, class From>
  void operator()(To& to, const From& from) const noexcept {
    if constexpr (std::is_same_v<To, JointVector>) {
      to = vector(from, n);
    } else if constexpr (std::is_array_v<From>) {
      constexpr auto kRows = To::RowsAtCompileTime, kCols = To::ColsAtCompileTime;
      to = Eigen::Map<const Eigen::Matrix<double, kCols, kRows>>(from).transpose();
    } else {
      to = static_cast<To>(from);
    }
  }
  void shape(controller::VibrationMode& to, const dashpot_mode& from) const noexcept {
    for (std::size_t k = 0; k < 2; ++k) {
      to.eigenvalues[k] = {from.eigenvalues[k][0], from.eigenvalues[k][1]};
    }
    to.shape.resize(n);
    to.shape.real() = vector(from.shape_real, n);
    to.shape.imag() = vector(from.shape_imag, n);
  }
};

}  // namespace

void fill(const dashpot_snapshot& from, controller::Snapshot& to) noexcept {
  controller::copy_fields(to, from, FromC{from.joints});
  to.joint_error = to.reference_position - to.position;
}

void fill(const dashpot_modes& from, ModesSample& to) noexcept {
  controller::copy_fields(to.vibration, from, FromC{from.joints});
}

void fill(const dashpot_sampled_modes& from, SampledModesSample& to) noexcept {
  controller::copy_fields(to.vibration, from, FromC{from.joints});
}

}  // namespace dashpot::lcmtypes
