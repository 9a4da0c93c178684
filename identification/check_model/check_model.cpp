#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/identification/check_model.hpp>
#include <dashpot/identification/check_model/hypotheses.hpp>
#include <dashpot/identification/check_model/joint_order.hpp>
#include <dashpot/identification/check_model/robust_fit.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

namespace dashpot::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kFewestWindows = 20;  // fewer leave no degrees of freedom for the deviations
constexpr double kUndetermined = std::numeric_limits<double>::infinity();
/// About what a body held at the tip can have about the tip link's origin, kg m^2: ordinary motion
/// says little of its inertia, and must not make the mass uncertain by it.
constexpr double kPayloadInertia = 0.1;
constexpr Index kPayloadColumns = 10;

void check_sizes(const std::vector<TorqueRecord>& records, Index n) {
  if (records.empty()) throw std::invalid_argument("no records");
  for (const TorqueRecord& record : records) {
    const Index N = record.time.size();
    if (record.position.rows() != n || record.torque.rows() != n || record.position.cols() != N ||
        record.torque.cols() != N) {
      throw std::invalid_argument("positions and torques have to be " + std::to_string(n) +
                                  " rows of as many samples as there are times");
    }
    for (Index i = 0; i < N; ++i) {
      const bool rises = i == 0 || record.time[i] > record.time[i - 1];
      if (!std::isfinite(record.time[i]) || !rises) {
        throw std::invalid_argument("times have to be finite and to rise (sample " +
                                    std::to_string(i + 1) + ")");
      }
    }
    if (N == 0) throw std::invalid_argument("a record without samples");
  }
}

