#include <dashpot/tests/support/mujoco_arm.hpp>

#include <stdexcept>

#ifdef DASHPOT_HAVE_MUJOCO
#include <dashpot/tests/support/random_robot.hpp>

#include <mujoco/mujoco.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <deque>
#include <sstream>
#include <string>

namespace dashpot::testing {
namespace {

constexpr const char* kFile = "arm.xml";
/// Dry friction is a constraint that MuJoCo softens. With this impedance, and a time constant of
/// four steps, a joint that it holds creeps with 1e-4 of MuJoCo's default.
constexpr double kImpedance = 0.9999;
constexpr double kTimeConstant = 4;  // steps

std::string exact(const Eigen::Matrix3d& rotation) {
  const Eigen::Quaterniond q(rotation);
  return testing::exact(q.w()) + ' ' + testing::exact(Eigen::Vector3d(q.vec()));
}

/// The `inertial` of a body by its principal axes: MuJoCo finds those itself with eight digits
/// only.
void write(const sim::Inertia& body, std::ostream& out) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(body.about_center);
  Eigen::Matrix3d axes = principal.eigenvectors();
  if (axes.determinant() < 0) axes.col(0) *= -1;
  out << "<inertial pos=\"" << testing::exact(body.center) << "\" mass=\"" << body.mass
      << "\" quat=\"" << exact(axes) << "\" diaginertia=\""
      << testing::exact(Eigen::Vector3d(principal.eigenvalues())) << "\"/>";
}

void write(const sim::Joint& joint, const sim::ArmOptions& world, std::ostream& out) {
  out << "<joint axis=\"0 0 1\" type=\"" << (joint.prismatic ? "slide" : "hinge")
      << "\" armature=\"" << joint.reflected_inertia << "\" damping=\""
      << (world.viscous_friction ? joint.viscous_friction : 0) << "\" frictionloss=\""
      << (world.coulomb_friction ? joint.coulomb_friction : 0) << '"';
  if (world.stops && std::isfinite(joint.lower) && std::isfinite(joint.upper)) {
    out << " limited=\"true\" range=\"" << joint.lower << ' ' << joint.upper << '"';
  }
  out << "/>";
}

std::string mjcf(const sim::Robot& robot, const sim::ArmOptions& world,
                 const MujocoOptions& options, const Eigen::Vector3d& tip) {
  constexpr double kFar = 10;  // m, of a tendon's end
  if (!world.loads.empty()) throw sim::InvalidScene("loads", "are not for MuJoCo");
  if (!world.tables.empty()) throw sim::InvalidScene("tables", "are not for MuJoCo");
  std::ostringstream out;
  out.precision(17);
  const double soft = kTimeConstant * options.step;
  out << "<mujoco><compiler angle=\"radian\" inertiafromgeom=\"false\"/><option gravity=\""
      << testing::exact(robot.gravity()) << "\" timestep=\"" << options.step
      << "\" tolerance=\"1e-12\"/>"
      << "<default><joint solreffriction=\"" << soft << " 1\" solreflimit=\"" << soft
      << " 1\" solimpfriction=\"" << kImpedance << ' ' << kImpedance << "\"/></default>"
      << "<worldbody>";
  for (const sim::Joint& joint : robot.joints()) {
    sim::Inertia body = joint.inertia;
    body.mass *= options.link_factor;
    body.about_center *= options.link_factor;
    if (&joint == &robot.joints().back()) body += robot.tip() * options.payload;
    out << "<body pos=\"" << testing::exact(joint.origin.position) << "\" quat=\""
        << exact(joint.origin.rotation) << "\">";
    write(body, out);
    write(joint, world, out);
    if (joint.elastic()) {  // the gear's deflection, between drive and link
      out << "<joint axis=\"0 0 1\" type=\"" << (joint.prismatic ? "slide" : "hinge")
          << "\" stiffness=\"" << joint.gear_stiffness << "\" damping=\"" << joint.gear_damping
          << "\"/>";
    }
  }
  const auto& [stiffness, along] = options.tendon;
  if (stiffness > 0)
    out << "<site name=\"tip\" pos=\"" << testing::exact(robot.tip().position) << "\"/>";
  for (int i = 0; i < robot.dof(); ++i) out << "</body>";
  if (stiffness > 0) {
    out << "<site name=\"far\" pos=\"" << testing::exact(Eigen::Vector3d(tip + kFar * along))
        << "\"/>";
  }
  out << "</worldbody>";
  if (stiffness > 0) {
    out << "<tendon><spatial springlength=\"" << kFar << "\" stiffness=\"" << stiffness
        << "\"><site site=\"tip\"/><site site=\"far\"/></spatial></tendon>";
  }
  out << "</mujoco>";
  return out.str();
}

mjModel* compile(const std::string& xml) {
  const auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
  mj_makeEmptyFileVFS(files.get(), kFile, static_cast<int>(xml.size()));
  std::memcpy(files->filedata[0], xml.data(), xml.size());
  std::array<char, 1000> error{};
  mjModel* model = mj_loadXML(kFile, files.get(), error.data(), error.size());
  mj_deleteVFS(files.get());
  if (model == nullptr) throw std::runtime_error(std::string("MuJoCo: ") + error.data());
  return model;
}

class Arm final : public MujocoArm {
 public:
  Arm(const sim::Robot& robot, const sim::ArmOptions& world, const MujocoOptions& options,
      const Eigen::Vector3d& tip)
      : model_(compile(mjcf(robot, world, options, tip)), &mj_deleteModel),
        data_(mj_makeData(model_.get()), &mj_deleteData),
        tip_(robot.tip()),
        world_(world),
        options_(options) {
    mju_user_warning = [](const char*) {};  // they go to a file otherwise; step() looks for them
  }

