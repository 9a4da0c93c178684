#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/identification/check_model.hpp>
#include <dashpot/identification/check_model/hypotheses.hpp>
#include <dashpot/identification/check_model/joint_order.hpp>
#include <dashpot/identification/check_model/link_or_payload.hpp>
#include <dashpot/identification/check_model/robust_fit.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
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
/// The same of a body of a known mass, beside its size: m from its centre.
constexpr double kPayloadSize = 0.1;
constexpr double kFarRotor = 10;      // kg m^2, and over a joint's inertia: no rotor has more
constexpr double kFarDelay = 0.03;    // s
constexpr double kKnownRotor = 0.04;  // deviation of a determined rotor, over it
constexpr double kHeld = 1e-9;        // instead of a prior, of what is known

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

/// Returns the diagonal of M, the mean along runs, kg m^2.
VectorXd mean_inertia(const controller::RobotModel& model, const std::vector<SmoothRun>& runs) {
  const controller::DynamicsKernel kernel(model);
  controller::DynamicsResult at;
  VectorXd sum = VectorXd::Zero(model.dof());
  double count = 0;
  for (const SmoothRun& run : runs) {
    const Index step = std::max<Index>(1, run.position.cols() / 50);
    for (Index i = 0; i < run.position.cols(); i += step, ++count) {
      kernel.evaluate(run.position.col(i), run.velocity.col(i), at);
      sum += at.M.diagonal();
    }
  }
  return sum / std::max(1.0, count);
}

/// What a window is for.
enum class Purpose : std::uint8_t { kFit, kValidation, kNothing };

/// Keeps the end of each record for validation, and windows apart that share samples.
std::vector<Purpose> purposes(const WeakForm& form, double share) {
  std::vector<std::pair<double, double>> span;
  for (const WeakForm::Window& window : form.windows()) {
    const auto record = static_cast<std::size_t>(window.record);
    if (record >= span.size()) span.resize(record + 1, {kUndetermined, -kUndetermined});
    span[record].first = std::min(span[record].first, window.from);
    span[record].second = std::max(span[record].second, window.to);
  }
  std::vector<Purpose> result;
  for (const WeakForm::Window& window : form.windows()) {
    const auto [from, to] = span[static_cast<std::size_t>(window.record)];
    const double border = to - share * (to - from);
    result.push_back(share == 0 || window.to <= border ? Purpose::kFit
                     : window.from >= border           ? Purpose::kValidation
                                                       : Purpose::kNothing);
  }
  return result;
}

