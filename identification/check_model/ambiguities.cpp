#include <dashpot/identification/check_model/findings.hpp>
#include <dashpot/text/printable.hpp>

#include <cmath>

namespace dashpot::identification {
namespace {

using Eigen::Index;

std::string list(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  }
  return text;
}

/// Whether parameter i is of a joint that rests.
bool rests(const TorqueFit& fit, Index i) {
  if (i < fit.payload()) return !fit.moves[i / 3];
  return i >= fit.rotor(0) && i < fit.rest_of_delay() && !fit.moves[i - fit.rotor(0)];
}

void report_unseen(const TorqueFit& fit, ModelCheck& check) {
  for (const auto direction : fit.result.unseen.colwise()) {
    std::vector<std::string> names;
    for (Index i = 0; i < direction.size(); ++i) {
      if (!rests(fit, i) && std::abs(direction[i]) > 0.2) names.push_back(fit.parameter_name(i));
    }
    if (names.empty()) continue;
    check.ambiguities.push_back(
        (names.size() == 1 ? "the records say nothing of " : "the records cannot tell apart ") +
        list(names));
  }
}

void report_alike(const TorqueFit& fit, ModelCheck& check) {
  const Eigen::MatrixXd& covariance = fit.result.covariance;
  const auto nuisance = [&fit](Index i) {
    return fit.linear.prior[i] == kHeld || (i >= fit.payload() + 4 && i < fit.rotor(0)) ||
           fit.unseen(i);
  };
  for (Index i = 0; i <= fit.rest_of_delay(); ++i) {
    for (Index k = i + 1; k <= fit.rest_of_delay(); ++k) {
      if (nuisance(i) || nuisance(k)) continue;
      const double correlation = covariance(i, k) / std::sqrt(covariance(i, i) * covariance(k, k));
      if (std::abs(correlation) < 0.97) continue;
      check.ambiguities.push_back("the records can hardly tell apart " + fit.parameter_name(i) +
                                  " and " + fit.parameter_name(k) + " (correlation " +
                                  text::fixed(correlation, 3) + ")");
    }
  }
}

}  // namespace

void report_ambiguities(const TorqueFit& fit, ModelCheck& check) {
  report_unseen(fit, check);
  for (Index j = 0; j < fit.n; ++j) {
    if (fit.moves[j]) continue;
    check.ambiguities.push_back("joint " + std::to_string(j + 1) +
                                " hardly moves: its friction is not known, and may be in its "
                                "offset");
  }
  report_alike(fit, check);
}

}  // namespace dashpot::identification
