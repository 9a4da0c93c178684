#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/scene/scene_file.hpp>
#include <dashpot/apps/web/arm_view.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace dashpot::apps {
namespace {

using ArmJson = nlohmann::ordered_json;

ArmJson frame_json(const KDL::Frame& frame) {
  ArmJson rows = ArmJson::array();
  for (int i = 0; i < 4; ++i) {
    ArmJson row = ArmJson::array();
    for (int j = 0; j < 4; ++j) row.push_back(frame(i, j));
    rows.push_back(row);
  }
  return rows;
}

ArmJson vector_json(const KDL::Vector& vector) {
  return ArmJson{vector.x(), vector.y(), vector.z()};
}

/// The closed loop at rest at q, as the controller has it once its gains have set in.
analysis::System<> loop_at(const controller::Config& config, const Eigen::VectorXd& q,
                           controller::Mode mode) {
  controller::Settings settings = config.settings;
  settings.motion.gain_time = settings.period;
  settings.analysis.where = controller::Analysis::Where::kOff;
  settings.analysis.sampled.interval = 0;
  settings.initial.mode = mode;
  controller::Controller controller(config.model, settings);
  const controller::DynamicsResult there =
      controller::evaluate(config.model, q, controller::JointVector::Zero(q.size()));
  controller::RobotState state;
  state.position = q;
  state.velocity.setZero(q.size());
  controller::Setpoint setpoint = settings.initial;
  setpoint.joint_position = q;
  setpoint.tip_pose = {there.p_BT_B, there.R_BT};
  controller::JointVector torque;
  for (int i = 0; i < 10; ++i) {
    state.time = setpoint.time = i * std::llround(1e9 * settings.period);
    controller.update(state, setpoint, torque);
  }
  analysis::System<controller::kMaxJoints> system;
  controller.closed_loop(system);
  analysis::System<> result(system.dof());
  result.mass = system.mass;
  result.damping = system.damping;
  result.stiffness = system.stiffness;
  result.stiffness_factor = system.stiffness_factor;
  return result;
}

/// "joint/3": the row vector d with which the receptance is taken, d H d'.
Eigen::RowVectorXd direction_of(const std::string& place, const controller::Jacobian& J) {
  const auto slash = place.find('/');
  const std::string where = place.substr(0, std::min(slash, place.size()));
  const std::string digits = slash == std::string::npos ? "" : place.substr(slash + 1);
  const Eigen::Index most = where == "joint" ? J.cols() : where == "tip" ? 6 : 0;
  const bool number = !digits.empty() && digits.size() < 3 &&
                      digits.find_first_not_of("0123456789") == std::string::npos;
  const Eigen::Index i = number ? std::stoi(digits) : most;
  if (i >= most) throw std::invalid_argument("there is no such place on this arm");
  if (where == "tip") return J.row(i);
  return Eigen::RowVectorXd::Unit(J.cols(), i);
}

}  // namespace

ArmJson chain_json(const controller::RobotModel& model) {
  const KDL::Chain& chain = controller::kdl_chain(model);
  ArmJson document{{"name", model.name()}, {"joints", ArmJson::array()}};
  const auto& joints = model.joints();
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const KDL::Segment& segment = chain.getSegment(static_cast<unsigned>(i));
    const KDL::Joint& joint = segment.getJoint();
    document["joints"].push_back(
        {{"name", joints[i].name},
         {"prismatic", joints[i].type == controller::JointType::kPrismatic},
         {"lower", joints[i].lower},
         {"upper", joints[i].upper},
         {"origin", vector_json(joint.JointOrigin())},
         {"axis", vector_json(joint.JointAxis())},
         {"frame", frame_json(joint.pose(0).Inverse() * segment.pose(0))}});
  }
  document["missing_rotors"] = controller::missing_rotors_text(model);
  document["tip"] = frame_json(chain.getSegment(static_cast<unsigned>(joints.size())).pose(0));
  return document;
}

