#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/scene/scene.hpp>
#include <dashpot/apps/web/arm_view.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <complex>
#include <stdexcept>

namespace dashpot::apps {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

Json frame_json(const KDL::Frame& frame) {
  Json rows = Json::array();
  for (int i = 0; i < 4; ++i) {
    Json row = Json::array();
    for (int j = 0; j < 4; ++j) row.push_back(frame(i, j));
    rows.push_back(row);
  }
  return rows;
}

Json vector_json(const KDL::Vector& vector) {
  return Json{vector.x(), vector.y(), vector.z()};
}

}  // namespace

Json chain_json(const controller::RobotModel& model) {
  const KDL::Chain& chain = controller::kdl_chain(model);
  Json document{{"name", model.name()}, {"joints", Json::array()}};
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
    simulated_wall_ = scene.arm->options.wall;
    one_table_ = scene.arm->options.tables.empty();
  } catch (const InputError&) {  // a configuration without a scene
  }
}

Json ArmView::chain() const {
  Json document = chain_json(config_.model);
  document["walls"] = Json::array();
  const auto add_wall = [&walls = document["walls"]](
                            const std::string& name, const Eigen::Vector3d& p,
                            const Eigen::Vector3d& normal, const Json& stiffness) {
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
             one_table_ ? Json(simulated_wall_->contact.stiffness) : Json());
  }
  return document;
}

double ArmView::wanted_ratio(int mode) const {
  const controller::Gains& gains = config_.settings.initial.gains;
  return mode == state_t::CARTESIAN ? gains.task_damping_ratio : gains.joint_damping_ratio;
}

Json ArmView::response(const std::vector<double>& position, int mode,
                       const std::string& place) const {
  const Eigen::VectorXd q = Eigen::Map<const Eigen::VectorXd>(
      position.data(), static_cast<Eigen::Index>(position.size()));
  if (q.size() != dof() || !q.allFinite()) throw std::runtime_error("the arm has other joints");
  const bool cartesian = mode == state_t::CARTESIAN;
  const auto robot =
      controller::evaluate(config_.model, q, controller::JointVector::Zero(q.size()));
  const Place seen = place_of(place, robot.M, robot.J);
  const analysis::System<> system =
      controller::PostureLoop(config_.model, config_.settings)
          .at(q, config_.settings.initial.gains,
              cartesian ? controller::Mode::kCartesian : controller::Mode::kJoint)
          .system;
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(system.dof());  // of the links, not of motors
  row.head(q.size()) = seen.row;
  const analysis::Spectrum<> spectrum = analysis::analyze(system);
  Json result = receptance_json(system, spectrum, row, seen.unit);
  result["zero_modes"] = json_rows(spectrum.zero_modes.basis.transpose());
  result["damping_ratio"] = Json::array();
  for (const auto& found : spectrum.modes) result["damping_ratio"].push_back(found.damping_ratio);
  return result;
}

MatrixXd consistent_inverse(const MatrixXd& M, const MatrixXd& J) {
  const Eigen::LLT<MatrixXd> mass(M);
  const MatrixXd X = mass.matrixL().solve(J.transpose());  // J M^-1 J' = X'X
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> solve;
  solve.setThreshold(1e-6);
  solve.compute(X.transpose());
  return mass.matrixU().solve(solve.pseudoInverse());
}

Place place_of(const std::string& place, const MatrixXd& M, const MatrixXd& J) {
  const bool tip = place.starts_with("tip/"), joint = place.starts_with("joint/");
  const std::string digits = place.substr(std::min(place.find('/') + 1, place.size()));
  const bool number = !digits.empty() && digits.size() < 3 &&
                      digits.find_first_not_of("0123456789") == std::string::npos;
  const int i = number ? std::stoi(digits) : -1;
  const Eigen::Index n = M.rows();
  if (joint && i >= 0 && i < n) return {VectorXd::Unit(n, i), VectorXd::Unit(n, i), "rad/(N m)"};
  if (!tip || i < 0 || i > 5) throw InputError("place", "there is no such place on this arm");
  return {J.row(i), consistent_inverse(M, J).col(i), i < 3 ? "m/N" : "rad/(N m)"};
}

Json receptance_json(const analysis::System<>& system, const analysis::Spectrum<>& spectrum,
                     const Eigen::RowVectorXd& row, const std::string& unit) {
  double slowest = 10, fastest = 10;
  Json natural = Json::array();
  for (const analysis::Mode<>& mode : spectrum.modes) {
    const double frequency = mode.natural_frequency;
    natural.push_back(frequency);
    if (!std::isfinite(frequency) || frequency < controller::kSoftFrequency) continue;
    slowest = std::min(slowest, frequency);
    fastest = std::max(fastest, frequency);
  }
  constexpr int kPoints = 241;
  std::vector<double> omegas, magnitudes, phases;
  double phase = 0;
  const Eigen::VectorXcd force = row.transpose();
  for (int i = 0; i < kPoints; ++i) {
    const double omega = 0.1 * slowest * std::pow(100 * fastest / slowest, i / (kPoints - 1.0));
    const std::complex<double> s(0, omega);
    const Eigen::MatrixXcd dynamic = s * s * system.mass + s * system.damping + system.stiffness;
    const std::complex<double> h = row * dynamic.partialPivLu().solve(force);
    phase += std::remainder(std::arg(h) - phase, 2 * M_PI);
    omegas.push_back(omega);
    magnitudes.push_back(std::abs(h));
    phases.push_back(phase);
  }
  return {{"omega", omegas},
          {"magnitude", magnitudes},
          {"phase", phases},
          {"unit", unit},
          {"natural_frequency", natural}};
}

}  // namespace dashpot::apps
