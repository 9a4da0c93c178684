#include <dashpot/apps/design/design_report.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/text_table.hpp>

#include <cmath>
#include <functional>
#include <optional>
#include <vector>

namespace dashpot::apps {
namespace {

using Align = TextTable::Align;
using analysis::ModeGradient;
using analysis::ModeSensitivity;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Number = MatrixXd ModeGradient::*;

/// Gradient by a point mass at the origin of the task: dM = J_v' J_v per kg.
std::optional<double> by_payload(const DesignReport& report, const MatrixXd& by_mass) {
  const auto& J = report.impedance.jacobian;
  if (!J || J->rows() != 6) return std::nullopt;
  const MatrixXd J_v = J->topRows(3);
  return (J_v * by_mass * J_v.transpose()).trace();
}

Json gradient_values(const DesignReport& report, const ModeSensitivity& by, Number number) {
  const auto& J = report.impedance.jacobian;
  Json result = {{"mass", json_rows(by.mass.*number)},
                 {"damping", json_rows(by.damping.*number)},
                 {"stiffness", json_rows(by.stiffness.*number)}};
  if (J) {
    result["task_damping"] = json_rows(analysis::task_gradient(*J, by.damping.*number));
    result["task_stiffness"] = json_rows(analysis::task_gradient(*J, by.stiffness.*number));
  }
  if (const auto payload = by_payload(report, by.mass.*number)) result["payload"] = *payload;
  const VectorXd inertia = (by.mass.*number).diagonal();
  const VectorXd friction = (by.damping.*number).diagonal();
  result["reflected_inertia"] = std::vector<double>(inertia.begin(), inertia.end());
  result["viscous_friction"] = std::vector<double>(friction.begin(), friction.end());
  return result;
}

/// Changes of one mode in percent, one for each column.
using Row = std::function<VectorXd(const ModeSensitivity&, double value)>;

std::string trend_table(const DesignReport& report, Number number, const char* column, Index count,
                        const Row& row) {
  TextTable table({{Align::kRight, {"mode"}}});
  for (Index i = 0; i < count; ++i) {
    table.add_column(Align::kPoint, {column + std::to_string(i + 1)});
  }
  for (std::size_t k = 0; k < report.sensitivities.size(); ++k) {
    const analysis::Mode<>& mode = report.after.spectrum.modes[static_cast<int>(k)];
    const bool ratio = number == &ModeGradient::damping_ratio;
    const VectorXd percent =
        row(report.sensitivities[k], ratio ? mode.damping_ratio : mode.natural_frequency);
    std::vector<std::string> cells = {std::to_string(k + 1)};
    for (const double value : percent) {
      cells.push_back(format_number(std::abs(value) < 5e-4 ? 0 : value, 3));
    }
    table.add_row(std::move(cells));
  }
  return table.text();
}

/// Changes by one percent of each diagonal entry of a matrix of the task, or of the joints.
Row by_diagonal(const DesignReport& report, ModeGradient ModeSensitivity::*coefficient,
                Number number, const VectorXd& entries) {
  return [=, &report](const ModeSensitivity& by, double value) {
    MatrixXd G = (by.*coefficient).*number;
    if (report.impedance.jacobian) G = analysis::task_gradient(*report.impedance.jacobian, G);
    return VectorXd(G.diagonal().cwiseProduct(entries) / value);
  };
}

/// Changes by `size` of each diagonal entry of M or C.
Row by_joint(ModeGradient ModeSensitivity::*coefficient, Number number, double size) {
  return [=](const ModeSensitivity& by, double value) {
    return VectorXd(100 * size * ((by.*coefficient).*number).diagonal() / value);
  };
}

}  // namespace

Json sensitivity_json(const DesignReport& report) {
  Json list = Json::array();
  for (const ModeSensitivity& by : report.sensitivities) {
    list.push_back(
        {{"regular", by.regular},
         {"damping_ratio", gradient_values(report, by, &ModeGradient::damping_ratio)},
         {"natural_frequency", gradient_values(report, by, &ModeGradient::natural_frequency)}});
  }
  return list;
}

std::string sensitivity_text(const DesignReport& report) {
  const bool task = report.impedance.jacobian.has_value();
  const VectorXd damping = report.design.damping.diagonal();
  const VectorXd stiffness =
      (task ? *report.impedance.task_stiffness : *report.impedance.stiffness).diagonal();
  const Index n = report.impedance.mass.rows();
  const auto ratio = &ModeGradient::damping_ratio;
  const auto frequency = &ModeGradient::natural_frequency;
  std::string text =
      "\n  Percent that the ratio changes by, for one percent of a diagonal entry of the "
      "damping\n" +
      trend_table(report, ratio, "entry ", damping.size(),
                  by_diagonal(report, &ModeSensitivity::damping, ratio, damping));
  text +=
      "\n  Percent that the ratio changes by, for one percent of a diagonal entry of the "
      "stiffness\n" +
      trend_table(report, ratio, "entry ", stiffness.size(),
                  by_diagonal(report, &ModeSensitivity::stiffness, ratio, stiffness));
  text +=
      "\n  Percent that the frequency changes by, for one percent of a diagonal entry of the "
      "stiffness\n" +
      trend_table(report, frequency, "entry ", stiffness.size(),
                  by_diagonal(report, &ModeSensitivity::stiffness, frequency, stiffness));
  text +=
      "\n  Percent that the frequency changes by, for 0.001 kg m^2 (kg) more in a joint\n" +
      trend_table(report, frequency, "q", n, by_joint(&ModeSensitivity::mass, frequency, 0.001));
  text +=
      "\n  Percent that the ratio changes by, for 0.1 N m s/rad (N s/m) of friction in a joint\n" +
      trend_table(report, ratio, "q", n, by_joint(&ModeSensitivity::damping, ratio, 0.1));
  if (!task || report.impedance.jacobian->rows() != 6) return text;
  text += "\n  Percent by 0.1 kg more at the tip: of the ratio, of the frequency\n";
  TextTable table(
      {{Align::kRight, {"mode"}}, {Align::kPoint, {"ratio"}}, {Align::kPoint, {"frequency"}}});
  for (std::size_t k = 0; k < report.sensitivities.size(); ++k) {
    const analysis::Mode<>& mode = report.after.spectrum.modes[static_cast<int>(k)];
    const ModeGradient& by = report.sensitivities[k].mass;
    table.add_row(
        {std::to_string(k + 1),
         format_number(10 * *by_payload(report, by.damping_ratio) / mode.damping_ratio, 3),
         format_number(10 * *by_payload(report, by.natural_frequency) / mode.natural_frequency,
                       3)});
  }
  return text + table.text();
}

}  // namespace dashpot::apps
