#pragma once
// The release of released_panda.hpp in MuJoCo: its own reading of the URDF, dynamics and
// integrators; springs and dampers of the tip as a passive force.
#include <dashpot/benchmarks/released_panda.hpp>

#include <mujoco/mujoco.h>

#include <algorithm>
#include <memory>
#include <stdexcept>

namespace dashpot::bench {

class MujocoPanda {
 public:
  using State = ReleasedPanda::State;

  MujocoPanda(double gain, int integrator, double step)
      : law_(gain),
        model_(read(), &mj_deleteModel),
        data_(mj_makeData(model_.get()), &mj_deleteData) {
    model_->opt.integrator = integrator;
    model_->opt.timestep = step;
    mju_zero3(model_->opt.gravity);
    model_->opt.disableflags |=
        mjDSBL_CONTACT | mjDSBL_LIMIT | mjDSBL_CONSTRAINT | mjDSBL_WARMSTART;
    for (int i = 0; i < model_->nv; ++i) {
      model_->dof_damping[i] = ReleasedPanda::kFriction;
      model_->dof_frictionloss[i] = 0;
      model_->dof_armature[i] = 0;
    }
    for (int i = 0; i < model_->njnt; ++i) {
      model_->jnt_stiffness[i] = ReleasedPanda::kPosture;
      model_->qpos_spring[i] = ReleasedPanda::rest()[static_cast<std::size_t>(i)];
    }
    check();
  }

  /// The state after `steps` steps.
  State run(ReleasedPanda& /*ours*/, int steps) {
    active() = this;
    mjcb_passive = &push_tip;
    mju_user_warning = [](const char*) {};  // of unstable steps; otherwise they go to a file
    put(ReleasedPanda::start());
    for (int i = 0; i < steps; ++i) mj_step(model_.get(), data_.get());
    State y{};
    std::copy_n(data_->qpos, ReleasedPanda::kJoints, y.begin());
    std::copy_n(data_->qvel, ReleasedPanda::kJoints, y.begin() + ReleasedPanda::kJoints);
    mjcb_passive = nullptr;
    return y;
  }

 private:
  static mjModel* read() {
    std::array<char, 1000> error{};
    mjModel* model = mj_loadXML(ReleasedPanda::file().c_str(), nullptr, error.data(), error.size());
    if (model == nullptr || model->nv != ReleasedPanda::kJoints) {
      throw std::runtime_error(std::string("MuJoCo cannot read the robot: ") + error.data());
    }
    return model;
  }

  void put(const State& y) {
    mj_resetData(model_.get(), data_.get());
    std::copy_n(y.begin(), ReleasedPanda::kJoints, data_->qpos);
    std::copy_n(y.begin() + ReleasedPanda::kJoints, ReleasedPanda::kJoints, data_->qvel);
  }

  /// That both have the same right-hand side, but for the eight digits of MuJoCo's principal
  /// moments.
  void check() {
    State y = ReleasedPanda::start(), y_dot;
    for (std::size_t i = 7; i < 14; ++i) y[i] = 0.1 * static_cast<double>(i) - 1;
    law_.derivative(y.data(), y_dot.data());
    active() = this;
    mjcb_passive = &push_tip;
    put(y);
    mj_forward(model_.get(), data_.get());
    mjcb_passive = nullptr;
    double largest = 0, difference = 0;
    for (std::size_t i = 0; i < 7; ++i) {
      largest = std::max(largest, std::abs(y_dot[7 + i]));
      difference = std::max(difference, std::abs(data_->qacc[i] - y_dot[7 + i]));
    }
    if (!(difference < 1e-7 * largest)) {
      throw std::runtime_error("MuJoCo has another right-hand side");
    }
  }

  static MujocoPanda*& active() {
    static MujocoPanda* panda = nullptr;
    return panda;
  }

  /// Adds J' w of the law's wrench w at the tip.
  static void push_tip(const mjModel* model, mjData* data) {
    const MujocoPanda& self = *active();
    const int body = static_cast<int>(model->nbody) - 1;
    using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    const Eigen::Matrix3d R = Eigen::Map<const RowMajor3>(data->xmat + 9 * body);
    const sim::Pose& tip = self.law_.robot().tip();
    const Eigen::Vector3d position =
        Eigen::Map<const Eigen::Vector3d>(data->xpos + 3 * body) + R * tip.position;
    Eigen::Matrix<double, 6, 7, Eigen::RowMajor> J;
    mj_jac(model, data, J.data(), J.data() + 21, position.data(), body);
    const Eigen::Map<const Eigen::Matrix<double, 7, 1>> qd(data->qvel);
    const sim::Vector6 twist = J * qd;
    const sim::Pose pose{position, R * tip.rotation};
    Eigen::Map<Eigen::Matrix<double, 7, 1>>(data->qfrc_passive) +=
        J.transpose() * self.law_.wrench_of(pose, twist);
  }

  ReleasedPanda law_;
  std::unique_ptr<mjModel, void (*)(mjModel*)> model_;
  std::unique_ptr<mjData, void (*)(mjData*)> data_;
};

}  // namespace dashpot::bench