/// The parameters and the rows of the fit.
class Fitting {
 public:
  Fitting(const controller::RobotModel& model, const std::vector<SmoothRun>& runs,
          const RecordFilter& how, const WeakForm& form, const ModelCheckOptions& options)
      : model_(model),
        form_(form),
        options_(options),
        n_(model.dof()),
        K_(form.count()),
        tau_(form.torque()),
        delay_(how.torque_delay),
        inertia_(mean_inertia(model, runs)),
        purpose_(purposes(form, options.validation)) {
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
        const bool fitted = purpose_[static_cast<std::size_t>(k)] == Purpose::kFit;
        if (!fitted || !moves_[static_cast<std::size_t>(j)]) fit_.used[k * n_ + j] = 0;
        if (!moves_[static_cast<std::size_t>(j)]) continue;
        fit_.A(k * n_ + j, 3 * j) = 1;
        fit_.A(k * n_ + j, 3 * j + 1) = sign(j, k);
        fit_.A(k * n_ + j, 3 * j + 2) = velocity(j, k);
      }
    }
    const std::vector<MatrixXd> body = body_columns(model, form, kPayloadColumns);
    for (std::size_t i = 0; i < body.size(); ++i)
      add(body[i], options.payload_known ? kHeld : i < 4 ? kUndetermined : kPayloadInertia);
    const MatrixXd acceleration = form.acceleration();
    for (Index j = 0; j < n_; ++j) {
      MatrixXd own = MatrixXd::Zero(n_, K_);
      own.row(j) = acceleration.row(j);
      add(own, kFarRotor * std::max(1.0, inertia_[j]));
    }
    add(form.torque_rate(), kFarDelay);
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
    for (Index j = 0; j < n_; ++j) {  // rotors are in what external torques leave out
      fit_.prior[rotor(j)] =
          kind == TorqueKind::kExternal ? kHeld : kFarRotor * std::max(1.0, inertia_[j]);
    }
    rest_ = tau_ - model_torque_;
    fit_.y = VectorXd::Map(rest_.data(), rest_.size());
    result_ = robust_fit(fit_);
    return left_over();
  }

  /// The same for whole torques, with gravity in a direction near that of the robot.
  double fit_inclined(const controller::RobotDescription& robot) {
    fit(TorqueKind::kWhole);
    if (!robot.options.gravity.isZero(0)) {
      const Index before = fit_.A.cols();
      for (const MatrixXd& column : tilt_columns(robot, form_)) add(column, kUndetermined);
      result_ = robust_fit(fit_);
      fit_.A.conservativeResize(Eigen::NoChange, before);
      fit_.prior.conservativeResize(before);
    }
    return left_over();
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

  /// After a fit, s by which torques act later than their times say, in all.
  double delay() const { return delay_ + result_.value[delay_index()]; }
  /// After a fit, whether the rest of the delay is too small for another fit.
  bool delay_is_taken() const {
    const double rest = std::abs(result_.value[delay_index()]);
    return rest < 2e-5 || rest < 0.1 * std::sqrt(result_.covariance(delay_index(), delay_index()));
  }

  /// After a fit, adds the hypothesis that explains most, as long as one explains much. Returns the
  /// gravity with which it explains more, if it is that, or if `tilted`.
  std::optional<Eigen::Vector3d> explain(const controller::RobotDescription& robot, bool tilted,
                                         ModelCheck& check) {
    narrow_payload(check);
    hypotheses_ = list_hypotheses(robot, model_, form_, model_torque_);
    if (kind_ != TorqueKind::kWhole) {  // which says little of what the robot holds by itself
      std::erase_if(hypotheses_,
                    [](const Hypothesis& h) { return h.what == "its torque reads" || h.gravity; });
    }
    check.joints.resize(static_cast<std::size_t>(n_));
    std::optional<Eigen::Vector3d> gravity;
    if (tilted && hypotheses_.front().gravity) gravity = tilt(robot, hypotheses_.front(), check);
    const Hypothesis* first_of_all = check.order.empty() ? best_hypothesis() : nullptr;
    if (first_of_all == nullptr || !first_of_all->gravity) weigh_link(check);
    const int most = check.order.empty() ? 4 : 0;  // of another arm's motion nothing is explained
    for (int round = 0; round < most; ++round) {
      const Hypothesis* best = best_hypothesis();
      if (best == nullptr) break;
      const LinearModel before = fit_;
      const RobustFit result_before = result_;
      const Index first = fit_.A.cols();
      take(*best);
      const std::string reason = reason_for(*best, first, result_before);
      if (!reason.empty() && best->gravity) return tilted_gravity(robot, first);
      if (reason.empty()) {
        fit_ = before;
        result_ = result_before;
        taken_.pop_back();
        break;
      }
      suspect(*best, reason, check);
    }
    report(check);
    return gravity;
  }

 private:
  double left_over() const {
    double sum = 0;
    for (Index j = 0; j < n_; ++j) {
      // What leaves less than a thousandth over is as good as all others that do.
      const double size = std::max(result_.sigma[j], 1e-3 * largest_[j]);
      if (moves_[static_cast<std::size_t>(j)] && size > 0) sum += 2 * std::log(size);
    }
    return sum;
  }

  void add(const MatrixXd& column, double prior) {
    fit_.A.conservativeResize(Eigen::NoChange, fit_.A.cols() + 1);
    fit_.A.rightCols(1) = VectorXd::Map(column.data(), column.size());
    fit_.prior.conservativeResize(fit_.A.cols());
    fit_.prior[fit_.A.cols() - 1] = prior;
  }

  Index rotor(Index j) const { return 3 * n_ + kPayloadColumns + j; }
  Index delay_index() const { return rotor(n_); }
  Index always() const { return delay_index() + 1; }  ///< parameters without hypotheses

  void take(const Hypothesis& hypothesis) {
    for (const MatrixXd& column : hypothesis.columns) add(column, kUndetermined);
    result_ = robust_fit(fit_);
    taken_.push_back(&hypothesis);
  }

  static void suspect(const Hypothesis& hypothesis, const std::string& reason, ModelCheck& check) {
    std::string& text = check.joints[static_cast<std::size_t>(hypothesis.joint)].suspicious;
    text += (text.empty() ? "" : "; ") + reason;
  }

  /// Gives the payload's inertia the prior of a body of its mass, and holds rotors that only it is
  /// told apart from.
  void narrow_payload(ModelCheck& check) {
    const Index mass = 3 * n_;
    const auto sure = [&](Index i) {
      return std::abs(result_.value[i]) + 2 * std::sqrt(result_.covariance(i, i));
    };
    if (!options_.payload_known && !unseen(mass)) {
      const double m = sure(mass) + 1e-3;
      const double moment = Eigen::Vector3d(sure(mass + 1), sure(mass + 2), sure(mass + 3)).norm();
      const double far = std::min(1.0, moment / m);
      const double inertia = m * (far * far + kPayloadSize * kPayloadSize);
      fit_.prior.segment<6>(mass + 4).setConstant(std::min(kPayloadInertia, inertia));
    }
    for (Index j = 0; j < n_; ++j) {
      const Index i = rotor(j);
      const double own = result_.covariance(i, i);
      for (Index k = mass; k < mass + 4; ++k) {
        constexpr double kAlike = 0.995;
        const double both = std::sqrt(own * result_.covariance(k, k));
        if (!(std::abs(result_.covariance(i, k)) > kAlike * both) || !(both > 0)) continue;
        if (fit_.prior[i] == kHeld) continue;
        fit_.prior[i] = kHeld;
        check.ambiguities.push_back("the records cannot tell apart " + parameter_name(i) + " and " +
                                    parameter_name(k) + ": the rotor is as the model says");
      }
    }
    result_ = robust_fit(fit_);
    check.parameters = static_cast<int>((fit_.prior.array() != kHeld).count());
    check.rank = check.parameters - static_cast<int>(result_.unseen.cols());
    check.condition = result_.condition;
  }

  Eigen::Vector3d tilted_gravity(const controller::RobotDescription& robot, Index first) const {
    const Eigen::Vector3d& before = robot.options.gravity;
    const Eigen::Vector3d after =
        before + tilt_directions(before) * result_.value.segment<2>(first);
    return before.norm() * after.normalized();
  }

  /// Frees the direction of gravity. Returns it.
  Eigen::Vector3d tilt(const controller::RobotDescription& robot, const Hypothesis& hypothesis,
                       ModelCheck& check) {
    const Index first = fit_.A.cols();
    take(hypothesis);
    check.gravity_deviation = std::sqrt(result_.covariance.diagonal().segment<2>(first).mean());
    return tilted_gravity(robot, first);
  }

  /// Where a payload is found, asks whether a link of another mass explains as much.
  void weigh_link(ModelCheck& check) {
    const LinkOrPayload found = link_or_payload(fit_, result_, hypotheses_, 3 * n_);
    if (found.link == nullptr || options_.payload_known) return;
    if (found.clearly) {
      const Index first = fit_.A.cols();
      take(*found.link);
      suspect(*found.link,
              "it looks as if " + found.link->what + " " + shown_value(*found.link, first) +
                  ", which explains the torques better than a payload does",
              check);
      return;
    }
    check.ambiguities.push_back("link or payload: the torques are explained as well if " +
                                found.link->what + " " + number_text(std::abs(found.mass)) +
                                " kg " + (found.mass > 0 ? "more" : "less") +
                                " than the model says as by another payload");
    spread_ = found.spread;
  }

  std::string shown_value(const Hypothesis& hypothesis, Index i) const {
    const double shown = result_.value[i] * hypothesis.factor;
    return number_text(std::abs(shown)) + " +- " +
           number_text(std::sqrt(result_.covariance(i, i)) * hypothesis.factor) + " " +
           hypothesis.unit + (shown > 0 ? " more" : " less") + " than the model says";
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
      if (count == 1) values = shown_value(hypothesis, i);
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
           number_text(rms(before.residual, weights(before), most)) +
           (slides(most) ? " N over" : " N m over");
  }

  /// Whether something unseen has a share in parameter i.
  bool unseen(Index i) const {
    return result_.unseen.cols() > 0 && result_.unseen.row(i).norm() > 0.01;
  }

  double variance(Index i) const {
    return result_.covariance(i, i) + (spread_.size() > 0 ? std::pow(spread_[i], 2) : 0);
  }

  /// All of a joint's rotor.
  Estimate rotor_estimate(Index j) const {
    Estimate one;
    one.value =
        model_.joints()[static_cast<std::size_t>(j)].reflected_inertia + result_.value[rotor(j)];
    if (unseen(rotor(j)) || fit_.prior[rotor(j)] == kHeld) return one;
    one.deviation = std::sqrt(variance(rotor(j)));
    one.determined = one.deviation < kKnownRotor * one.value;
    return one;
  }

  Estimate estimate(Index i, double scale) const {
    Estimate one;
    one.value = result_.value[i];
    if (unseen(i)) return one;
    one.deviation = std::sqrt(variance(i));
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
      const double deviation = std::sqrt(variance(first));
      check.payload.mass.deviation = deviation;
      check.payload.mass.determined =
          spread_.size() == 0 && deviation < std::max(0.01 * moved_mass(), 0.1 * std::abs(mass));
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
    if (i < rotor(0)) return "the payload's inertia";
    if (i == delay_index()) return "the delay of the torques";
    return i < delay_index() ? "reflected inertia of joint " + std::to_string(i - rotor(0) + 1)
                             : "what is suspected";
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
        const Index joint = i < 3 * n_ ? i / 3 : i - rotor(0);
        const bool rests = (i < 3 * n_ || (i >= rotor(0) && i < delay_index())) &&
                           !moves_[static_cast<std::size_t>(joint)];
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
    for (Index i = 0; i < always(); ++i) {
      for (Index k = i + 1; k < always(); ++k) {
        const auto nuisance = [this](Index at) {
          return fit_.prior[at] == kHeld || (at >= 3 * n_ + 4 && at < rotor(0)) || unseen(at);
        };
        if (nuisance(i) || nuisance(k)) continue;
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
        joint.wanted = "nothing: turn it both ways, faster than it did";
        continue;
      }
      joint.residual_before = rms(fit_.y, weight, j);
      joint.residual_after = rms(result_.residual, weight, j);
      joint.offset = estimate(3 * j, largest_[j]);
      joint.coulomb_friction = estimate(3 * j + 1, largest_[j]);
      joint.viscous_friction = estimate(3 * j + 2, largest_[j]);
      joint.reflected_inertia = rotor_estimate(j);
      validate(j, joint);
      if (check.order.empty()) doubt(j, joint, weight);
      joint.wanted = wanted(j, joint);
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
    check.delay.value = delay();
    if (!unseen(delay_index())) {
      check.delay.deviation = std::sqrt(variance(delay_index()));
      constexpr double kKnownDelay = 2.5e-4;  // s
      check.delay.determined =
          check.delay.deviation < std::max(kKnownDelay, 0.05 * std::abs(delay()));
    }
    check.covariance = result_.covariance.topLeftCorner(always(), always());
    report_ambiguities(check);
    report_contacts(check);
  }

  /// Returns what is not determined of joint j, and which motion would tell.
  std::string wanted(Index j, const JointCheck& joint) const {
    std::string text;
    const auto add_reason = [&text](const std::string& reason) {
      text += (text.empty() ? "" : "; ") + reason;
    };
    if (fit_.prior[rotor(j)] == kHeld) {
      add_reason("reflected inertia: move it without a payload, or with a known one");
    } else if (!joint.reflected_inertia.determined) {
      const Estimate& one = joint.reflected_inertia;
      const bool seen = one.value > 3 * one.deviation;
      add_reason(seen
                     ? "reflected inertia: accelerate " +
                           number_text(one.deviation / (kKnownRotor * one.value)) + " times as much"
                     : "reflected inertia, below " +
                           number_text(std::max(0.0, one.value) + 2 * one.deviation) +
                           (slides(j) ? " kg" : " kg m^2") + ": accelerate more");
    }
    if (!joint.coulomb_friction.determined || !joint.viscous_friction.determined) {
      add_reason("friction: turn it both ways, slowly and fast");
    }
    if (!joint.offset.determined) add_reason("offset: move it at other postures of all joints");
    return text;
  }

  /// What the part kept for validation says of joint j.
  void validate(Index j, JointCheck& joint) const {
    double count = 0, mean = 0, all = 0, before = 0, after = 0, neighbours = 0, last = 0;
    const auto each = [&](const auto& visit) {
      for (Index k = 0; k < K_; ++k) {
        if (purpose_[static_cast<std::size_t>(k)] == Purpose::kValidation && turning_(j, k) > 0) {
          visit(k);
        }
      }
    };
    each([&](Index k) { mean += tau_(j, k), ++count; });
    mean /= std::max(1.0, count);
    const controller::Joint& model = model_.joints()[static_cast<std::size_t>(j)];
    each([&](Index k) {
      const Index row = k * n_ + j;
      const double was = fit_.y[row] - fit_.A(row, 3 * j + 1) * model.coulomb_friction -
                         fit_.A(row, 3 * j + 2) * model.viscous_friction;
      const double left = result_.residual[row];
      all += std::pow(tau_(j, k) - mean, 2);
      before += was * was;
      after += left * left;
      neighbours += left * last;
      last = left;
    });
    if (!(all > 0)) return;
    joint.explained_before = std::max(0.0, 1 - before / all);
    joint.explained_after = std::max(0.0, 1 - after / all);
    joint.correlation = after > 0 ? neighbours / after : 0;
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
    doubt_rotor(j, joint, say, weight);
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
          (slides(j) ? " N" : " N m") +
          " of its torque's variation remain unexplained by model, friction, offset and "
          "payload");
    }
  }

  /// Compares the rotor with the model's.
  template <typename Say>
  void doubt_rotor(Index j, const JointCheck& joint, const Say& say, const VectorXd& weight) const {
    const double added = result_.value[rotor(j)];
    const VectorXd without = result_.residual + fit_.A.col(rotor(j)) * added;
    const double old = rms(without, weight, j);
    constexpr double kSmall = 0.005, kShare = 0.8, kClear = 4;
    if (!(std::abs(added) > kClear * joint.reflected_inertia.deviation)) return;
    if (old < kSmall * largest_[j] || joint.residual_after > kShare * old) return;
    say("it looks as if its reflected inertia is " + number_text(std::abs(added)) + " +- " +
        number_text(joint.reflected_inertia.deviation) + (slides(j) ? " kg" : " kg m^2") +
        (added > 0 ? " more" : " less") + " than the model says: joint " + std::to_string(j + 1) +
        " then leaves " + number_text(joint.residual_after) + " instead of " + number_text(old) +
        (slides(j) ? " N over" : " N m over"));
  }

  bool slides(Index j) const {
    return model_.joints()[static_cast<std::size_t>(j)].type == controller::JointType::kPrismatic;
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
  ModelCheckOptions options_;
  Index n_, K_;
  TorqueKind kind_ = TorqueKind::kWhole;
  MatrixXd tau_;
  double delay_;
  VectorXd inertia_;
  std::vector<Purpose> purpose_;
  WindowTorques own_;
  MatrixXd model_torque_, rest_, turning_;
  VectorXd largest_;
  std::vector<bool> moves_;
  LinearModel fit_;
  std::vector<Hypothesis> hypotheses_;
  std::vector<const Hypothesis*> taken_;
  RobustFit result_;
  VectorXd spread_;  ///< how far parameters differ if a link is wrong in place of the payload
};

