#pragma once
#include <dashpot/analysis/damping_region.hpp>
#include <dashpot/analysis/damping_sampled.hpp>
#include <dashpot/apps/cli/arm_option.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/system_report.hpp>
#include <dashpot/controller/robot_types.hpp>

#include <CLI/App.hpp>
#include <functional>
#include <optional>
#include <string>
#include <vector>

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

/// A design in the sampled loop.
struct LoopReport {
  analysis::LoopLimit limit;
  double level = 1;  ///< share of the wanted ratio that the loop allows
  double gain_margin = 0;
  analysis::SampledSpectrum sampled;
};

/// What `dashpot design` says of one system.
struct DesignReport {
  std::string key;  ///< of the matrix: "task_damping", or "damping" if there is no jacobian
  double ratio = 0;
  analysis::TaskImpedance impedance;  ///< with the new damping
  analysis::DampingDesign design;
  Report before;  ///< with the damping that the file gives
  Report after;
  std::optional<LoopReport> loop;  ///< none if the loop is taken for continuous
  std::vector<std::string> notes, assumes;
  std::optional<Eigen::VectorXd> q;  ///< of an arm, rad or m
  std::string rotors;                ///< of an arm: "known" or "unknown"
  std::string drives;                ///< name of the published drives that it has; empty: none
  bool gears = false;                ///< elastic, in `before` and `after`, but not in `design`
};

std::string design_json(const std::vector<DesignReport>& reports, bool as_list);
std::string design_table(const std::vector<DesignReport>& reports, bool as_list);

// Parts of reports on one design and on a region.
double smallest_eigenvalue(const Eigen::MatrixXd& A);
/// Returns the keys of a loop and its margin, without those that follow from them.
Json limit_value(const analysis::LoopLimit& limit, double gain_margin);
/// Returns the matrix in aligned columns; entries within the rounding of the largest are 0.
std::string matrix_text(const Eigen::MatrixXd& matrix);
std::string loop_margin_text(double gain_margin);

/// Touch of the tip in a configuration: a spring, N/m, along a direction; 0: nothing.
struct RegionTouch {
  double stiffness = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
};

/// Result of `dashpot design --region` and `--contact`.
struct RegionReport {
  std::string key;
  double ratio = 0;
  analysis::RegionDesign design;
  std::vector<std::string> assumes = {};
  std::vector<controller::JointVector> postures = {};  ///< of an arm, one for each sample
  std::optional<analysis::LoopLimit> limit = {};  ///< none if the loops are taken for continuous
  std::vector<RegionTouch> touches = {};          ///< one for each sample; none without --contact
  double asked_contact = 0;                       ///< N/m
  double sampled_ratio = 0;  ///< with --contact, the smallest of all loops; 0 without a period
  std::optional<double> contact = {};  ///< up to which the ratio holds, N/m; none: nowhere
};

std::string region_json(const RegionReport& report);
std::string region_table(const RegionReport& report);
/// Returns why the damping is not as wanted: less than a tenth of the ratio somewhere, or more than
/// is allowed. Empty if it is.
std::string region_complaint(const RegionReport& report);
/// The map of the worst mode: a line of headings, then one for each configuration.
std::string region_csv(const RegionReport& report);

/// Designs one matrix for a list of configurations. Returns it though it keeps no margin.
using RegionSearch = std::function<RegionReport(const SystemFile&)>;
/// Returns the smallest ratio of the sampled loops with this matrix; 0 without a period.
using SampledRatio = std::function<double(const SystemFile&, const Eigen::MatrixXd&)>;

/// Finds one matrix that gives the ratio wanted in the air and against every stiffness up to
/// --contact, or up to the largest where it does. `air` has a configuration for each posture of
/// the model.
RegionReport design_for_contact(const DesignOptions& options, const SystemFile& air,
                                const controller::RobotModel& model,
                                const std::vector<controller::JointVector>& postures,
                                const RegionSearch& search, const SampledRatio& ratio);

}  // namespace dashpot::apps