std::string number_text(double value, const char* format = "%.2g") {
  char text[40];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

/// The parameters and the rows of the fit.
class Fitting {
 public:
  Fitting(const controller::RobotModel& model, const std::vector<SmoothRun>& runs,
          const RecordFilter& how, const WeakForm& form)
      : model_(model), form_(form), n_(model.dof()), K_(form.count()), tau_(form.torque()) {
    own_ = form.torques(controller::DynamicsKernel(model), n_);
    largest_ = tau_.cwiseAbs().rowwise().maxCoeff();

    VectorXd v0(n_), slow(n_);
    for (Index j = 0; j < n_; ++j) {
      double fastest = 0;
      for (const SmoothRun& run : runs) {
        fastest = std::max(fastest, run.velocity.row(j).cwiseAbs().maxCoeff());
      }
      v0[j] = std::max({3 * how.rate_noise[j], 0.01 * fastest, 1e-12});
      const bool slides =
          model.joints()[static_cast<std::size_t>(j)].type == controller::JointType::kPrismatic;
      // Below this gears stick and slip, and lubricants have no film yet: rad/s, m/s.
      const double creeping = slides ? 0.005 : 0.02;
      slow[j] = std::max({v0[j], 0.05 * fastest, creeping});
    }
    // Where a joint rests or creeps, friction is anything up to Coulomb's.
    constexpr double kMostRest = 0.2;
    turning_ = (form.slow_share(slow).array() < kMostRest).cast<double>();
    for (Index j = 0; j < n_; ++j) {
      moves_.push_back(turning_.row(j).sum() >= std::max(10.0, 0.02 * static_cast<double>(K_)));
    }
    fit_.joints = n_;
    fit_.used = VectorXd::Map(turning_.data(), turning_.size());
    fit_.A = MatrixXd::Zero(n_ * K_, 3 * n_);
    fit_.prior = VectorXd::Constant(3 * n_, kUndetermined);
    const MatrixXd sign = form.sign(v0), velocity = form.velocity();
    for (Index k = 0; k < K_; ++k) {
      for (Index j = 0; j < n_; ++j) {
        if (!moves_[static_cast<std::size_t>(j)]) {
          fit_.used[k * n_ + j] = 0;
          continue;
        }
        fit_.A(k * n_ + j, 3 * j) = 1;
        fit_.A(k * n_ + j, 3 * j + 1) = sign(j, k);
        fit_.A(k * n_ + j, 3 * j + 2) = velocity(j, k);
      }
    }
    const std::vector<MatrixXd> body = body_columns(model, form, kPayloadColumns);
    for (std::size_t i = 0; i < body.size(); ++i)
      add(body[i], i < 4 ? kUndetermined : kPayloadInertia);
  }

  bool anything_moves() const {
    return std::find(moves_.begin(), moves_.end(), true) != moves_.end();
  }

  /// Fits torques of a kind. Returns the sum of the logarithms of what the joints leave over.
  double fit(TorqueKind kind) {
    kind_ = kind;
    model_torque_ = MatrixXd::Zero(n_, K_);
    if (kind != TorqueKind::kExternal) model_torque_ += own_.inertial;
    if (kind == TorqueKind::kWhole) model_torque_ += own_.gravity;
    rest_ = tau_ - model_torque_;
    fit_.y = VectorXd::Map(rest_.data(), rest_.size());
    result_ = robust_fit(fit_);
    double sum = 0;
    for (Index j = 0; j < n_; ++j) {
      // What leaves less than a thousandth over is as good as all others that do.
      const double size = std::max(result_.sigma[j], 1e-3 * largest_[j]);
      if (moves_[static_cast<std::size_t>(j)] && size > 0) sum += 2 * std::log(size);
    }
    return sum;
  }

  /// After a fit, the largest share of a joint's largest torque that is left over.
  double most_left() const {
    double most = 0;
    for (Index j = 0; j < n_; ++j) {
      if (moves_[static_cast<std::size_t>(j)])
        most = std::max(most, result_.sigma[j] / largest_[j]);
    }
    return most;
  }

  /// After a fit, adds the hypothesis that explains most, as long as one explains much.
  void explain(const controller::RobotDescription& robot, ModelCheck& check) {
    hypotheses_ = list_hypotheses(robot, model_, form_, model_torque_);
    if (kind_ != TorqueKind::kWhole) {  // which says little of what the robot holds by itself
      std::erase_if(hypotheses_, [](const Hypothesis& h) { return h.what == "its torque reads"; });
    }
    check.joints.resize(static_cast<std::size_t>(n_));
    const int most = check.order.empty() ? 4 : 0;  // of another arm's motion nothing is explained
    for (int round = 0; round < most; ++round) {
      const Hypothesis* best = best_hypothesis();
      if (best == nullptr) break;
      const LinearModel before = fit_;
      const RobustFit result_before = result_;
      const Index first = fit_.A.cols();
      for (const MatrixXd& column : best->columns) add(column, kUndetermined);
      result_ = robust_fit(fit_);
      const std::string reason = reason_for(*best, first, result_before);
      if (reason.empty()) {
        fit_ = before;
        result_ = result_before;
        break;
      }
      std::string& text = check.joints[static_cast<std::size_t>(best->joint)].suspicious;
      text += (text.empty() ? "" : "; ") + reason;
      taken_.push_back(best);
    }
    report(check);
  }

 private:
  void add(const MatrixXd& column, double prior) {
    fit_.A.conservativeResize(Eigen::NoChange, fit_.A.cols() + 1);
    fit_.A.rightCols(1) = VectorXd::Map(column.data(), column.size());
    fit_.prior.conservativeResize(fit_.A.cols());
    fit_.prior[fit_.A.cols() - 1] = prior;
  }

  VectorXd weights(const RobustFit& fit) const { return fit_.used.cwiseProduct(fit.weight); }

  double rms(const VectorXd& values, const VectorXd& weight, Index joint) const {
    double sum = 0, count = 0;
    for (Index row = joint; row < values.size(); row += n_) {
      sum += weight[row] * values[row] * values[row];
      count += weight[row];
    }
    return count > 0 ? std::sqrt(sum / count) : 0;
  }

  /// The one that lessens the weighted squares most, if one does by much; null otherwise.
  const Hypothesis* best_hypothesis() const {
    VectorXd root(fit_.y.size());
    for (Index row = 0; row < root.size(); ++row) {
      root[row] = std::sqrt(fit_.used[row] * result_.weight[row]) / result_.sigma[row % n_];
    }
    const MatrixXd A = root.asDiagonal() * fit_.A * result_.scale.asDiagonal();
    MatrixXd normal = A.transpose() * A;
    normal.diagonal().array() += 1e-10;  // what is unseen stays where it is
    for (Index i = 0; i < fit_.prior.size(); ++i) {
      if (fit_.prior[i] < kUndetermined)
        normal(i, i) += std::pow(result_.scale[i] / fit_.prior[i], 2);
    }
    const auto solver = normal.ldlt();
    const VectorXd r = root.cwiseProduct(result_.residual);
    const double all = r.squaredNorm();
    // One more number has to take a tenth of everything, or it would be found in any noise that
    // is not white; three numbers half as much again as one.
    double most = 0.1 * all;
    const Hypothesis* best = nullptr;
    for (const Hypothesis& hypothesis : hypotheses_) {
      if (std::find(taken_.begin(), taken_.end(), &hypothesis) != taken_.end()) continue;
      const auto count = static_cast<Index>(hypothesis.columns.size());
      MatrixXd B(r.size(), count);
      for (Index i = 0; i < count; ++i) {
        const MatrixXd& column = hypothesis.columns[static_cast<std::size_t>(i)];
        B.col(i) = root.cwiseProduct(VectorXd::Map(column.data(), column.size()));
      }
      const VectorXd whole = B.colwise().squaredNorm().transpose();
      B -= A * solver.solve(A.transpose() * B);
      // A column that the others nearly make already is none of its own.
      if (!(B.colwise().squaredNorm().transpose().array() > 1e-6 * whole.array()).all()) continue;
      const MatrixXd own = B.transpose() * B;
      const VectorXd moment = B.transpose() * r;
      const double gain = moment.dot(own.ldlt().solve(moment)) / (count > 1 ? 1.5 : 1);
      if (gain > most) most = gain, best = &hypothesis;
    }
    return best;
  }

  /// Returns what is said of a hypothesis whose columns were added; "" if it is not significant.
  std::string reason_for(const Hypothesis& hypothesis, Index first, const RobustFit& before) const {
    const auto count = static_cast<Index>(hypothesis.columns.size());
    double largest = 0;
    std::string values;
    for (Index i = first; i < first + count; ++i) {
      const double value = result_.value[i], deviation = std::sqrt(result_.covariance(i, i));
      largest = std::max(largest, std::abs(value) / deviation);
      if (count == 1) {
        const double shown = value * hypothesis.factor;
        values = number_text(std::abs(shown)) + " +- " +
                 number_text(deviation * hypothesis.factor) + " " + hypothesis.unit +
                 (shown > 0 ? " more" : " less") + " than the model says";
      }
    }
    Index most = -1;
    double share = 0.8;  // a joint whose residual falls by less gives no reason to speak
    for (Index j = 0; j < n_; ++j) {
      const double old = rms(before.residual, weights(before), j);
      const double now = rms(result_.residual, weights(before), j);
      constexpr double kSmall = 0.005;  // no model is better than that
      if (old > kSmall * largest_[j] && now / old < share) share = now / old, most = j;
    }
    constexpr double kClear = 4;  // deviations
    if (largest < kClear || most < 0) return "";
    if (count > 1) values = "elsewhere";
    return "it looks as if " + hypothesis.what + " " + values + ": joint " +
           std::to_string(most + 1) + " then leaves " +
           number_text(rms(result_.residual, weights(before), most)) + " instead of " +
           number_text(rms(before.residual, weights(before), most)) + " N m over";
  }

  /// Whether something unseen has a share in parameter i.
  bool unseen(Index i) const {
    return result_.unseen.cols() > 0 && result_.unseen.row(i).norm() > 0.01;
  }

  Estimate estimate(Index i, double scale) const {
    Estimate one;
    one.value = result_.value[i];
    if (unseen(i)) return one;
    one.deviation = std::sqrt(result_.covariance(i, i));
    one.determined = one.deviation < std::max(0.5 * std::abs(one.value), 0.02 * scale);
    return one;
  }

  /// kg
  double moved_mass() const {
    double mass = 0;
    for (unsigned i = 0; i < static_cast<unsigned>(n_); ++i) {
      mass += kdl_chain(model_).getSegment(i).getInertia().getMass();
    }
    return mass;
  }

  void report_payload(ModelCheck& check) const {
    const controller::Attachment& before = model_.attachment();
    const Index first = 3 * n_;
    const double mass = before.mass + result_.value[first];
    const Eigen::Vector3d moment = before.first_moment + result_.value.segment<3>(first + 1);
    check.payload.mass.value = mass;
    if (!unseen(first)) {
      const double deviation = std::sqrt(result_.covariance(first, first));
      check.payload.mass.deviation = deviation;
      check.payload.mass.determined =
          deviation < std::max(0.01 * moved_mass(), 0.1 * std::abs(mass));
    }
    for (Index i = 0; i < 3; ++i) {
      Estimate& one = check.payload.center[static_cast<std::size_t>(i)];
      const Index at = first + 1 + i;
      if (unseen(first) || unseen(at) || mass == 0) continue;
      one.value = moment[i] / mass;
      const double square = result_.covariance(at, at) -
                            2 * one.value * result_.covariance(at, first) +
                            one.value * one.value * result_.covariance(first, first);
      one.deviation = std::sqrt(std::max(0.0, square)) / std::abs(mass);
      constexpr double kKnown = 0.03;  // m
      one.determined = mass > 3 * check.payload.mass.deviation && one.deviation < kKnown;
    }
  }

  std::string parameter_name(Index i) const {
    static constexpr std::array<const char*, 3> kJoint{"offset", "Coulomb friction",
                                                       "viscous friction"};
    static constexpr std::array<const char*, 4> kBody{
        "the payload's mass", "the payload's first moment along x",
        "the payload's first moment along y", "the payload's first moment along z"};
    if (i < 3 * n_) {
      return std::string(kJoint[static_cast<std::size_t>(i % 3)]) + " of joint " +
             std::to_string(i / 3 + 1);
    }
    if (i < 3 * n_ + 4) return kBody[static_cast<std::size_t>(i - 3 * n_)];
    return i < 3 * n_ + kPayloadColumns ? "the payload's inertia" : "what is suspected";
  }

  /// What the records cannot tell apart.
  void report_ambiguities(ModelCheck& check) const {
    const auto list = [](const std::vector<std::string>& names) {
      std::string text;
      for (std::size_t i = 0; i < names.size(); ++i) {
        text += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
      }
      return text;
    };
    for (Index d = 0; d < result_.unseen.cols(); ++d) {
      std::vector<std::string> names;
      for (Index i = 0; i < result_.unseen.rows(); ++i) {
        const bool rests = i < 3 * n_ && !moves_[static_cast<std::size_t>(i / 3)];
        if (!rests && std::abs(result_.unseen(i, d)) > 0.2) names.push_back(parameter_name(i));
      }
      if (names.empty()) continue;
      check.ambiguities.push_back(names.size() == 1
                                      ? "the records say nothing of " + names.front()
                                      : "the records cannot tell apart " + list(names));
    }
    for (Index j = 0; j < n_; ++j) {
      if (moves_[static_cast<std::size_t>(j)]) continue;
      check.ambiguities.push_back("joint " + std::to_string(j + 1) +
                                  " hardly moves: its friction is not known, and may be in its "
                                  "offset");
    }
    for (Index i = 0; i < 3 * n_ + 4; ++i) {
      for (Index k = i + 1; k < 3 * n_ + 4; ++k) {
        if (unseen(i) || unseen(k)) continue;
        const double correlation = result_.covariance(i, k) /
                                   std::sqrt(result_.covariance(i, i) * result_.covariance(k, k));
        if (std::abs(correlation) < 0.97) continue;
        check.ambiguities.push_back("the records can hardly tell apart " + parameter_name(i) +
                                    " and " + parameter_name(k) + " (correlation " +
                                    number_text(correlation, "%.3f") + ")");
      }
    }
  }

  /// Windows in which two joints or more do not fit, one after the other.
  void report_contacts(ModelCheck& check) const {
    const auto& windows = form_.windows();
    for (Index k = 0; k < K_; ++k) {
      int off = 0, used = 0;
      for (Index j = 0; j < n_; ++j) {
        const Index row = k * n_ + j;
        used += fit_.used[row] > 0 ? 1 : 0;
        // Where all else fits to a thousandth, what does not is no contact yet.
        constexpr double kSmall = 0.01;
        const bool far = std::abs(result_.residual[row]) > kSmall * largest_[j];
        off += fit_.used[row] > 0 && result_.weight[row] < 0.05 && far ? 1 : 0;
      }
      if (off < std::min(2, std::max(1, used))) continue;
      const WeakForm::Window& window = windows[static_cast<std::size_t>(k)];
      if (!check.contacts.empty() && check.contacts.back().record == window.record &&
          check.contacts.back().to >= window.from) {
        check.contacts.back().to = window.to;
      } else {
        check.contacts.push_back({window.record, window.from, window.to});
      }
    }
    // A single window is a joint that turns just then, more often than a touch.
    std::erase_if(check.contacts,
                  [this](const LeftOut& one) { return one.to - one.from < 1.2 * form_.width(); });
  }

  void report(ModelCheck& check) const {
    const VectorXd weight = weights(result_);
    for (Index j = 0; j < n_; ++j) {
      JointCheck& joint = check.joints[static_cast<std::size_t>(j)];
      joint.moves = moves_[static_cast<std::size_t>(j)];
      if (!joint.moves) {
        report_resting(j, joint);
        continue;
      }
      joint.residual_before = rms(fit_.y, weight, j);
      joint.residual_after = rms(result_.residual, weight, j);
      joint.offset = estimate(3 * j, largest_[j]);
      joint.coulomb_friction = estimate(3 * j + 1, largest_[j]);
      joint.viscous_friction = estimate(3 * j + 2, largest_[j]);
      if (check.order.empty()) doubt(j, joint, weight);
    }
    report_payload(check);
    const Estimate& mass = check.payload.mass;
    if (check.order.empty() && mass.value < -4 * mass.deviation &&
        mass.value < -0.005 * moved_mass()) {
      std::string& text = check.joints.back().suspicious;
      text += std::string(text.empty() ? "" : "; ") +
              "the payload that fits has a negative mass: the last links, or the payload of the "
              "configuration, weigh less than the model says";
    }
    report_ambiguities(check);
    report_contacts(check);
  }

  /// Reports a joint that hardly moves: an offset alone, which may contain static friction.
  void report_resting(Index j, JointCheck& joint) const {
    VectorXd rest(K_), explained(K_);
    const Index shared = fit_.A.cols() - 3 * n_;
    for (Index k = 0; k < K_; ++k) {
      rest[k] = fit_.y[k * n_ + j];
      explained[k] = fit_.A.row(k * n_ + j).tail(shared).dot(result_.value.tail(shared));
    }
    const VectorXd left = rest - explained;
    joint.residual_before = std::sqrt(rest.squaredNorm() / static_cast<double>(K_));
    joint.offset.value = left.mean();
    joint.residual_after =
        std::sqrt((left.array() - left.mean()).matrix().squaredNorm() / static_cast<double>(K_));
  }

  /// Reasons that need no hypothesis.
  void doubt(Index j, JointCheck& joint, const VectorXd& weight) const {
    const auto say = [&joint](const std::string& reason) {
      joint.suspicious += (joint.suspicious.empty() ? "" : "; ") + reason;
    };
    for (const auto& [name, one] : {std::pair("Coulomb", &joint.coulomb_friction),
                                    std::pair("viscous", &joint.viscous_friction)}) {
      if (one->value < -4 * one->deviation && -one->value > 0.02 * speed_scale(j, name)) {
        say(std::string("its ") + name +
            " friction is negative: the torque does not belong to this motion, or lags behind it");
      }
    }
    // Torque that varies with the motion, not the offset.
    VectorXd torque(fit_.y.size());
    torque.setZero();
    double mean = 0, count = 0;
    for (Index k = 0; k < K_; ++k) {
      const Index row = k * n_ + j;
      torque[row] = rest_(j, k) + model_torque_(j, k);
      mean += weight[row] * torque[row];
      count += weight[row];
    }
    torque.array() -= count > 0 ? mean / count : 0;
    const double varies = rms(torque, weight, j);
    constexpr double kMuch = 0.25;
    if (joint.residual_after > kMuch * varies && joint.suspicious.empty()) {
      say(number_text(joint.residual_after) + " of " + number_text(varies) +
          " N m of its torque's variation remain unexplained by model, friction, offset and "
          "payload");
    }
  }

  /// A torque, or a torque for a velocity, that is large for joint j.
  double speed_scale(Index j, const std::string& name) const {
    if (name == "Coulomb") return largest_[j];
    double fastest = 0;
    for (Index k = 0; k < K_; ++k) {
      fastest = std::max(fastest, std::abs(fit_.A(k * n_ + j, 3 * j + 2)));
    }
    return fastest > 0 ? largest_[j] / fastest : 0;
  }

  const controller::RobotModel& model_;
  const WeakForm& form_;
  Index n_, K_;
  TorqueKind kind_ = TorqueKind::kWhole;
  MatrixXd tau_;
  WindowTorques own_;
  MatrixXd model_torque_, rest_, turning_;
  VectorXd largest_;
  std::vector<bool> moves_;
  LinearModel fit_;
  std::vector<Hypothesis> hypotheses_;
  std::vector<const Hypothesis*> taken_;
  RobustFit result_;
};

}  // namespace

