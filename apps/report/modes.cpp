#include <dashpot/apps/report/modes.hpp>

#include <algorithm>
#include <limits>
#include <numbers>

namespace dashpot::apps {
namespace {

using Align = TextTable::Align;

const char* kind_name(int kind) {
  return analysis::to_text(static_cast<analysis::ModeKind>(kind));
}

template <class Numbers>
Eigen::VectorXcd complex_vector(const Numbers& real, const Numbers& imag, std::size_t n) {
  Eigen::VectorXcd vector(static_cast<Eigen::Index>(n));
  for (std::size_t k = 0; k < n; ++k) vector[static_cast<Eigen::Index>(k)] = {real[k], imag[k]};
  return vector;
}

}  // namespace

std::vector<LoopMode> loop_modes(const dashpot_modes& modes) {
  std::vector<LoopMode> result;
  for (std::uint32_t i = 0; i < modes.count; ++i) {
    const dashpot_mode& mode = modes.modes[i];
    const auto& [first, second] = mode.eigenvalues;
    result.push_back({mode.label,
                      mode.natural_frequency,
                      mode.damping_ratio,
                      mode.damped_frequency,
                      {analysis::Complex(first[0], first[1]), {second[0], second[1]}},
                      kind_name(mode.kind),
                      complex_vector(mode.shape_real, mode.shape_imag, modes.joints),
                      mode.eigenvalue_bound,
                      mode.natural_frequency_bound,
                      mode.damping_ratio_bound});
  }
  return result;
}

std::vector<LoopMode> loop_modes(const modes_t& modes) {
  std::vector<LoopMode> result;
  for (std::size_t i = 0; i < modes.label.size(); ++i) {
    const auto &re = modes.eigenvalue_real[i], &im = modes.eigenvalue_imag[i];
    result.push_back({modes.label[i],
                      modes.natural_frequency[i],
                      modes.damping_ratio[i],
                      modes.damped_frequency[i],
                      {analysis::Complex(re[0], im[0]), {re[1], im[1]}},
                      kind_name(modes.kind[i]),
                      complex_vector(modes.shape_real[i], modes.shape_imag[i],
                                     static_cast<std::size_t>(modes.n)),
                      modes.eigenvalue_bound[i],
                      modes.natural_frequency_bound[i],
                      modes.damping_ratio_bound[i],
                      0,
                      modes.tick});
  }
  return result;
}

std::vector<Field<LoopMode>> mode_fields(const ModesTable& table) {
  const auto one = [&](const char* name) {
    return table.above ? std::vector<std::string>{name, ""} : std::vector<std::string>{"", name};
  };
  const auto part = [](std::size_t i, bool real) {
    return [=](const LoopMode& m) {
      return Json(real ? m.eigenvalues[i].real() : m.eigenvalues[i].imag());
    };
  };
  const auto of = [](auto LoopMode::*member) {
    return [member](const LoopMode& m) { return Json(m.*member); };
  };
  return {{"", "time [s]", {}, of(&LoopMode::time)},
          {"", "tick", {}, of(&LoopMode::tick)},
          {"label", "label", {Align::kRight, one(table.label)}, of(&LoopMode::label)},
          {"eigenvalues",
           "",
           {},
           [](const LoopMode& m) {
             return Json::array({json_complex(m.eigenvalues[0]), json_complex(m.eigenvalues[1])});
           }},
          {"natural_frequency",
           "natural_frequency [rad/s]",
           {Align::kPoint, {"natural", "rad/s"}},
           of(&LoopMode::natural_frequency)},
          {"",
           "",
           {Align::kPoint, {"frequency", "Hz"}},
           [](const LoopMode& m) { return Json(m.natural_frequency / (2 * std::numbers::pi)); }},
          {"damping_ratio",
           "damping_ratio",
           {Align::kPoint, {"damping", "ratio"}},
           of(&LoopMode::damping_ratio)},
          {"", "real_1 [1/s]", {}, part(0, true)},
          {"", "imag_1 [1/s]", {}, part(0, false)},
          {"", "real_2 [1/s]", {}, part(1, true)},
          {"", "imag_2 [1/s]", {}, part(1, false)},
          {"damped_frequency", "", {}, of(&LoopMode::damped_frequency)},
          {"kind", "kind", {Align::kLeft, one("kind")}, of(&LoopMode::kind)},
          {"",
           "",
           {Align::kRight, {"error <", "rad/s"}, kBound},
           of(&LoopMode::natural_frequency_bound)},
          {"shape",
           "",
           {Align::kLeft, one("shape")},
           [](const LoopMode& m) { return json_list(m.shape); },
           [width = table.width](const LoopMode& m) { return format_shape(m.shape, width); }},
          {"error_bound", "", {}, of(&LoopMode::error_bound)},
          {"natural_frequency_bound",
           "natural_frequency_bound [rad/s]",
           {},
           of(&LoopMode::natural_frequency_bound)},
          {"damping_ratio_bound", "damping_ratio_bound", {}, of(&LoopMode::damping_ratio_bound)}};
}

std::string integral_text(const std::vector<double>& decays) {
  if (decays.empty()) return "";
  const bool one = decays.size() == 1;
  std::string text = "  The integral of the springs makes " + std::to_string(decays.size()) +
                     (one ? " slow mode, which decays at " : " slow modes, which decay at ") +
                     format_number(decays.front(), 3);
  if (!one) text += " to " + format_number(decays.back(), 3);
  return text + " 1/s.\n";
}

std::string assumes_text(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "  Assumes: " : ", ") + name;
  return text.empty() ? "" : text + ".\n";
}

