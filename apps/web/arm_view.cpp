#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/scene/scene_file.hpp>
#include <dashpot/apps/web/arm_view.hpp>
#include <dashpot/apps/web/receptance.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <stdexcept>

namespace dashpot::apps {
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

}  // namespace dashpot::apps
