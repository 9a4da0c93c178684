#pragma once
#include <dashpot/controller/plugin.h>
#include <dashpot/analysis/response.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/lcmtypes/modes_t.hpp>

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

namespace dashpot::apps {

/// A mode of a running loop, from the plugin or from a message.
struct LoopMode {
  int label = 0;
  double natural_frequency = 0, damping_ratio = 0, damped_frequency = 0;  // rad/s, 1, rad/s
  std::array<analysis::Complex, 2> eigenvalues;                           // 1/s
  const char* kind = "";
  Eigen::VectorXcd shape;
  double error_bound = 0, natural_frequency_bound = 0, damping_ratio_bound = 0;
  double time = 0;  // s, in a table in CSV
  std::int64_t tick = 0;
};

std::vector<LoopMode> loop_modes(const dashpot_modes& modes);
std::vector<LoopMode> loop_modes(const modes_t& modes);

/// The layout of the table: headings of one line above or below, and the width of shapes.
struct ModesTable {
  const char* label = "label";
  bool above = false;
  std::size_t width = 40;
};

/// Returns the fields of such modes in JSON, CSV and the table.
std::vector<Field<LoopMode>> mode_fields(const ModesTable& table = {});

/// Returns a line with the decay rates, 1/s, of the slow modes that an integral of the springs
/// causes; "" if there are none. `decays` by size.
std::string integral_text(const std::vector<double>& decays);

/// Returns a line with the assumptions of a loop, see controller::loop_assumptions; "" if there are
/// none.
std::string assumes_text(const std::vector<std::string>& names);

/// Returns a table of the modes with their shares in a motion and the amplitudes of `point`, and of
/// the other shares.
std::string shares_table(const analysis::Spectrum<>& spectrum, const analysis::ModeShares& shares,
                         const std::string& point);

/// Returns energy, zero_modes, cross, and amplitude: a list for each mode.
Json shares_json(const analysis::ModeShares& shares);

/// Pairs rows with columns of `distances` so that the sum of squares is least; an unpaired row
/// costs as much as a pair with the distance `farthest`. Returns each row's column; -1 if it is
/// unpaired, such as a row of NaN.
std::vector<int> nearest_pairs(const Eigen::MatrixXd& distances, double farthest);

}  // namespace dashpot::apps