/// Smoothed records, and the fit of a model to them.
struct Comparison {
  Comparison(const controller::RobotModel& model, const std::vector<TorqueRecord>& records,
             const RecordFilter& how, const ModelCheckOptions& options)
      : runs(smooth(records, how)), form(runs, how), fitting(model, runs, how, form, options) {}
  Comparison(const Comparison&) = delete;
  Comparison& operator=(const Comparison&) = delete;
  ~Comparison() = default;

  std::vector<SmoothRun> runs;
  WeakForm form;
  Fitting fitting;
};

/// Two in the sum of logarithms is a seventh of the variance at one joint.
constexpr double kMuchBetter = 2;
constexpr double kMuchLeft = 0.05;  // of a joint's largest torque

/// Fits again with the torques as much later as they were found to act, until they are.
std::unique_ptr<Comparison> take_delay(const controller::RobotModel& model,
                                       const std::vector<TorqueRecord>& records, RecordFilter how,
                                       const ModelCheckOptions& options, TorqueKind kind,
                                       std::unique_ptr<Comparison> last) {
  constexpr double kLongest = 0.1;  // s: longer is no delay, but another motion
  for (int round = 0; round < 4 && !last->fitting.delay_is_taken(); ++round) {
    how.torque_delay = last->fitting.delay();
    if (std::abs(how.torque_delay) > kLongest) break;
    auto next = std::make_unique<Comparison>(model, records, how, options);
    if (next->form.count() < kFewestWindows) break;
    next->fitting.fit(kind);
    last = std::move(next);
  }
  return last;
}

