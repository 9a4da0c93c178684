// Results of a controller, as dicts.

#include <dashpot/analysis/solver_status.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/python/src/shared.hpp>

#include <array>
#include <complex>

namespace dashpot::python {
namespace {

using Map = Eigen::Map<const Eigen::VectorXd>;
using RotationMap = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>;

nb::object pose(const double* position, const double* rotation) {
  Eigen::MatrixXd T_BT = Eigen::MatrixXd::Identity(4, 4);
  T_BT.topLeftCorner(3, 3) = RotationMap(rotation);
  T_BT.topRightCorner(3, 1) = Map(position, 3);
  return nb::cast(std::move(T_BT));
}

/// The first `count` entries of an array.
template <class Item, std::size_t Size>
std::vector<Item> first(const Item (&items)[Size], std::uint32_t count) {  // NOLINT: of C
  return {items, items + count};
}

/// Columns of the numbers that modes of both kinds have.
template <class Item>
nb::dict columns(const std::vector<Item>& modes) {
  nb::dict result;
  result["natural_frequency"] = to_column(modes, [](const Item& m) { return m.natural_frequency; });
  result["damping_ratio"] = to_column(modes, [](const Item& m) { return m.damping_ratio; });
  result["damped_frequency"] = to_column(modes, [](const Item& m) { return m.damped_frequency; });
  result["kind"] = to_list(modes, [](const Item& m) { return dashpot_kind_text(m.kind); });
  return result;
}

/// Reads one of the three results; empty before the first.
template <class Struct, class Read>
bool read_result(dashpot_controller* controller, Read read, Struct& found) {
  found.struct_size = sizeof found;
  const std::int32_t code = read(controller, &found);
  if (code == DASHPOT_NOTHING_YET) return false;
  if (code < DASHPOT_OK) throw std::invalid_argument(dashpot_status_text(code));
  return true;
}

nb::dict counters_of(const dashpot_modes& found) {
  nb::dict result;
  result["tracked"] = found.tracked;
  result["reused"] = found.reused;
  result["direct"] = found.direct;
  result["unchanged"] = found.unchanged;
  result["no_springs"] = found.no_springs;
  result["failed"] = found.failed;
  result["missed"] = found.missed;
  result["no_zero_modes"] = found.no_zero_modes;
  result["no_wrench"] = found.no_wrench;
  result["no_shapes"] = found.no_shapes;
  result["at_rest"] = found.at_rest;
  return result;
}

}  // namespace

nb::object snapshot_of(dashpot_controller* controller) {
  dashpot_snapshot found{};
  if (!read_result(controller, dashpot_read_snapshot, found)) return nb::none();
  const auto joint_values = [&](const double* values) {
    return to_array(Map(values, static_cast<Eigen::Index>(found.joints)));
  };
  nb::dict result;
  result["time"] = found.time;
  result["tick"] = found.tick;
  result["restarts"] = found.restarts;
  result["status"] = found.status;
  result["fault"] = found.fault;
  result["mode"] = found.mode == DASHPOT_MODE_JOINT ? "joint" : "cartesian";
  result["position"] = joint_values(found.position);
  result["velocity"] = joint_values(found.velocity);
  result["torque"] = joint_values(found.torque);
  result["law_torque"] = joint_values(found.law_torque);
  result["reference_joint_position"] = joint_values(found.reference_joint_position);
  result["tip_pose"] = pose(found.tip_position, found.tip_rotation);
  result["reference_tip_pose"] = pose(found.reference_tip_position, found.reference_tip_rotation);
  result["tip_error"] = to_array(Map(found.tip_error, 6));
  result["tip_wrench"] = to_array(Map(found.tip_wrench, 6));
  result["joint_damping_ratio"] = found.joint_damping_ratio;
  result["task_damping_ratio"] = found.task_damping_ratio;
  result["damping_level"] = found.damping_level;
  result["energy_store"] = found.energy_store;
  result["spring_share"] = found.spring_share;
  result["payload_mass"] = found.payload_mass;
  result["payload_center"] = to_array(Map(found.payload_center, 3));
  result["payload_inertia"] = to_array(RotationMap(found.payload_inertia));
  result["tool"] = pose(found.tool_position, found.tool_rotation);
  return result;
}

nb::object modes_of(dashpot_controller* controller) {
  dashpot_modes found{};
  if (!read_result(controller, dashpot_read_modes, found)) return nb::none();
  return to_dict(found);
}

nb::dict to_dict(const dashpot_modes& found) {
  const std::vector<dashpot_mode> modes = first(found.modes, found.count);
  const auto n = static_cast<Eigen::Index>(found.joints);
  nb::dict result = columns(modes);
  result["time"] = found.time;
  result["tick"] = found.tick;
  result["position"] = to_array(Map(found.position, n));
  result["status"] = to_text(static_cast<analysis::Status>(found.status));
  static constexpr std::array<const char*, 3> kOrigins = {"tracked", "reused", "direct"};
  result["origin"] = kOrigins.at(static_cast<std::size_t>(found.origin));
  result["zero_modes"] = found.zero_modes;
  result["counters"] = counters_of(found);
  result["label"] = to_list(modes, [](const dashpot_mode& m) { return m.label; });
  result["eigenvalues"] = to_pairs(modes, [](const dashpot_mode& m) {
    const auto at = [&](int i) {
      return std::complex<double>(m.eigenvalues[i][0], m.eigenvalues[i][1]);
    };
    return std::array{at(0), at(1)};
  });
  result["error_bound"] =
      to_column(modes, [](const dashpot_mode& m) { return m.eigenvalue_bound; });
  result["natural_frequency_bound"] =
      to_column(modes, [](const dashpot_mode& m) { return m.natural_frequency_bound; });
  result["damping_ratio_bound"] =
      to_column(modes, [](const dashpot_mode& m) { return m.damping_ratio_bound; });
  result["shapes"] = to_list(modes, [n](const dashpot_mode& m) {
    Eigen::VectorXcd shape(n);
    shape.real() = Map(m.shape_real, n);
    shape.imag() = Map(m.shape_imag, n);
    return nb::cast(std::move(shape));
  });
  return result;
}

nb::object sampled_modes_of(dashpot_controller* controller) {
  dashpot_sampled_modes found{};
  if (!read_result(controller, dashpot_read_sampled_modes, found)) return nb::none();
  const std::vector<dashpot_sampled_mode> modes = first(found.modes, found.count);
  nb::dict result = columns(modes);
  result["time"] = found.time;
  result["tick"] = found.tick;
  result["position"] = to_array(Map(found.position, static_cast<Eigen::Index>(found.joints)));
  result["status"] = to_text(static_cast<analysis::Status>(found.status));
  result["spectral_radius"] = found.spectral_radius;
  result["gain_margin"] = found.gain_margin;
  result["assumes"] = controller::assumption_names(found.assumes);
  result["continuous_frequency"] =
      to_column(modes, [](const dashpot_sampled_mode& m) { return m.continuous_frequency; });
  result["continuous_ratio"] =
      to_column(modes, [](const dashpot_sampled_mode& m) { return m.continuous_ratio; });
  return result;
}

}  // namespace dashpot::python