std::string shares_table(const analysis::Spectrum<>& spectrum, const analysis::ModeShares& shares,
                         const std::string& point) {
  TextTable table({{TextTable::Align::kRight, {"", "mode"}},
                   {TextTable::Align::kPoint, {"natural", "rad/s"}},
                   {TextTable::Align::kPoint, {"damping", "ratio"}},
                   {TextTable::Align::kPoint, {"energy", "%"}},
                   {TextTable::Align::kLeft, {"amplitudes of", point}}});
  for (int i = 0; i < spectrum.modes.size(); ++i) {
    const analysis::Mode<>& mode = spectrum.modes[i];
    table.add_row({std::to_string(i + 1), format_number(mode.natural_frequency, 5),
                   format_number(mode.damping_ratio, 4), format_number(100 * shares.energy[i], 3),
                   format_list(shares.amplitude.col(i), 3)});
  }
  std::string text = table.text();
  if (shares.zero_modes > 1e-12) {
    text += "  Zero modes: " + format_number(100 * shares.zero_modes, 3) + " % of the energy.\n";
  }
  return text +
         "  Cross terms, which no mode has by itself: " + format_number(100 * shares.cross, 2) +
         " %.\n";
}

Json shares_json(const analysis::ModeShares& shares) {
  return {{"energy", json_list(shares.energy)},
          {"zero_modes", shares.zero_modes},
          {"cross", shares.cross},
          {"amplitude", json_rows(shares.amplitude.transpose())}};
}

namespace {

/// Returns the column of each row for which the sum of the costs is least: the Hungarian method,
/// which adds one row after the other along the cheapest path of exchanges.
std::vector<int> assign(const Eigen::MatrixXd& cost) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const auto n = static_cast<int>(cost.rows());
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  Eigen::VectorXd of_row = Eigen::VectorXd::Zero(n), of_column = Eigen::VectorXd::Zero(n + 1);
  std::vector<int> row_of(at(n + 1), -1);  // column n stands for the row that is added
  for (int added = 0; added < n; ++added) {
    std::vector<double> least(at(n), kInfinity);
    std::vector<int> from(at(n), n);
    std::vector<bool> reached(at(n + 1), false);
    int column = n;
    row_of[at(n)] = added;
    while (row_of[at(column)] >= 0) {
      reached[at(column)] = true;
      const int row = row_of[at(column)];
      int next = n;
      double step = kInfinity;
      for (int k = 0; k < n; ++k) {
        if (reached[at(k)]) continue;
        const double reduced = cost(row, k) - of_row[row] - of_column[k];
        if (reduced < least[at(k)]) least[at(k)] = reduced, from[at(k)] = column;
        if (least[at(k)] < step) step = least[at(k)], next = k;
      }
      for (int k = 0; k <= n; ++k) {
        if (reached[at(k)]) {
          of_row[row_of[at(k)]] += step;
          of_column[k] -= step;
        } else {
          least[at(k)] -= step;
        }
      }
      column = next;
    }
    while (column != n) {
      row_of[at(column)] = row_of[at(from[at(column)])];
      column = from[at(column)];
    }
  }
  std::vector<int> column_of(at(n));
  for (int k = 0; k < n; ++k) column_of[at(row_of[at(k)])] = k;
  return column_of;
}

}  // namespace

std::vector<int> nearest_pairs(const Eigen::MatrixXd& distances, double farthest) {
  const Eigen::Index rows = distances.rows(), columns = distances.cols();
  const Eigen::Index size = std::max(rows, columns);
  Eigen::MatrixXd cost = Eigen::MatrixXd::Constant(size, size, farthest * farthest);
  const auto near = [&](Eigen::Index i, Eigen::Index k) { return distances(i, k) < farthest; };
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index k = 0; k < columns; ++k) {
      if (near(i, k)) cost(i, k) = distances(i, k) * distances(i, k);
    }
  }
  std::vector<int> pairs = assign(cost);
  pairs.resize(static_cast<std::size_t>(rows));
  for (Eigen::Index i = 0; i < rows; ++i) {
    int& k = pairs[static_cast<std::size_t>(i)];
    if (k >= columns || !near(i, k)) k = -1;
  }
  return pairs;
}

}  // namespace dashpot::apps
