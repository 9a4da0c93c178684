#include <dashpot/analysis/null_damping.hpp>
#include <dashpot/apps/cli/system_file.hpp>
#include <dashpot/text/setting_reader.hpp>

#include <Eigen/Cholesky>
#include <array>
#include <limits>
#include <stdexcept>
#include <utility>

namespace dashpot::apps {
namespace {

using text::YamlMapping;
using text::YamlNode;

constexpr auto kKeys =
    text::key_list("mass", "damping", "stiffness", "jacobian", "task_damping", "task_stiffness",
                   "jacobian_rate", "jacobian_derivatives", "wrench", "reflected_inertia",
                   "gear_stiffness", "gear_damping", "position_sensor", "payload", "null_damping",
                   "initial_position", "initial_velocity", "impulse", "force", "times");

std::optional<Eigen::VectorXd> joint_vector(const YamlMapping& keys, std::string_view key,
                                            Eigen::Index n) {
  std::optional<Eigen::VectorXd> result = keys.vector(key);
  if (result && result->size() != n) {
    throw keys.error(key, "has " + std::to_string(result->size()) + " entries, mass has " +
                              std::to_string(n) + " rows");
  }
  return result;
}

/// A Jacobian-like matrix; [] has no rows but n columns.
std::optional<Eigen::MatrixXd> task_rows(const YamlMapping& keys, std::string_view key,
                                         Eigen::Index n) {
  std::optional<Eigen::MatrixXd> result = keys.matrix(key);
  if (result && result->rows() == 0) result->resize(0, n);
  return result;
}

/// n numbers, none negative.
std::optional<Eigen::VectorXd> per_joint(const YamlMapping& keys, std::string_view key,
                                         Eigen::Index n) {
  std::optional<Eigen::VectorXd> result = joint_vector(keys, key, n);
  if (result && n > 0 && result->minCoeff() < 0) throw keys.error(key, "has a negative entry");
  return result;
}

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

/// sum += more, which is right within more_error; the uncertainty of the sum is added to `error`.
void add(const Eigen::MatrixXd& more, const Eigen::MatrixXd& more_error, Eigen::MatrixXd& sum,
         Eigen::MatrixXd& error) {
  sum += more;
  if (error.rows() == 0) error.setZero(sum.rows(), sum.cols());
  error += more_error + kEpsilon * sum.cwiseAbs();
}

/// Elastic gears between the motors and the links of the joints.
void read_gears(const YamlMapping& keys, SystemEntry& entry) {
  const Eigen::Index n = entry.impedance.mass.rows();
  std::vector<std::string> units(static_cast<std::size_t>(n));
  Eigen::VectorXd stiffness(n), damping = Eigen::VectorXd::Zero(n);
  for (const char* key : {"gear_damping", "position_sensor"}) {
    if (keys.has(key) && !keys.has("gear_stiffness")) throw keys.error(key, "needs gear_stiffness");
  }
  if (!keys.has("gear_stiffness")) return;
  const auto inertia = per_joint(keys, "reflected_inertia", n);
  if (!inertia) throw keys.error("gear_stiffness", "needs reflected_inertia, of the motors");
  constexpr double kRigid = std::numeric_limits<double>::infinity();
  text::read_numbers(keys, "gear_stiffness", units, text::kPositive, stiffness, kRigid);
  text::read_numbers(keys, "gear_damping", units, text::kNotNegative, damping);
  bool link = false;
  text::read_choice(
      keys, "position_sensor",
      std::array<std::pair<std::string_view, bool>, 2>{{{"motor", false}, {"link", true}}}, link);
  try {
    entry.loop.gears = analysis::Gears({stiffness, damping, *inertia, entry.loop.friction, link});
  } catch (const std::invalid_argument& error) {
    throw keys.error("gear_stiffness", error.what());
  }
}

/// Additions to the given matrices: inertia of drives and of a point mass at the origin of the
/// task, and damping in the null space.
void read_additions(const YamlMapping& keys, SystemEntry& entry) {
  analysis::TaskImpedance& impedance = entry.impedance;
  const Eigen::Index n = impedance.mass.rows();
  if (impedance.damping) entry.loop.friction = *impedance.damping;
  const bool square = impedance.mass.cols() == n;
  if (const auto inertia = per_joint(keys, "reflected_inertia", n); inertia && square) {
    add(inertia->asDiagonal(), Eigen::MatrixXd::Zero(n, n), impedance.mass, impedance.mass_error);
  }
  if (square) read_gears(keys, entry);
  if (const YamlNode* node = keys.find("payload")) {
    const double payload = keys.quantity("payload", *node, "kg", "");
    if (payload < 0) throw keys.error("payload", "is negative");
    const auto& J = impedance.jacobian;
    if (!J || J->rows() != 6 || J->cols() != n) {
      throw keys.error("payload", "needs a jacobian of six rows");
    }
    if (square) {
      const Eigen::MatrixXd J_v = J->topRows(3), size = J_v.cwiseAbs();
      add(payload * J_v.transpose() * J_v, 4 * kEpsilon * payload * size.transpose() * size,
          impedance.mass, impedance.mass_error);
    }
  }
  if (const auto damping = per_joint(keys, "null_damping", n)) {
    if (!impedance.jacobian || !impedance.task_stiffness) {
      throw keys.error("null_damping", "needs jacobian and task_stiffness");
    }
    entry.add_null_damping(damping->asDiagonal());
  }
}

SystemEntry read_entry(const YamlNode& node, const std::string& prefix) {
  const YamlMapping keys(node, prefix, kKeys);
  SystemEntry entry;
  entry.prefix = prefix;
  for (const std::string_view key : kKeys) {
    if (keys.has(key)) entry.lines.emplace(key, keys.line(key));
  }

  std::optional<Eigen::MatrixXd> mass = keys.matrix("mass");
  if (!mass) throw InputError(prefix + "mass", "missing", node.line);
  const Eigen::Index n = mass->rows();
  analysis::TaskImpedance& impedance = entry.impedance;
  impedance.mass = std::move(*mass);
  impedance.damping = keys.matrix("damping");
  impedance.stiffness = keys.matrix("stiffness");
  impedance.jacobian = task_rows(keys, "jacobian", n);
  impedance.task_damping = keys.matrix("task_damping");
  impedance.task_stiffness = keys.matrix("task_stiffness");
  impedance.jacobian_rate = task_rows(keys, "jacobian_rate", n);
  impedance.jacobian_derivatives =
      keys.matrices("jacobian_derivatives").value_or(std::vector<Eigen::MatrixXd>());
  impedance.wrench = keys.vector("wrench");
  if (!impedance.stiffness && !impedance.task_stiffness && n > 0) {
    throw InputError(prefix + "stiffness",
                     "missing; give it, or jacobian and task_stiffness, or both", node.line);
  }

  read_additions(keys, entry);
  entry.initial_position = joint_vector(keys, "initial_position", n);
  entry.initial_velocity = joint_vector(keys, "initial_velocity", n);
  entry.impulse = joint_vector(keys, "impulse", n);
  entry.force = joint_vector(keys, "force", n);
  entry.times = keys.vector("times");
  if (entry.times && entry.loop.gears.any()) {
    throw keys.error("times", "does not go with gear_stiffness");
  }
  if (entry.times) {
    for (Eigen::Index i = 0; i < entry.times->size(); ++i) {
      if ((*entry.times)[i] < 0) {
        throw keys.error("times", "entry " + std::to_string(i + 1) + " is negative");
      }
    }
  }
  return entry;
}

}  // namespace

analysis::System<> SystemEntry::system(const analysis::TaskImpedance& given) const {
  analysis::System<> result = analysis::to_joint_space(given);
  if (loop.gears.any()) loop.gears.extend(result);
  return result;
}

const char* const kSystemFileHelp =
    R"(FILE is YAML or JSON: one system, or a list of systems. "-" reads standard input.
n joints, m task directions; SI units; matrices are lists of rows.
Tables and messages count the systems of a list from 0: [0].mass belongs to the first.
  mass              n x n, symmetric positive definite
  stiffness         n x n, symmetric                           } one of the two,
  task_stiffness    m x m, symmetric, with jacobian (m x n)    } or both: they add up
  damping           n x n, symmetric                           } the same; if neither
  task_damping      m x m, symmetric, with jacobian            } is given, there is none
  jacobian_rate     m x n, dJ/dt: adds J' C_C dJ/dt to the stiffness
  jacobian_derivatives, wrench
                    n matrices m x n, dJ/dq_k, and the wrench (m) of the task spring at
                    equilibrium: adds the geometric stiffness [(dJ/dq_1)' f ...]
  reflected_inertia n, of drives, added to the diagonal of mass
  gear_stiffness    n, of elastic gears between motors with that inertia and their links; none:
                    rigid; with gear_damping (n) and position_sensor (motor or link)
  payload           a mass, kg, at the origin of a task of six directions, added to mass
  null_damping      n, damping of the motions that task_stiffness leaves free, as a
                    controller adds it: N' diag(null_damping) N, see docs/command-line.md
  times             asks for the response at these times (s, none negative). It is the
                    sum of what each of the following causes; what is not given is zero:
  initial_position  n
  initial_velocity  n
  impulse           n, at t = 0
  force             n, constant from t = 0 on
                    Without times there is no response and these four are only checked.
A system without joints (mass: []) is a proper one, without modes.)";

