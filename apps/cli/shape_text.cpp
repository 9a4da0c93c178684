#include <dashpot/apps/cli/shape_text.hpp>
#include <dashpot/apps/cli/text_table.hpp>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>
#include <vector>

namespace dashpot::apps {

std::string joint_name(Eigen::Index i) {
  return "q" + std::to_string(i + 1);
}

std::string format_shape(const Eigen::VectorXcd& shape, std::size_t width) {
  constexpr double kSmall = 0.02;
  constexpr double kInStep = 0.176;  // tangent of 10 degrees
  if (shape.size() == 0) return "";
  std::vector<Eigen::Index> order(static_cast<std::size_t>(shape.size()));
  std::iota(order.begin(), order.end(), 0);
  // In single precision, so that equal entries stay in order whatever their rounding errors.
  const Eigen::VectorXf size = shape.cwiseAbs().cast<float>();
  std::stable_sort(order.begin(), order.end(),
                   [&size](Eigen::Index i, Eigen::Index j) { return size[i] > size[j]; });
  std::string text = joint_name(order[0]);
  for (std::size_t k = 1; k < order.size(); ++k) {
    const std::complex<double> ratio = shape[order[k]] / shape[order[0]];
    if (!(std::abs(ratio) >= kSmall) || !std::isfinite(std::arg(ratio))) break;
    const bool in_step = std::abs(ratio.imag()) <= kInStep * std::abs(ratio.real());
    std::string term = in_step && ratio.real() < 0 ? " - " : " + ";
    if (std::abs(ratio) < 1 - 5e-3) term += format_number(std::abs(ratio), 2) + " ";
    term += joint_name(order[k]);
    if (!in_step) {
      term +=
          " (" + std::to_string(std::lround(std::arg(ratio) * 180 / std::numbers::pi)) + " deg)";
    }
    if (text.size() + term.size() + 4 > width) return text + " ...";
    text += term;
  }
  return text;
}

}  // namespace dashpot::apps
