// Modes, responses, and the sampled loop, of a system given by matrices.

#include <dashpot/analysis/response.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/python/src/shared.hpp>

namespace dashpot::python {

using analysis::Mode;
using analysis::Motion;
using analysis::SampledLoop;
using analysis::SampledMode;
using analysis::Spectrum;
using analysis::System;
using analysis::TaskImpedance;

nb::dict modes_of(const Spectrum<>& spectrum) {
  const auto& modes = spectrum.modes;
  const auto column = [&](auto member) {
    return to_column(modes, [=](const Mode<>& mode) { return mode.*member; });
  };
  nb::dict result;
  result["natural_frequency"] = column(&Mode<>::natural_frequency);
  result["damping_ratio"] = column(&Mode<>::damping_ratio);
  result["damped_frequency"] = column(&Mode<>::damped_frequency);
  result["eigenvalues"] = to_pairs(modes, [](const Mode<>& mode) { return mode.eigenvalues; });
  result["kind"] = to_list(modes, [](const Mode<>& mode) { return to_text(mode.kind); });
  result["error_bound"] = column(&Mode<>::error_bound);
  result["eigenvalue_bounds"] =
      to_pairs(modes, [](const Mode<>& mode) { return mode.eigenvalue_bounds; });
  result["natural_frequency_bound"] = column(&Mode<>::natural_frequency_bound);
  result["damping_ratio_bound"] = column(&Mode<>::damping_ratio_bound);
  result["backward_error"] = column(&Mode<>::backward_error);
  result["condition"] = column(&Mode<>::condition);
  result["shapes"] = to_list(modes, [](const Mode<>& mode) { return to_array(mode.shapes[0]); });
  result["zero_modes"] = to_array(spectrum.zero_modes.basis.transpose());
  result["zero_mode_rates"] = to_array(spectrum.zero_mode_rates);
  result["coupling"] = spectrum.coupling;
  result["status"] = to_text(spectrum.status);
  return result;
}

nb::dict sampled_modes_of(const analysis::SampledSpectrum& sampled) {
  const auto& modes = sampled.modes;
  const auto column = [&](auto member) {
    return to_column(modes, [=](const SampledMode& mode) { return mode.*member; });
  };
  const auto same = [](const analysis::Complex& z) { return z; };
  nb::dict result;
  result["natural_frequency"] = column(&SampledMode::natural_frequency);
  result["damping_ratio"] = column(&SampledMode::damping_ratio);
  result["damped_frequency"] = column(&SampledMode::damped_frequency);
  result["eigenvalues"] = to_pairs(modes, [](const SampledMode& mode) { return mode.eigenvalues; });
  result["discrete_eigenvalues"] =
      to_pairs(modes, [](const SampledMode& mode) { return mode.discrete_eigenvalues; });
  result["kind"] = to_list(modes, [](const SampledMode& mode) { return to_text(mode.kind); });
  result["zero_modes"] = to_column(sampled.zero_modes, same);
  result["memory"] = to_column(sampled.memory, same);
  result["others"] = to_column(sampled.others, same);
  result["spectral_radius"] = sampled.spectral_radius;
  return result;
}

namespace {

/// A system and its spectrum, computed without the interpreter's lock.
struct Solved {
  System<> system;
  Spectrum<> spectrum;

