#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/identification/check_model/weak_form.hpp>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::identification {
namespace {

/// p = M qd, dL/dq + g = Mdot qd - C qd, and g at one state.
class LagrangianTerms {
 public:
  explicit LagrangianTerms(const controller::DynamicsKernel& kernel) : kernel_(kernel) {}

  void evaluate(const controller::JointVector& q, const controller::JointVector& qd) {
    kernel_.evaluate(q, qd, at_);
    p.noalias() = at_.M * qd;
    gravity = at_.gravity;
    const double speed = qd.cwiseAbs().maxCoeff();
    if (speed == 0) {
      slope.setZero(q.size());
      return;
    }
    // A central difference along the motion: 1e-4 rad leaves 1e-8 of M's change, and no digits of
    // it are lost to rounding before the ninth.
    const double s = 1e-4 / speed;
    slope = -at_.coriolis;
    kernel_.evaluate(q + s * qd, qd, at_);
    slope.noalias() += at_.M * qd / (2 * s);
    kernel_.evaluate(q - s * qd, qd, at_);
    slope.noalias() -= at_.M * qd / (2 * s);
  }

  controller::JointVector p, slope, gravity;

 private:
  const controller::DynamicsKernel& kernel_;
  controller::DynamicsResult at_;
};

}  // namespace

WeakForm::WeakForm(const std::vector<SmoothRun>& runs, const RecordFilter& how) : runs_(&runs) {
  constexpr double kHalfWidth = 0.1;  // T, s, at least: passes 5 Hz at half its size
  m_ = std::max<Index>(12, static_cast<Index>(std::lround(kHalfWidth / how.step)));
  const double T = static_cast<double>(m_) * how.step;
  width_ = 2 * T;
  f_.resize(2 * m_ + 1);
  slope_.resize(2 * m_ + 1);
  double sum = 0, moment = 0;
  for (Index i = -m_; i <= m_; ++i) {
    const double phase = std::numbers::pi * static_cast<double>(i) / static_cast<double>(m_);
    f_[i + m_] = 1 + std::cos(phase);
    slope_[i + m_] = -std::sin(phase);
    sum += f_[i + m_];
    moment -= slope_[i + m_] * static_cast<double>(i) * how.step;
  }
  f_ /= sum;
  slope_ /= moment;  // so that a momentum that rises evenly has its exact rate
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const SmoothRun& run = runs[k];
    for (Index first = 0; first + 2 * m_ < run.position.cols(); first += m_) {
      const double from = run.begin + static_cast<double>(first) * how.step;
      windows_.push_back({k, first, run.record, from, from + width_});
    }
  }
}

template <typename Function>
MatrixXd WeakForm::means(const VectorXd& weights, const Function& function) const {
  if (windows_.empty()) return {};
  MatrixXd result(runs_->front().position.rows(), count());
  MatrixXd values;
  std::size_t run = runs_->size();
  for (std::size_t k = 0; k < windows_.size(); ++k) {
    if (windows_[k].run != run) values = function((*runs_)[run = windows_[k].run]);
    result.col(static_cast<Index>(k)).noalias() =
        values.middleCols(windows_[k].first, weights.size()) * weights;
  }
  return result;
}

MatrixXd WeakForm::torque() const {
  return means(f_, [](const SmoothRun& run) { return run.torque; });
}

MatrixXd WeakForm::torque_rate() const {
  return means(slope_, [](const SmoothRun& run) { return MatrixXd(-run.torque); });
}

MatrixXd WeakForm::acceleration() const {
  return means(slope_, [](const SmoothRun& run) { return MatrixXd(-run.velocity); });
}

MatrixXd WeakForm::velocity() const {
  return means(f_, [](const SmoothRun& run) { return run.velocity; });
}

MatrixXd WeakForm::sign(const VectorXd& v0) const {
  return means(f_, [&v0](const SmoothRun& run) {
    return MatrixXd((v0.cwiseInverse().asDiagonal() * run.velocity).cwiseMax(-1).cwiseMin(1));
  });
}

MatrixXd WeakForm::slow_sign(double v0) const {
  return means(f_, [v0](const SmoothRun& run) {
    return MatrixXd(run.velocity.array().sign() * (-(run.velocity / v0).array().square()).exp());
  });
}

MatrixXd WeakForm::slow_share(const VectorXd& v0) const {
  return means(f_, [&v0](const SmoothRun& run) {
    const MatrixXd relative = v0.cwiseInverse().asDiagonal() * run.velocity.cwiseAbs();
    return MatrixXd((relative.array() < 1).cast<double>());
  });
}

WindowTorques WeakForm::torques(const controller::DynamicsKernel& kernel, Index joints) const {
  WindowTorques result;
  if (windows_.empty()) return result;
  const Index n = runs_->front().position.rows();
  result.inertial.setZero(n, count());
  result.gravity.setZero(n, count());
  LagrangianTerms terms(kernel);
  MatrixXd p, slope, gravity;
  std::size_t run = runs_->size();
  for (std::size_t k = 0; k < windows_.size(); ++k) {
    const auto column = static_cast<Index>(k);
    if (windows_[k].run != run) {
      const SmoothRun& motion = (*runs_)[run = windows_[k].run];
      const Index N = motion.position.cols();
      for (MatrixXd* all : {&p, &slope, &gravity}) all->resize(joints, N);
      for (Index i = 0; i < N; ++i) {
        terms.evaluate(motion.position.col(i).head(joints), motion.velocity.col(i).head(joints));
        p.col(i) = terms.p;
        slope.col(i) = terms.slope;
        gravity.col(i) = terms.gravity;
      }
    }
    const Index first = windows_[k].first, size = f_.size();
    result.inertial.col(column).head(joints) =
        -p.middleCols(first, size) * slope_ - slope.middleCols(first, size) * f_;
    result.gravity.col(column).head(joints) = gravity.middleCols(first, size) * f_;
  }
  return result;
}