void SystemEntry::add_null_damping(const Eigen::MatrixXd& D) {
  const Eigen::Index n = impedance.mass.rows();
  const auto &J = impedance.jacobian, &K_C = impedance.task_stiffness;
  if (n == 0 || impedance.mass.cols() != n || !J || J->cols() != n || !K_C ||
      K_C->rows() != J->rows() || K_C->cols() != J->rows() ||
      impedance.mass.llt().info() != Eigen::Success ||
      (impedance.damping && (impedance.damping->rows() != n || impedance.damping->cols() != n))) {
    return;
  }
  const analysis::NullSpaceDamping more =
      analysis::null_space_damping(impedance.mass, *J, *K_C, D, impedance.mass_error);
  if (!impedance.damping) impedance.damping = Eigen::MatrixXd::Zero(n, n);
  add(more.damping, more.error, *impedance.damping, impedance.damping_error);
}

InputError SystemEntry::error(const analysis::InvalidSystem& cause) const {
  std::string reason = cause.what();
  if (reason.starts_with(cause.key() + ": ")) reason.erase(0, cause.key().size() + 2);
  // "jacobian_derivatives[2]" is found under "jacobian_derivatives".
  const auto line = lines.find(cause.key().substr(0, cause.key().find('[')));
  return {prefix + cause.key(), reason, line == lines.end() ? 0 : line->second};
}

bool has_key(const YamlNode& document, std::string_view key) {
  for (std::size_t i = 0; i + 1 < document.items.size(); i += 2) {
    if (document.kind == YamlNode::Kind::kMap && document.items[i].text == key) return true;
  }
  return false;
}

SystemFile read_systems(const std::string& path) {
  const YamlNode root = text::parse_yaml(text::read_input(path));
  if (root.kind == YamlNode::Kind::kNull) throw InputError("", "is empty");
  if (has_key(root, "robot") || has_key(root, "scenario")) {
    throw InputError("",
                     "is a configuration or scene, which dashpot run, drive, tune and check-model "
                     "take, and no system of matrices; design and audit take its arm by --urdf");
  }
  SystemFile file;
  file.is_list = root.kind == YamlNode::Kind::kSequence;
  if (!file.is_list) {
    file.entries.push_back(read_entry(root, ""));
    return file;
  }
  for (std::size_t i = 0; i < root.items.size(); ++i) {
    file.entries.push_back(read_entry(root.items[i], "[" + std::to_string(i) + "]."));
  }
  return file;
}

}  // namespace dashpot::apps