ModelCheck check_model(const controller::RobotDescription& robot,
                       const std::vector<TorqueRecord>& records) {
  const controller::RobotModel model = robot.model();
  check_sizes(records, model.dof());
  const RecordFilter how = choose_smoothing(records);
  const std::vector<SmoothRun> runs = smooth(records, how);
  const WeakForm form(runs, how);
  if (form.count() < kFewestWindows) {
    throw std::invalid_argument(
        number_text(static_cast<double>(form.count()) * form.width() / 2) +
        " s without gaps, need " +
        number_text(static_cast<double>(kFewestWindows) * form.width() / 2) +
        " s or more (samples every " + number_text(how.half_width / 4.5) + " s or closer)");
  }
  ModelCheck check;
  check.window = form.width();
  check.used = static_cast<double>(form.count()) * form.width() / 2;
  Fitting fitting(model, runs, how, form);
  if (!fitting.anything_moves()) {
    throw std::invalid_argument("no joint moves by more than its noise");
  }
  // Two in the sum of logarithms is a seventh of the variance at one joint.
  constexpr double kFarBetter = 2;
  double best = fitting.fit(TorqueKind::kWhole);
  for (const TorqueKind kind : {TorqueKind::kWithoutGravity, TorqueKind::kExternal}) {
    const double score = fitting.fit(kind);
    if (best - score > kFarBetter) best = score, check.kind = kind;
  }
  constexpr double kMuchLeft = 0.05;
  fitting.fit(check.kind);
  if (check.kind != TorqueKind::kWhole || fitting.most_left() > kMuchLeft) {
    controller::RobotDescription hung = robot;  // from a ceiling, or at a wall
    double least = best - kFarBetter;
    bool fits = false;
    for (int k = 0; k < 6; ++k) {
      controller::RobotDescription other = robot;
      other.options.gravity =
          (k < 3 ? 1 : -1) * robot.options.gravity.norm() * Eigen::Vector3d::Unit(k % 3) +
          Eigen::Vector3d::Zero();  // no zero with a sign
      const controller::RobotModel hanging = other.model();
      Fitting there(hanging, runs, how, form);
      const double score = there.fit(TorqueKind::kWhole);
      if (score < least) least = score, hung = other, fits = there.most_left() <= kMuchLeft;
    }
    if (least < best - kFarBetter) {
      ModelCheck there = check_model(hung, records);
      if (there.kind == TorqueKind::kWhole && there.order.empty()) {
        there.gravity = hung.options.gravity;
        there.gravity_fits = fits;
        return there;
      }
    }
  }
  const JointOrder order = find_order(model, runs, how);
  if (!order.joints().empty()) {
    // Only with a payload is it certain that no payload is the reason.
    const std::vector<SmoothRun> changed = order.apply(runs);
    const WeakForm changed_form(changed, how);
    if (best - Fitting(model, changed, how, changed_form).fit(order.kind) > kFarBetter) {
      check.kind = order.kind;
      check.order = order.changes();
    }
  }
  fitting.fit(check.kind);
  fitting.explain(robot, check);
  if (check.order.empty()) return check;
  for (const Index j : order.joints()) {
    check.joints[static_cast<std::size_t>(j)].suspicious =
        "its columns look exchanged or turned around";
  }
  return check;
}

}  // namespace dashpot::identification