namespace {

MatrixXd sum_of(const WindowTorques& torques) {
  return torques.inertial + torques.gravity;
}

/// The chain from the base to the link that joint j moves; without anything attached.
controller::RobotModel part_of_arm(const controller::RobotDescription& robot,
                                   const controller::RobotModel& model, int joint) {
  controller::RobotDescription part = robot;
  controller::ModelOptions& options = part.options;
  options.payload = {};
  options.tool = {};
  options.drives.clear();
  options.drives_friction = false;
  options.accept_inertias = true;
  options.include_off_chain = true;  // which includes all beyond the link
  options.reflected_inertia =
      model.joint_values(&controller::Joint::reflected_inertia).head(joint + 1);
  options.viscous_friction = options.coulomb_friction = {};
  options.torque_loop_inertia_ratio = options.gear_stiffness = options.gear_damping = {};
  part.tip = kdl_chain(model).getSegment(static_cast<unsigned>(joint)).getName();
  return part.model();
}

controller::Attachment body_of(const KDL::RigidBodyInertia& body) {
  controller::Attachment attachment;
  attachment.mass = body.getMass();
  const KDL::Vector center = body.getCOG();
  for (int i = 0; i < 3; ++i) attachment.first_moment[i] = attachment.mass * center[i];
  const KDL::RotationalInertia inertia = body.getRotationalInertia();
  for (int i = 0; i < 9; ++i) attachment.inertia.data()[i] = inertia.data[i];
  return attachment;
}

}  // namespace

void add_to_body(controller::Attachment& body, Index i, double amount) {
  constexpr std::array<std::array<int, 2>, 6> kEntries{
      {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};
  if (i == 0) {
    body.mass += amount;
  } else if (i < 4) {
    body.first_moment[i - 1] += amount;
  } else {
    const auto [row, col] = kEntries[static_cast<std::size_t>(i - 4)];
    body.inertia(row, col) += amount;
    if (row != col) body.inertia(col, row) += amount;
  }
}

std::vector<MatrixXd> body_columns(const controller::RobotModel& model, const WeakForm& form,
                                   std::size_t count) {
  controller::DynamicsKernel kernel(model);
  kernel.attach({});
  const MatrixXd bare = sum_of(form.torques(kernel, model.dof()));
  std::vector<MatrixXd> columns;
  for (std::size_t i = 0; i < count; ++i) {
    controller::Attachment unit;
    add_to_body(unit, static_cast<Index>(i), 1);
    kernel.attach(unit);
    columns.emplace_back(sum_of(form.torques(kernel, model.dof())) - bare);
  }
  return columns;
}

Eigen::Matrix<double, 3, 2> tilt_directions(const Eigen::Vector3d& gravity) {
  Eigen::Matrix<double, 3, 2> directions;
  directions.col(0) = gravity.unitOrthogonal() * gravity.norm();
  directions.col(1) = gravity.normalized().cross(directions.col(0));
  return directions;
}

std::vector<MatrixXd> tilt_columns(const controller::RobotDescription& robot,
                                   const WeakForm& form) {
  std::vector<MatrixXd> columns;
  const Eigen::Matrix<double, 3, 2> directions = tilt_directions(robot.options.gravity);
  for (Eigen::Index i = 0; i < 2; ++i) {
    controller::RobotDescription tilted = robot;
    tilted.options.gravity = directions.col(i);
    const controller::RobotModel model = tilted.model();
    columns.push_back(form.torques(controller::DynamicsKernel(model), model.dof()).gravity);
  }
  return columns;
}

std::vector<Hypothesis> list_hypotheses(const controller::RobotDescription& robot,
                                        const controller::RobotModel& model, const WeakForm& form,
                                        const MatrixXd& model_torque) {
  std::vector<Hypothesis> all;
  const int n = model.dof();
  if (!robot.options.gravity.isZero(0)) {
    all.push_back({0, tilt_columns(robot, form), "gravity is", "", 1, true});
  }
  for (int j = 0; j < n; ++j) {
    MatrixXd own_torque = MatrixXd::Zero(n, form.count());
    own_torque.row(j) = model_torque.row(j);
    all.push_back({j, {std::move(own_torque)}, "its torque reads", "%", 100});
    if (j + 1 == n) break;  // what the last link lacks is part of the payload
    const KDL::Segment& segment = kdl_chain(model).getSegment(static_cast<unsigned>(j));
    const controller::RobotModel part = part_of_arm(robot, model, j);
    std::vector<MatrixXd> columns = body_columns(part, form, 4);
    const controller::Attachment link = body_of(segment.getInertia());
    const std::string name = "'" + segment.getName() + "'";
    if (link.mass > 0) {
      controller::DynamicsKernel kernel(part);
      kernel.attach({});
      const MatrixXd bare = sum_of(form.torques(kernel, j + 1));
      kernel.attach(link);
      const MatrixXd own = sum_of(form.torques(kernel, j + 1)) - bare;
      all.push_back(
          {j, {own / link.mass}, "the mass of link " + name + " is", "kg", 1, false, true});
    }
    columns.erase(columns.begin());
    all.push_back({j, std::move(columns), "the centre of mass of link " + name + " is", "", 1});
  }
  return all;
}

}  // namespace dashpot::identification
