#include <dashpot/apps/analyze/report.hpp>

#include <initializer_list>
#include <utility>

namespace dashpot::apps {
namespace {

void add(analysis::Motion& sum, const analysis::Motion& part) {
  sum.position += part.position;
  sum.velocity += part.velocity;
  sum.zero_mode_position += part.zero_mode_position;
  sum.zero_mode_velocity += part.zero_mode_velocity;
}

ReportedResponse respond(const SystemEntry& entry, const analysis::System<>& system,
                         const analysis::Spectrum<>& spectrum) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(system.dof());
  const analysis::Response response(system, spectrum);
  ReportedResponse result;
  for (const double time : *entry.times) {
    analysis::Motion motion{
        .position = zero, .velocity = zero, .zero_mode_position = zero, .zero_mode_velocity = zero};
    if (entry.initial_position || entry.initial_velocity) {
      add(motion, response.free(entry.initial_position.value_or(zero),
                                entry.initial_velocity.value_or(zero), time));
    }
    if (entry.impulse) add(motion, response.impulse(*entry.impulse, time));
    if (entry.force) add(motion, response.step(*entry.force, time));
    result.times.push_back(time);
    result.motions.push_back(std::move(motion));
  }
  return result;
}

std::vector<std::string> notes_on(const SystemEntry& entry, const analysis::System<>& system,
                                  const analysis::Spectrum<>& spectrum) {
  std::vector<std::string> notes;
  if (system.dof() > 0 && !entry.impedance.damping && !entry.impedance.task_damping) {
    notes.emplace_back("no damping given: taken as zero");
  }
  if (!spectrum.symmetric) {
    const bool damping = system.damping != system.damping.transpose();
    const bool stiffness = system.stiffness != system.stiffness.transpose();
    notes.push_back(std::string(damping && stiffness ? "damping and stiffness are"
                                : damping            ? "damping is"
                                                     : "stiffness is") +
                    " not symmetric: solved as a general problem");
  }
  if (spectrum.coupled) {
    notes.emplace_back("the damping couples zero modes and vibrations: solved together");
  }
  if (spectrum.status != analysis::Status::kOk) {
    notes.emplace_back(analysis::to_text(spectrum.status));
  }
  const bool causes =
      entry.initial_position || entry.initial_velocity || entry.impulse || entry.force;
  if (causes && !entry.times) notes.emplace_back("no times given: no response computed");
  if (entry.times && !causes) {
    notes.emplace_back(
        "times without initial_position, initial_velocity, impulse or force: nothing moves");
  }
  return notes;
}

}  // namespace

Report make_report(const SystemEntry& entry, const analysis::System<>& system,
                   const analysis::SpectrumOptions& options, analysis::Pivot pivot) {
  Report report;
  report.dof = system.dof();
  report.spectrum = analysis::analyze(system, options);
  report.elimination = analysis::eliminate_zero_modes(system, report.spectrum.zero_modes, pivot);
  if (entry.times) report.response = respond(entry, system, report.spectrum);
  report.notes = notes_on(entry, system, report.spectrum);
  return report;
}

}  // namespace dashpot::apps
