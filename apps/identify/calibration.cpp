#include <dashpot/apps/identify/loop_prediction.hpp>
#include <dashpot/controller/input_error.hpp>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace dashpot::apps {
namespace {

using controller::Joint;

/// Largest root mean square of differences, in deviations, with which a model fits: noise alone
/// gives 1, and an arm is not quite linear.
constexpr double kFits = 3;
constexpr double kFar = 2.5;  ///< deviations, beyond which a difference counts linearly

/// Huber's weights: a large difference counts less than by its square, because a spurious mode must
/// not decide.
VectorXd robust(const VectorXd& differences) {
  return differences.unaryExpr([](double d) {
    const double size = std::abs(d);
    return size <= kFar ? d : std::copysign(std::sqrt(2 * kFar * size - kFar * kFar), d);
  });
}

double root_mean_square(const VectorXd& r) {
  return r.size() > 0 ? std::sqrt(r.squaredNorm() / static_cast<double>(r.size())) : 0;
}

/// Parameters by their names, and their effect on a correction. The search has coordinates of its
/// own, which stay above `least()`: for a payload's inertia about x, y and z these are the sums
/// over its mass of x^2, y^2 and z^2, because a body has an inertia exactly if they are not
/// negative.
class Parameters {
 public:
  Parameters(const LoopPrediction& loop, const std::string& names) {
    const controller::Config& config = loop.config();
    const Index n = loop.dof();
    for (std::size_t at = 0; at <= names.size();) {
      const auto end = std::min(names.find(',', at), names.size());
      const std::string name = names.substr(at, end - at);
      at = end + 1;
      if (name == "payload") {
        add(name, "kg", config.robot.options.payload.mass, 20, -1);
      } else if (name == "payload_center" || name == "payload_inertia") {
        const controller::Payload& payload = config.robot.options.payload;
        const bool center = name == "payload_center";
        for (int i = 0; i < 3; ++i) {
          add(name + " " + std::string("xyz").substr(static_cast<std::size_t>(i), 1),
              center ? "m" : "kg m^2", center ? payload.center[i] : payload.inertia(i, i),
              center ? 0.2 : 0.1, i);
        }
      } else if (name == "delay") {
        add(name, "ticks", config.settings.analysis.sampled.delay, 10, -1);
      } else if (name == "reflected_inertia" || name == "friction") {
        const bool inertia = name == "reflected_inertia";
        JointVector before = inertia ? config.robot.options.reflected_inertia
                                     : config.model.joint_values(&Joint::viscous_friction);
        if (before.size() == 0) before = JointVector::Zero(n);
        for (Index i = 0; i < n; ++i) {
          add(name + " " + std::to_string(i + 1), inertia ? "kg m^2" : "N m s/rad", before[i],
              inertia ? 1 : 20, static_cast<int>(i));
        }
      } else if (name == "gear_stiffness") {
        if (config.model.elastic_joints() == 0) {
          throw InputError("--calibrate",
                           "'gear_stiffness' needs robot.gear_stiffness in the configuration, a "
                           "first guess, N m/rad");
        }
        const JointVector before = config.model.joint_values(&Joint::gear_stiffness);
        for (Index i = 0; i < n; ++i) {
          if (!std::isfinite(before[i])) continue;
          add(name + " " + std::to_string(i + 1), "N m/rad", before[i], before[i],
              static_cast<int>(i));
        }
      } else {
        throw InputError("--calibrate", "'" + name +
                                            "' is unknown; there are payload, payload_center, "
                                            "payload_inertia, reflected_inertia, friction, "
                                            "gear_stiffness, delay");
      }
      if (std::count(kinds_.begin(), kinds_.end(), name) > 0) {
        throw InputError("--calibrate", "'" + name + "' twice");
      }
      kinds_.push_back(name);
    }
    shown = MatrixXd::Identity(size(), size());
    VectorXd values(size());
    for (Index k = 0; k < size(); ++k) {
      values[k] = list[static_cast<std::size_t>(k)].before;
      if (!is_inertia(k)) continue;
      const Index first = k - joints_[static_cast<std::size_t>(k)];
      shown.row(k).segment<3>(first).setOnes();
      shown(k, k) = 0;
    }
    start = shown.partialPivLu().solve(values).cwiseMax(least());
  }

  Index size() const { return static_cast<Index>(list.size()); }

