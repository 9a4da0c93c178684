#pragma once
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/identification/check_model.hpp>

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace dashpot::apps {

/// A mode of the loop with the calibrated arm. Its standard deviations follow from the parameters'.
struct CalibratedMode {
  double natural_frequency = 0, natural_frequency_std = 0;  ///< rad/s
  double damping_ratio = 0, damping_ratio_std = 0;
};

/// The loop that the configuration's gains make with the calibrated arm.
struct CalibratedLoop {
  int delay = 0;                      ///< ticks: the configuration's, or the determined one
  bool delay_found = false;           ///< `delay` was determined
  bool stable = true;                 ///< no discrete eigenvalue reaches the unit circle
  std::vector<CalibratedMode> modes;  ///< by falling frequency
};

struct CheckModelReport {
  identification::ModelCheck check;
  std::vector<std::string> files;
  std::vector<std::string> joints;                      ///< names
  std::string torque_unit, damping_unit, inertia_unit;  ///< of figures of all joints
  std::vector<std::string> notes;
  bool calibrates = false;  ///< of `dashpot calibrate`
  bool payload_known = false;
  controller::JointVector rest, lowest, highest;  ///< mean and range of the records' positions
  CalibratedLoop loop;  ///< at `rest`, with the gains of the configuration
};

/// "12.345 +- 0.012": two digits of the deviation, and as many of the value; "?" if the records do
/// not determine the value.
std::string estimate_text(const identification::Estimate& one);

std::string check_model_table(const CheckModelReport& report);
nlohmann::ordered_json check_model_json(const CheckModelReport& report);

}  // namespace dashpot::apps
