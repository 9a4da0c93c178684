#pragma once
#include <dashpot/analysis/damping_sampled.hpp>
#include <dashpot/apps/cli/arm_option.hpp>

#include <CLI/App.hpp>
#include <optional>
#include <string>

namespace dashpot::apps {

/// The command line of `dashpot design`.
struct DesignOptions {
  std::string file;
  ArmOptions arm;           ///< instead of a file
  PosturesOption postures;  ///< of the arm's region
  double ratio = 0;
  std::string structure = "full";
  double soft_frequency = analysis::DampingTarget().soft_frequency;  ///< rad/s
  controller::LoopTiming timing;
  double margin = 2;  ///< gain margin, if there is a period
  std::optional<double> largest_ratio;
  int threads = 0;
  std::string csv;        ///< file for the map of the region; none if empty
  double contact = 0;     ///< stiffness up to which the ratio is to hold, N/m; 0: no contact
  std::string direction;  ///< of the contact; all if empty
  bool near = false;
  bool region = false;
  bool json = false;

  analysis::DampingStructure damping_structure() const;
  analysis::DampingTarget target() const;
};

/// Adds the options to the subcommand; they are written to `options`.
void add_design_options(CLI::App& command, DesignOptions& options);

/// Throws InputError for options that exclude each other.
void check(const DesignOptions& options);

}  // namespace dashpot::apps