  ModelCorrection correction(const VectorXd& coordinates, Index n) const {
    const VectorXd values = shown * coordinates;
    ModelCorrection result;
    for (std::size_t k = 0; k < list.size(); ++k) {
      const double added = values[static_cast<Index>(k)] - list[k].before;
      const int joint = joints_[k];
      if (list[k].name.starts_with("payload_center")) {
        result.center[joint] = added;
      } else if (list[k].name.starts_with("payload_inertia")) {
        result.inertia[joint] = added;
      } else if (joint >= 0) {
        VectorXd& vector = list[k].name.starts_with("friction") ? result.friction
                           : list[k].name.starts_with("gear")   ? result.gear_stiffness
                                                                : result.reflected_inertia;
        if (vector.size() == 0) vector = VectorXd::Zero(n);
        vector[joint] = added;
      } else {
        (list[k].name == "payload" ? result.payload : result.delay) = added;
      }
    }
    return result;
  }

  /// The least value of each coordinate: a centre may be anywhere, and gears have some stiffness.
  VectorXd least() const {
    constexpr double kSoftest = 0.05;  // of the stiffness in the configuration
    VectorXd result(size());
    for (std::size_t k = 0; k < list.size(); ++k) {
      result[static_cast<Index>(k)] = list[k].name.starts_with("payload_center") ? -kInfinity
                                      : list[k].name.starts_with("gear") ? kSoftest * list[k].before
                                                                         : 0;
    }
    return result;
  }

  std::vector<CalibratedParameter> list;
  VectorXd prior;  ///< deviation of a coordinate from the configuration
  VectorXd start;  ///< the coordinates of the configuration
  MatrixXd shown;  ///< coordinates to values

 private:
  bool is_inertia(Index k) const {
    return list[static_cast<std::size_t>(k)].name.starts_with("payload_inertia");
  }

  void add(const std::string& name, const std::string& unit, double before, double far, int joint) {
    list.push_back({name, unit, before, before, 0, false});
    joints_.push_back(joint);
    prior.conservativeResize(prior.size() + 1);
    prior[prior.size() - 1] = far;
  }

  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  std::vector<int> joints_;  ///< or axes; -1: of none
  std::vector<std::string> kinds_;
};

/// Differences of measured and predicted numbers in units of their deviations, at least `least`,
/// relative for frequencies.
VectorXd differences(const std::vector<PostureReport>& postures,
                     const std::vector<std::vector<PredictedMode>>& predicted, double least) {
  std::vector<double> all;
  for (std::size_t k = 0; k < postures.size(); ++k) {
    for (std::size_t i = 0; i < postures[k].predicted.size(); ++i) {
      const int number = postures[k].predicted[i].measured;
      if (number < 0 || i >= predicted[k].size()) continue;
      const MeasuredMode& mode = postures[k].found.modes[static_cast<std::size_t>(number)];
      const PredictedMode& there = predicted[k][i];
      const double w = mode.natural_frequency;
      // By noise alone: the scatter between parts is in the prediction as far as friction and
      // amplitude are, and the misfit shows the rest.
      const double frequency =
          std::max(0.0, std::pow(mode.natural_frequency_std, 2) - mode.frequency_scatter);
      const double ratio = std::max(0.0, std::pow(mode.damping_ratio_std, 2) - mode.ratio_scatter);
      const double most = 0.99 * std::sqrt(frequency * ratio);
      const double cross = std::clamp(mode.covariance, -most, most);
      Eigen::Matrix2d covariance;
      covariance << frequency + std::pow(least * w, 2), cross, cross, ratio + least * least;
      const Eigen::Vector2d difference(w - there.natural_frequency,
                                       mode.damping_ratio - there.damping_ratio);
      const Eigen::Vector2d scaled = covariance.llt().matrixL().solve(difference);
      all.insert(all.end(), {scaled[0], scaled[1]});
    }
  }
  return VectorXd::Map(all.data(), static_cast<Index>(all.size()));
}

}  // namespace