/// Returns the robot as it hangs from a ceiling or at a wall, if whole torques then fit far better
/// than `best`.
std::optional<controller::RobotDescription> hung(const controller::RobotDescription& robot,
                                                 const Comparison& upright, const RecordFilter& how,
                                                 const ModelCheckOptions& options, double best) {
  std::optional<controller::RobotDescription> found;
  double least = best - kMuchBetter;
  for (int k = 0; k < 6; ++k) {
    controller::RobotDescription other = robot;
    other.options.gravity =
        (k < 3 ? 1 : -1) * robot.options.gravity.norm() * Eigen::Vector3d::Unit(k % 3) +
        Eigen::Vector3d::Zero();  // no zero with a sign
    const controller::RobotModel hanging = other.model();
    Fitting there(hanging, upright.runs, how, upright.form, options);
    const double score = there.fit_inclined(other);
    if (score < least) least = score, found = other;
  }
  return found;
}

/// check_model for a robot whose gravity was changed so many times already; its direction is free
/// then.
ModelCheck compare(const controller::RobotDescription& robot,
                   const std::vector<TorqueRecord>& records, const ModelCheckOptions& options,
                   int tilts) {
  const controller::RobotModel model = robot.model();
  check_sizes(records, model.dof());
  const RecordFilter how = choose_smoothing(records);
  auto comparison = std::make_unique<Comparison>(model, records, how, options);
  const WeakForm& form = comparison->form;
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
  check.validation = options.validation * check.used;
  Fitting& fitting = comparison->fitting;
  if (!fitting.anything_moves()) {
    throw std::invalid_argument("no joint moves by more than its noise");
  }
  double best = fitting.fit_inclined(robot);
  if (tilts == 0) {
    for (const TorqueKind kind : {TorqueKind::kWithoutGravity, TorqueKind::kExternal}) {
      const double score = fitting.fit(kind);
      if (best - score > kMuchBetter) best = score, check.kind = kind;
    }
  }
  fitting.fit(check.kind);
  if (tilts == 0 && (check.kind != TorqueKind::kWhole || fitting.most_left() > kMuchLeft)) {
    if (const auto other = hung(robot, *comparison, how, options, best)) {
      ModelCheck there = compare(*other, records, options, 1);
      if (there.order.empty()) return there;
    }
  }
  const JointOrder order = find_order(model, comparison->runs, how);
  if (tilts < 2 && !order.joints().empty()) {
    // Only with a payload is it certain that no payload is the reason.
    const std::vector<SmoothRun> changed = order.apply(comparison->runs);
    const WeakForm changed_form(changed, how);
    if (best - Fitting(model, changed, how, changed_form, options).fit(order.kind) > kMuchBetter) {
      check.kind = order.kind;
      check.order = order.changes();
    }
  }
  fitting.fit(check.kind);
  if (check.order.empty()) {
    comparison = take_delay(model, records, how, options, check.kind, std::move(comparison));
  }
  const auto gravity = comparison->fitting.explain(robot, tilts > 0, check);
  if (gravity && gravity->allFinite()) {
    const Eigen::Vector3d& before = robot.options.gravity;
    const double moved = (*gravity - before).norm() / before.norm();
    // A direction along an axis is taken for exact where nothing contradicts it.
    constexpr double kSmallTilt = 0.005, kSettled = 1e-3;  // rad
    const bool settled =
        tilts > 1 ? moved < kSettled : moved < std::max(kSmallTilt, 4 * check.gravity_deviation);
    constexpr int kMostTilts = 6;
    if (tilts == 0 || (!settled && tilts < kMostTilts)) {
      controller::RobotDescription tilted = robot;
      tilted.options.gravity = *gravity;
      return compare(tilted, records, options, std::max(2, tilts + 1));
    }
    check.gravity = tilts > 1 ? *gravity : before;
    check.gravity_fits =
        comparison->fitting.most_left() <= kMuchLeft ||
        std::all_of(check.joints.begin(), check.joints.end(),
                    [](const JointCheck& joint) { return joint.suspicious.empty(); });
  }
  if (check.order.empty()) return check;
  for (const Index j : order.joints()) {
    check.joints[static_cast<std::size_t>(j)].suspicious =
        "its columns look exchanged or turned around";
  }
  return check;
}

}  // namespace

ModelCheck check_model(const controller::RobotDescription& robot,
                       const std::vector<TorqueRecord>& records, const ModelCheckOptions& options) {
  return compare(robot, records, options, 0);
}

}  // namespace dashpot::identification
