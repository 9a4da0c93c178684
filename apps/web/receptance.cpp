#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/web/receptance.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/settings.hpp>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

namespace dashpot::apps {

using controller::InputError;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd consistent_inverse(const MatrixXd& M, const MatrixXd& J) {
  const Eigen::LLT<MatrixXd> mass(M);
  const MatrixXd X = mass.matrixL().solve(J.transpose());  // J M^-1 J' = X'X
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> solve;
  solve.setThreshold(1e-6);
  solve.compute(X.transpose());
  return mass.matrixU().solve(solve.pseudoInverse());
}

Place place_of(const std::string& place, const MatrixXd& M, const MatrixXd& J) {
  const bool tip = place.starts_with("tip/"), joint = place.starts_with("joint/");
  const std::string digits = place.substr(std::min(place.find('/') + 1, place.size()));
  const bool number = !digits.empty() && digits.size() < 3 &&
                      digits.find_first_not_of("0123456789") == std::string::npos;
  const int i = number ? std::stoi(digits) : -1;
  const Eigen::Index n = M.rows();
  if (joint && i >= 0 && i < n) return {VectorXd::Unit(n, i), VectorXd::Unit(n, i), "rad/(N m)"};
  if (!tip || i < 0 || i > 5) throw InputError("place", "there is no such place on this arm");
  return {J.row(i), consistent_inverse(M, J).col(i), i < 3 ? "m/N" : "rad/(N m)"};
}

Json receptance_json(const analysis::System<>& system, const analysis::Spectrum<>& spectrum,
                     const Eigen::RowVectorXd& row, const std::string& unit) {
  double slowest = 10, fastest = 10;
  Json natural = Json::array();
  for (const analysis::Mode<>& mode : spectrum.modes) {
    const double frequency = mode.natural_frequency;
    natural.push_back(frequency);
    if (!std::isfinite(frequency) || frequency < controller::kSoftFrequency) continue;
    slowest = std::min(slowest, frequency);
    fastest = std::max(fastest, frequency);
  }
  constexpr int kPoints = 241;
  std::vector<double> omegas, magnitudes, phases;
  double phase = 0;
  const Eigen::VectorXcd force = row.transpose();
  for (int i = 0; i < kPoints; ++i) {
    const double omega = 0.1 * slowest * std::pow(100 * fastest / slowest, i / (kPoints - 1.0));
    const std::complex<double> s(0, omega);
    const Eigen::MatrixXcd dynamic = s * s * system.mass + s * system.damping + system.stiffness;
    const std::complex<double> h = row * dynamic.partialPivLu().solve(force);
    phase += std::remainder(std::arg(h) - phase, 2 * M_PI);
    omegas.push_back(omega);
    magnitudes.push_back(std::abs(h));
    phases.push_back(phase);
  }
  return {{"omega", omegas},
          {"magnitude", magnitudes},
          {"phase", phases},
          {"unit", unit},
          {"natural_frequency", natural}};
}

}  // namespace dashpot::apps