Calibration calibrate(const LoopPrediction& loop, const std::string& names,
                      std::vector<PostureReport>& postures) {
  Parameters parameters(loop, names);
  const Index p = parameters.size(), n = loop.dof();
  const VectorXd& before = parameters.start;
  const auto predict = [&](const VectorXd& values) {
    std::vector<std::vector<PredictedMode>> all;
    all.reserve(postures.size());
    for (const PostureReport& posture : postures) {
      all.push_back(loop.predict(posture.rest, parameters.correction(values, n)));
      put_in_order(posture.predicted, all.back());
    }
    return all;
  };
  const auto rematch = [&](const VectorXd& values) {
    const auto all = predict(values);
    for (std::size_t k = 0; k < postures.size(); ++k) {
      postures[k].predicted = all[k];
      match(postures[k].found.modes, postures[k].predicted);
    }
  };
  // Large deviations first, so that no wrong match at the start decides. The last ones are the
  // least that any number has, because no arm is exactly linear.
  constexpr std::array<double, 5> kLeast = {0.05, 0.01, 2e-3, 5e-4, 1e-4};
  double least = kLeast.back();
  Calibration result;
  rematch(before);
  result.misfit_before = root_mean_square(differences(postures, predict(before), least));

  VectorXd x = before;
  const VectorXd lowest = parameters.least();
  MatrixXd J;
  VectorXd r;
  const VectorXd weight = parameters.prior.cwiseInverse();
  const auto residual = [&](const VectorXd& values) {
    return robust(differences(postures, predict(values), least));
  };
  const auto linearize = [&] {
    r = residual(x);
    J.resize(r.size(), p);
    for (Index i = 0; i < p; ++i) {
      VectorXd moved = x;
      const double step = 1e-4 * parameters.prior[i];
      moved[i] += step;
      J.col(i) = (residual(moved) - r) / step;
    }
  };
  for (const double stage : kLeast) {
    least = stage;
    double damping = 1e-3;
    for (int iteration = 0; iteration < 20; ++iteration) {
      rematch(x);
      linearize();
      const VectorXd pull = weight.cwiseProduct(x - before);
      const double cost = r.squaredNorm() + pull.squaredNorm();
      MatrixXd A = J.transpose() * J;
      A.diagonal() += weight.cwiseAbs2();
      const VectorXd g = J.transpose() * r + weight.cwiseProduct(pull);
      bool better = false;
      double gain = 0;
      for (; !better && damping < 1e10; damping *= 10) {
        MatrixXd damped = A;
        damped.diagonal() *= 1 + damping;
        const VectorXd next = (x - damped.ldlt().solve(g)).cwiseMax(lowest);
        const VectorXd there = residual(next);
        gain = cost - there.squaredNorm() - weight.cwiseProduct(next - before).squaredNorm();
        if (there.size() == r.size() && gain >= 0) x = next, better = true;
      }
      damping = std::max(1e-9, damping / 100);
      if (!better || gain < (stage == kLeast.back() ? 1e-4 : 1e-2) * (1 + cost)) break;
    }
  }
  rematch(x);
  linearize();
  result.numbers = static_cast<int>(r.size());
  const VectorXd left = differences(postures, predict(x), least);
  result.misfit = root_mean_square(left);
  MatrixXd A = J.transpose() * J;
  A.diagonal() += weight.cwiseAbs2();
  result.consistent = r.size() > p && root_mean_square(r) < kFits;
  const double excess = r.squaredNorm() / std::max(1.0, static_cast<double>(r.size() - p));
  const MatrixXd covariance = parameters.shown * A.ldlt().solve(MatrixXd::Identity(p, p)) *
                              parameters.shown.transpose() * std::max(1.0, excess);
  const VectorXd values = parameters.shown * x;
  for (Index i = 0; i < p; ++i) {
    CalibratedParameter& one = parameters.list[static_cast<std::size_t>(i)];
    one.value = values[i];
    one.std = std::sqrt(covariance(i, i));
    // The deviation of a parameter means nothing if the model does not fit.
    one.determined = result.consistent && one.std < 0.2 * parameters.prior[i];
  }
  if (result.consistent && result.misfit >= kFits) {
    result.warnings.push_back(
        std::to_string((left.array().abs() > 2 * kFar).count()) + " of " +
        std::to_string(left.size()) +
        " numbers are further than 5 deviations from what is predicted, and count for less");
  }
  for (Index i = 0; i < p; ++i) {
    for (Index k = i + 1; k < p; ++k) {
      const double correlation = covariance(i, k) / std::sqrt(covariance(i, i) * covariance(k, k));
      if (std::abs(correlation) < 0.95) continue;
      result.warnings.push_back(parameters.list[static_cast<std::size_t>(i)].name + " and " +
                                parameters.list[static_cast<std::size_t>(k)].name +
                                " can hardly be told apart by these records (correlation " +
                                std::to_string(correlation).substr(0, 5) +
                                "): other postures, or fix one of them");
    }
  }
  if (root_mean_square(r) >= kFits) {
    result.warnings.emplace_back(
        "with these parameters the configuration does not explain the modes: something else "
        "differs (payload_center, payload_inertia, friction, delay, gears, the gains, the model)");
  }
  if (r.size() <= p) {
    result.warnings.push_back("no more numbers were measured (" + std::to_string(r.size()) +
                              ") than parameters are wanted (" + std::to_string(p) +
                              "): nothing is left to tell whether they explain the modes");
  }
  result.correction = parameters.correction(x, n);
  result.parameters = std::move(parameters.list);
  return result;
}

}  // namespace dashpot::apps