  int dof() const override { return static_cast<int>(model_->nv); }
  double time() const override { return data_->time; }
  JointVector position() const override { return vector(data_->qpos); }
  JointVector velocity() const override { return vector(data_->qvel); }
  sim::Pose tip_pose() const override { return pose_of(last()) * tip_; }
  sim::Vector6 tip_twist() const override { return tip_jacobian() * vector(data_->qvel); }
  double kinetic_energy() const override {
    Eigen::VectorXd momentum(dof());
    mj_mulM(model_.get(), data_.get(), momentum.data(), data_->qvel);
    return 0.5 * momentum.dot(vector(data_->qvel));
  }
  JointVector acceleration(const JointVector& torque) override {
    load(torque);
    mj_forward(model_.get(), data_.get());
    return vector(data_->qacc);
  }
  void place(const JointVector& q, const JointVector& qd) override {
    vector(data_->qpos) = q;
    vector(data_->qvel) = qd;
    look();
  }
  void push(int joint, const Eigen::Vector3d& point, const Eigen::Vector3d& force) override {
    pushed_ = force.isZero() ? 0 : joint + 1;
    point_ = point;
    force_ = force;
  }
  void step(const JointVector& torque, double seconds) override {
    on_their_way_.resize(static_cast<std::size_t>(options_.delay), torque);
    on_their_way_.push_back(torque);
    const JointVector acting = on_their_way_.front();
    on_their_way_.pop_front();
    const int steps = std::max(1, static_cast<int>(std::ceil(seconds / options_.step - 1e-9)));
    model_->opt.timestep = seconds / steps;
    for (int i = 0; i < steps; ++i) {
      mj_step1(model_.get(), data_.get());
      load(acting);
      mj_step2(model_.get(), data_.get());
    }
    look();
    for (const mjtWarning warning : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC}) {
      if (data_->warning[warning].number > 0) {
        throw std::runtime_error(std::string("MuJoCo: ") + mju_warningText(warning, 0));
      }
    }
  }

 private:
  Eigen::Map<Eigen::VectorXd> vector(mjtNum* values) const { return {values, model_->nv}; }
  int last() const { return static_cast<int>(model_->nbody) - 1; }
  sim::Pose pose_of(int body) const {
    using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    return {Eigen::Map<const Eigen::Vector3d>(data_->xpos + std::ptrdiff_t{3} * body),
            Eigen::Map<const RowMajor3>(data_->xmat + std::ptrdiff_t{9} * body)};
  }
  Eigen::Matrix<double, 6, Eigen::Dynamic> tip_jacobian() const {
    Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::RowMajor> J(6, dof());
    mj_jac(model_.get(), data_.get(), J.data(), J.data() + std::ptrdiff_t{3} * dof(),
           tip_pose().position.data(), last());
    return J;
  }

  /// Brings what depends on positions and velocities up to date.
  void look() {
    mj_fwdPosition(model_.get(), data_.get());
    mj_fwdVelocity(model_.get(), data_.get());
  }

  /// Sets what acts on the arm where it was looked at last.
  void load(const JointVector& torque) {
    vector(data_->qfrc_applied) = torque;
    if (pushed_ > 0) {
      const sim::Pose body = pose_of(pushed_);
      const Eigen::Vector3d point = body.position + body.rotation * point_;
      mj_applyFT(model_.get(), data_.get(), force_.data(), nullptr, point.data(), pushed_,
                 data_->qfrc_applied);
    }
    sim::Vector6 wrench = sim::Vector6::Zero();
    for (const auto& piece : world_.wrenches) {
      if (data_->time >= piece.begin && data_->time < piece.end) wrench += piece.value;
    }
    if (world_.wall) {
      const Eigen::Vector3d out = world_.wall->normal.normalized();
      const double depth = out.dot(world_.wall->point - tip_pose().position);
      const double rate = -out.dot(tip_twist().head<3>());
      const sim::Contact& contact = world_.wall->contact;
      wrench.head<3>() +=
          contact_force(contact, contact_mode(contact, depth, rate), depth, rate).force * out;
    }
    if (!wrench.isZero(0)) vector(data_->qfrc_applied) += tip_jacobian().transpose() * wrench;
  }

  std::unique_ptr<mjModel, void (*)(mjModel*)> model_;
  std::unique_ptr<mjData, void (*)(mjData*)> data_;
  sim::Pose tip_;
  sim::ArmOptions world_;
  MujocoOptions options_;
  std::deque<JointVector> on_their_way_;
  int pushed_ = 0;  ///< body
  Eigen::Vector3d point_, force_;
};

}  // namespace

bool MujocoArm::available() noexcept {
  return true;
}

std::unique_ptr<MujocoArm> MujocoArm::make(const sim::Robot& robot, const sim::ArmOptions& world,
                                           const MujocoOptions& options, const JointVector& q,
                                           const JointVector& qd) {
  auto arm = std::make_unique<Arm>(robot, world, options, sim::Arm(robot).tip_pose(q).position);
  arm->place(q, qd.size() > 0 ? qd : JointVector(JointVector::Zero(q.size())));
  return arm;
}

}  // namespace dashpot::testing

#else

namespace dashpot::testing {

bool MujocoArm::available() noexcept {
  return false;
}

std::unique_ptr<MujocoArm> MujocoArm::make(const sim::Robot&, const sim::ArmOptions&,
                                           const MujocoOptions&, const JointVector&,
                                           const JointVector&) {
  throw std::runtime_error("this build has no MuJoCo (Debian: libmujoco-dev)");
}

}  // namespace dashpot::testing

#endif
