#pragma once
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/task_space.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/text/yaml_document.hpp>

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace dashpot::apps {

using controller::InputError;

/// One system as the user wrote it (SI units; n joints, m task directions). The vectors below have
/// n entries; analysis::to_joint_space checks the matrices.
struct SystemEntry {
  analysis::TaskImpedance impedance;  ///< with the additions of all keys
  /// The robot's part of a sampled loop: friction, which the damping contains, gears, and, of an
  /// arm, the gravity that is compensated.
  analysis::SampledLoop loop;
  std::optional<Eigen::VectorXd> initial_position;  ///< q(0), n
  std::optional<Eigen::VectorXd> initial_velocity;  ///< q'(0), n
  std::optional<Eigen::VectorXd> impulse;           ///< at t = 0, n
  std::optional<Eigen::VectorXd> force;             ///< constant from t = 0 on, n
  std::optional<Eigen::VectorXd> times;             ///< s, none negative, in any order

  std::string prefix;                ///< of the keys in messages: "" or "[2]."
  std::map<std::string, int> lines;  ///< of the keys given

  /// Adds N' D N, the damping D (n x n) of the motions that task_stiffness leaves free. Does
  /// nothing if mass or task do not allow it; analysis::to_joint_space then reports that.
  void add_null_damping(const Eigen::MatrixXd& D);

  /// Returns the system that an impedance, `impedance` or one with another damping, makes with the
  /// gears. Throws analysis::InvalidSystem.
  analysis::System<> system(const analysis::TaskImpedance& given) const;

  /// The error of this entry that an exception of the analysis reports.
  InputError error(const analysis::InvalidSystem& cause) const;
};

/// A file with one system, or with a list of them.
struct SystemFile {
  bool is_list = false;
  std::vector<SystemEntry> entries;
};

/// Reads a YAML or JSON file, standard input if `path` is "-". Throws InputError.
SystemFile read_systems(const std::string& path);

/// The keys of a system and what they mean, for the help text.
extern const char* const kSystemFileHelp;

/// Whether a document is a mapping with this key.
bool has_key(const text::YamlNode& document, std::string_view key);

}  // namespace dashpot::apps
