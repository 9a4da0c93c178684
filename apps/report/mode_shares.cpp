#include <dashpot/apps/report/mode_shares.hpp>
#include <dashpot/apps/report/text_table.hpp>

namespace dashpot::apps {

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

}  // namespace dashpot::apps
