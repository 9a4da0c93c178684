#pragma once
#include <dashpot/controller/robot_types.hpp>
#include <dashpot/controller/settings.hpp>

#include <string>

namespace dashpot::apps {

extern const char* const kExciteHelp;  ///< what --excite takes

/// A wrench at the tip that makes an arm vibrate a little, so that its modes can be identified.
struct Excitation {
  bool chirp = false;
  int direction = 0;     ///< of the wrench, in the axes of the base: 0 to 5
  double amplitude = 0;  ///< N or N m
  double at = 1;         ///< when it begins, s
  double duration = 0;   ///< of a pulse or of the chirp, s
  double every = 0;      ///< from pulse to pulse, s
  int count = 1;         ///< of pulses
  double from = 0;       ///< frequency at the chirp's beginning, Hz
  double to = 0;         ///< frequency at its end, Hz

  /// Returns the wrench at `time`, s.
  controller::Vector6 wrench(double time) const noexcept;
};

/// Reads "pulse,direction=z,force=5,duration=0.5". Throws controller::InputError with the option as
/// key if it is not as kExciteHelp says, or if the controller would suppress it.
Excitation read_excitation(const std::string& text, const controller::Settings& settings);

}  // namespace dashpot::apps