  Solved(const TaskImpedance& impedance, double soft_frequency)
      : system(analysis::to_joint_space(impedance)) {
    analysis::SpectrumOptions options;
    options.soft_frequency = soft_frequency;
    spectrum = analysis::analyze(system, options);
  }
};

TaskImpedance make_impedance(Eigen::MatrixXd mass, OptionalMatrix damping, OptionalMatrix stiffness,
                             OptionalMatrix jacobian, OptionalMatrix task_damping,
                             OptionalMatrix task_stiffness) {
  TaskImpedance impedance;
  impedance.mass = std::move(mass);
  impedance.damping = std::move(damping);
  impedance.stiffness = std::move(stiffness);
  impedance.jacobian = std::move(jacobian);
  impedance.task_damping = std::move(task_damping);
  impedance.task_stiffness = std::move(task_stiffness);
  return impedance;
}

nb::dict find_modes(const TaskImpedance& impedance, double soft_frequency) {
  std::optional<Solved> solved;
  {
    const nb::gil_scoped_release release;
    solved.emplace(impedance, soft_frequency);
  }
  return modes_of(solved->spectrum);
}

nb::dict respond(const TaskImpedance& impedance, const Eigen::VectorXd& times,
                 OptionalVector position, OptionalVector velocity, OptionalVector impulse,
                 OptionalVector force, const OptionalMatrix& points) {
  const analysis::Cause cause{std::move(position), std::move(velocity), std::move(impulse),
                              std::move(force)};
  const Eigen::Index n = impedance.mass.rows();
  Eigen::MatrixXd q(times.size(), n), qd(times.size(), n), zero(times.size(), n),
      zero_rate(times.size(), n);
  analysis::ModeShares shares;
  {
    const nb::gil_scoped_release release;
    const Solved solved(impedance, analysis::SpectrumOptions().soft_frequency);
    const analysis::Response response(solved.system, solved.spectrum);
    for (Eigen::Index i = 0; i < times.size(); ++i) {
      const Motion motion = response.caused(cause, times[i]);
      q.row(i) = motion.position;
      qd.row(i) = motion.velocity;
      zero.row(i) = motion.zero_mode_position;
      zero_rate.row(i) = motion.zero_mode_velocity;
    }
    shares = analysis::mode_shares(solved.system, solved.spectrum, cause,
                                   points.value_or(Eigen::MatrixXd::Identity(n, n)));
  }
  nb::dict result;
  result["times"] = to_array(times);
  result["position"] = to_array(q);
  result["velocity"] = to_array(qd);
  result["zero_mode_position"] = to_array(zero);
  result["zero_mode_velocity"] = to_array(zero_rate);
  result["energy_share"] = to_array(shares.energy);
  result["zero_mode_share"] = shares.zero_modes;
  result["cross_share"] = shares.cross;
  result["amplitude"] = to_array(shares.amplitude.transpose());
  return result;
}

nb::object receptance(const TaskImpedance& impedance, double omega) {
  Eigen::MatrixXcd H;
  {
    const nb::gil_scoped_release release;
    const Solved solved(impedance, analysis::SpectrumOptions().soft_frequency);
    H = analysis::Response(solved.system, solved.spectrum).receptance(omega);
  }
  return nb::cast(std::move(H));
}

/// `integral`: K_I of controller::integral_memory.
SampledLoop make_loop(double period, int delay, double torque_cutoff, bool difference_velocity,
                      const OptionalMatrix& friction, const OptionalMatrix& gravity_gradient,
                      const OptionalMatrix& integral) {
  SampledLoop loop;
  loop.period = period;
  loop.delay = delay;
  loop.torque_cutoff = torque_cutoff;
  loop.difference_velocity = difference_velocity;
  if (friction) loop.friction = *friction;
  if (gravity_gradient) loop.gravity_gradient = *gravity_gradient;
  if (integral) loop.memory = controller::integral_memory(*integral, period);
  return loop;
}

nb::dict find_sampled_modes(const TaskImpedance& impedance, const SampledLoop& loop) {
  std::optional<Solved> solved;
  analysis::SampledSpectrum sampled;
  double margin = 0;
  {
    const nb::gil_scoped_release release;
    solved.emplace(impedance, analysis::SpectrumOptions().soft_frequency);
    sampled = analysis::sample_loop(solved->system, solved->spectrum, loop);
    margin = analysis::gain_margin(solved->system, solved->spectrum, loop);
  }
  nb::dict result = sampled_modes_of(sampled);
  result["gain_margin"] = margin;
  result["continuous"] = modes_of(solved->spectrum);
  return result;
}

}  // namespace

void add_analysis(nb::module_& m) {
  nb::class_<TaskImpedance>(m, "Impedance", "analysis::TaskImpedance")
      .def(nb::new_(&make_impedance), nb::arg("mass"), nb::arg("damping").none(),
           nb::arg("stiffness").none(), nb::arg("jacobian").none(), nb::arg("task_damping").none(),
           nb::arg("task_stiffness").none());
  nb::class_<SampledLoop>(m, "SampledLoop", "analysis::SampledLoop")
      .def(nb::new_(&make_loop), nb::arg("period"), nb::arg("delay"), nb::arg("torque_cutoff"),
           nb::arg("difference_velocity"), nb::arg("friction").none(),
           nb::arg("gravity_gradient").none(), nb::arg("integral").none());
  m.def("modes", &find_modes, nb::arg("impedance"), nb::arg("soft_frequency"));
  m.def("response", &respond, nb::arg("impedance"), nb::arg("times"), nb::arg("position").none(),
        nb::arg("velocity").none(), nb::arg("impulse").none(), nb::arg("force").none(),
        nb::arg("points").none());
  m.def("receptance", &receptance, nb::arg("impedance"), nb::arg("omega"));
  m.def("sampled_modes", &find_sampled_modes, nb::arg("impedance"), nb::arg("loop"));
}

}  // namespace dashpot::python