ArmView::ArmView(const std::string& config) : config_(controller::load_config(config)) {
  try {
    const Scene scene = load_scene(config);
    if (scene.arm) simulated_wall_ = scene.arm->options.wall;
  } catch (const InputError&) {  // a configuration, which is no scene
  }
}

ArmJson ArmView::chain() const {
  ArmJson document = chain_json(config_.model);
  document["walls"] = ArmJson::array();
  const auto add_wall = [&walls = document["walls"]](
                            const std::string& name, const Eigen::Vector3d& p,
                            const Eigen::Vector3d& normal, const ArmJson& stiffness) {
    walls.push_back({{"name", name},
                     {"point", {p.x(), p.y(), p.z()}},
                     {"normal", {normal.x(), normal.y(), normal.z()}},
                     {"stiffness", stiffness}});
  };
  for (const controller::Wall& wall : config_.settings.limits.walls) {
    add_wall("wall " + std::to_string(document["walls"].size() + 1), wall.point, wall.normal, {});
  }
  if (simulated_wall_) {
    add_wall("simulated wall", simulated_wall_->point, simulated_wall_->normal.normalized(),
             simulated_wall_->contact.stiffness);
  }
  return document;
}

double ArmView::wanted_ratio(int mode) const {
  const controller::Gains& gains = config_.settings.initial.gains;
  return mode == state_t::CARTESIAN ? gains.task_damping_ratio : gains.joint_damping_ratio;
}

ArmJson ArmView::response(const std::vector<double>& position, int mode,
                          const std::string& place) const {
  const Eigen::VectorXd q = Eigen::Map<const Eigen::VectorXd>(
      position.data(), static_cast<Eigen::Index>(position.size()));
  if (q.size() != dof() || !q.allFinite()) throw std::runtime_error("the arm has other joints");
  const controller::Jacobian J =
      controller::evaluate(config_.model, q, controller::JointVector::Zero(q.size())).J;
  const bool cartesian = mode == state_t::CARTESIAN;
  const analysis::System<> system =
      loop_at(config_, q, cartesian ? controller::Mode::kCartesian : controller::Mode::kJoint);
  Eigen::RowVectorXd d = Eigen::RowVectorXd::Zero(system.dof());  // of the links, not of motors
  d.head(J.cols()) = direction_of(place, J);
  const analysis::Spectrum<> spectrum = analysis::analyze(system);
  const analysis::Response response(system, spectrum);

  double slowest = 1, fastest = 10;
  ArmJson frequencies = ArmJson::array(), ratios = ArmJson::array();
  for (const auto& mode_found : spectrum.modes) {
    const double frequency = mode_found.natural_frequency;
    frequencies.push_back(frequency);
    ratios.push_back(mode_found.damping_ratio);
    if (!std::isfinite(frequency) || frequency < 1e-3) continue;
    slowest = std::min(slowest, frequency);
    fastest = std::max(fastest, frequency);
  }
  constexpr int kPoints = 241;
  ArmJson omegas = ArmJson::array(), magnitudes = ArmJson::array(), phases = ArmJson::array();
  double phase = 0;
  for (int i = 0; i < kPoints; ++i) {
    const double omega = 0.1 * slowest * std::pow(100 * fastest / slowest, i / (kPoints - 1.0));
    const std::complex<double> h = (d * response.receptance(omega) * d.transpose())(0, 0);
    const double turn = std::arg(h) - phase;  // the phase goes on smoothly
    phase += std::remainder(turn, 2 * M_PI);
    omegas.push_back(omega);
    magnitudes.push_back(std::abs(h));
    phases.push_back(phase);
  }
  const Eigen::MatrixXd zero_modes = spectrum.zero_modes.basis.transpose();
  const bool linear = place.starts_with("tip") ? place < "tip/3" : false;
  return {{"omega", omegas},
          {"magnitude", magnitudes},
          {"phase", phases},
          {"unit", linear ? "m/N" : "rad/(N m)"},
          {"zero_modes", json_rows(zero_modes)},
          {"natural_frequency", frequencies},
          {"damping_ratio", ratios}};
}

}  // namespace dashpot::apps
