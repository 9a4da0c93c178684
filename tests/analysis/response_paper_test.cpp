// The responses that the source paper prints as formulas: Eqs. 43-51 with Appendices 1 and 2, Eq.
// 64 with Appendix 3. The coefficients are read off computed motions by a linear fit.
#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/task_space.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/paper_examples.hpp>

#include <gtest/gtest.h>

#include <Eigen/QR>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::as_printed;
using testing::near;

/// Coefficients of e^(Re lambda t) cos(Im lambda t), and of sin, for each lambda in turn, one row
/// for each coordinate of motion(t).
template <class Function>
MatrixXd coefficients(const std::vector<Complex>& eigenvalues, const Function& motion) {
  constexpr int kSamples = 60;
  constexpr double kInterval = 0.07;
  MatrixXd functions(kSamples, 2 * static_cast<Eigen::Index>(eigenvalues.size()));
  MatrixXd values(kSamples, motion(0.0).size());
  for (int i = 0; i < kSamples; ++i) {
    const double t = kInterval * i;
    for (std::size_t k = 0; k < eigenvalues.size(); ++k) {
      const Complex exponential = std::exp(eigenvalues[k] * t);
      functions(i, static_cast<Eigen::Index>(2 * k)) = exponential.real();
      functions(i, static_cast<Eigen::Index>(2 * k + 1)) = exponential.imag();
    }
    values.row(i) = motion(t).transpose();
  }
  const MatrixXd fit = functions.colPivHouseholderQr().solve(values);
  EXPECT_TRUE(near(functions * fit, values, 1e-14));
  return fit.transpose();
}

/// Rising frequency, as the paper orders them.
std::vector<Complex> eigenvalues_of(const Spectrum<>& spectrum) {
  std::vector<Complex> result;
  for (int i = spectrum.modes.size() - 1; i >= 0; --i) {
    result.push_back(spectrum.modes[i].eigenvalues[0]);
  }
  return result;
}

VectorXd nonzero_part(const Motion& motion) {
  return motion.position - motion.zero_mode_position;
}

TEST(PaperChain, PaperEqs43To51Appendices1And2Responses) {
  const System<> system = testing::paper_chain();
  const Spectrum<> spectrum = analyze(system);
  const Response response(system, spectrum);
  const auto free = [&](double t) {
    return response.free(VectorXd{{0, 0.03, 0}}, VectorXd::Zero(3), t);
  };
  const auto impulse = [&](double t) { return response.impulse(VectorXd{{1, 0, 0}}, t); };
  EXPECT_TRUE(near(free(0.7).zero_mode_position, VectorXd::Constant(3, 0.004), 1e-16));
  EXPECT_TRUE(near(free(0.7).zero_mode_velocity, VectorXd::Zero(3), 1e-15));
  EXPECT_TRUE(near(impulse(3.0).zero_mode_position, VectorXd::Constant(3, 3.0 / 15), 1e-14));
  EXPECT_TRUE(near(impulse(3.0).zero_mode_velocity, VectorXd::Constant(3, 1.0 / 15), 1e-15));
  const auto printed = [&](const auto& motion) {
    return coefficients(eigenvalues_of(spectrum), motion);
  };
  EXPECT_TRUE(as_printed(printed([&](double t) { return nonzero_part(free(t)); }),
                         {{"-0.002293", "-0.001256", "-0.001707", "0.0003660"},
                          {"0.001563", "0.001344", "0.02444", "0.005522"},
                          {"0.003044", "0.001472", "-0.007044", "-0.002794"}}));
  EXPECT_TRUE(as_printed(printed([&](double t) { return nonzero_part(impulse(t)); }),
                         {{"-0.00004006", "0.001863", "0.00004006", "0.00003087"},
                          {"0.0003357", "-0.001430", "-0.0003357", "-0.0006435"},
                          {"-0.00007018", "-0.002408", "0.00007018", "0.0002080"}}));
  const MatrixXd velocities = printed([&](double t) -> VectorXd {
    const Motion motion = impulse(t);
    return motion.velocity - motion.zero_mode_velocity;
  });
  EXPECT_TRUE(
      as_printed(velocities.topRows(2), {{"0.05755", "-0.004398", "0.0007881", "-0.001875"},
                                         {"-0.04510", "-0.006025", "-0.02157", "0.01967"}}));
}

TEST(PaperArm, PaperEq64Appendix3FreeMotion) {
  const System<> system = to_joint_space(testing::paper_baxter());
  const Spectrum<> spectrum = analyze(system);
  const Response response(system, spectrum);
  const MatrixXd all = coefficients(eigenvalues_of(spectrum), [&](double t) {
    return nonzero_part(response.free(VectorXd{{0, 0.01, 0.01, 0, 0, 0, 0}}, VectorXd::Zero(7), t));
  });
  EXPECT_TRUE(as_printed(
      all.topRows(5), {{"0.0001419", "0.00005122", "-0.003865", "0.0002874", "0.0007177",
                        "-0.0005039", "-0.000004557", "0.00007397", "0.005941", "0.0005485"},
                       {"0.004524", "0.001130", "-0.0006863", "0.0001772", "0.005556", "-0.001375",
                        "0.0003636", "0.001092", "0.0002413", "0.00002118"},
                       {"-0.0002073", "-0.00006735", "0.001370", "-0.0001197", "-0.001267",
                        "0.00001805", "0.00006476", "0.00005911", "0.004758", "0.0004955"},
                       {"-0.009101", "-0.002275", "0.002150", "-0.001027", "0.006914", "0.002837",
                        "-0.0003835", "-0.0008391", "0.0004199", "0.00003642"},
                       {"0.0002824", "0.00002419", "0.01106", "-0.0008921", "-0.002401", "0.001267",
                        "0.00007903", "-0.00008440", "-0.006896", "-0.0005586"}}));
}

}  // namespace
}  // namespace dashpot::analysis
