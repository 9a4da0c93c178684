#include <dashpot/identification/check_model/weak_form.hpp>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace dashpot::identification {
namespace {

/// Samples of some channels at their times.
struct Samples {
  std::vector<double> time;
  MatrixXd value;  ///< channels x N
};

double median_of(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Rows per new sample in a record that was written faster than the robot reports; 1: no
/// repetition. Repetition makes runs of equal rows all about as long; an arm at rest or coarse
/// encoders do not.
Index repeats_of(const std::vector<Index>& runs) {
  std::vector<double> lengths(runs.begin(), runs.end());
  const double median = median_of(lengths);
  if (median < 2) return 1;
  const auto alike = std::count_if(lengths.begin(), lengths.end(), [median](double length) {
    return std::abs(length - median) <= 1;
  });
  return static_cast<double>(alike) > 0.8 * static_cast<double>(lengths.size())
             ? static_cast<Index>(median)
             : 1;
}

/// The rows without a missing value, and without repetitions.
Samples samples_of(const VectorXd& time, const MatrixXd& value) {
  std::vector<Index> rows;
  for (Index i = 0; i < time.size(); ++i) {
    if (value.col(i).allFinite()) rows.push_back(i);
  }
  std::vector<Index> runs;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const bool same = i > 0 && value.col(rows[i]) == value.col(rows[i - 1]);
    if (same) {
      ++runs.back();
    } else {
      runs.push_back(1);
    }
  }
  const Index repeats = repeats_of(runs);
  std::vector<Index> kept;
  std::size_t at = 0;
  for (const Index run : runs) {
    for (Index i = 0; i < run; ++i, ++at) {
      const bool last_odd_one = repeats > 1 && i > 0 && run <= repeats + 1;
      if (i % repeats == 0 && !last_odd_one) kept.push_back(rows[at]);
    }
  }
  Samples samples;
  samples.value.resize(value.rows(), static_cast<Index>(kept.size()));
  for (std::size_t i = 0; i < kept.size(); ++i) {
    samples.time.push_back(time[kept[i]]);
    samples.value.col(static_cast<Index>(i)) = value.col(kept[i]);
  }
  return samples;
}

/// Weights of samples, at times u relative to h, that make value and derivative (times h) at 0 of
/// the cubic that fits them best. False if the samples leave too large a gap.
bool local_weights(const VectorXd& u, VectorXd& value, VectorXd& slope) {
  constexpr double kLargestGap = 0.75;  // more is nearly one side alone, where slopes are wild
  if (u.size() < 6) return false;
  double before = -1;
  for (const double at : u) {
    if (at - before > kLargestGap) return false;
    before = at;
  }
  if (1 - before > kLargestGap) return false;
  Eigen::MatrixX4d powers(u.size(), 4);
  powers.col(0).setOnes();
  for (int k = 1; k < 4; ++k) powers.col(k) = powers.col(k - 1).cwiseProduct(u);
  const VectorXd weight = (1 - u.array().square()).square();
  const Eigen::MatrixX4d weighted = weight.asDiagonal() * powers;
  const Eigen::Matrix4d normal = powers.transpose() * weighted;
  const auto solver = normal.ldlt();
  value = weighted * solver.solve(Eigen::Vector4d::UnitX());
  slope = weighted * solver.solve(Eigen::Vector4d::UnitY());
  return value.allFinite() && slope.allFinite();
}

/// Walks along samples and gives the smoothed ones.
class Smoother {
 public:
  Smoother(Samples samples, double h) : samples_(std::move(samples)), h_(h) {}

  /// Value and rate at `time`, which never falls from call to call.
  bool at(double time, VectorXd& value, VectorXd& rate) {
    const auto N = samples_.time.size();
    while (from_ < N && samples_.time[from_] <= time - h_) ++from_;
    to_ = std::max(to_, from_);
    while (to_ < N && samples_.time[to_] < time + h_) ++to_;
    const auto from = static_cast<Index>(from_), count = static_cast<Index>(to_ - from_);
    u_ = (VectorXd::Map(samples_.time.data() + from, count).array() - time) / h_;
    if (!local_weights(u_, for_value_, for_slope_)) return false;
    value = samples_.value.middleCols(from, count) * for_value_;
    rate = samples_.value.middleCols(from, count) * for_slope_ / h_;
    return true;
  }

 private:
  Samples samples_;
  double h_;
  std::size_t from_ = 0, to_ = 0;
  VectorXd u_, for_value_, for_slope_;
};

/// The step of a quantised channel; 0: it is not quantised.
double quantum_of(const MatrixXd& value, Index channel) {
  std::vector<double> steps;
  for (Index i = 1; i < value.cols(); ++i) {
    const double step = std::abs(value(channel, i) - value(channel, i - 1));
    if (step > 0) steps.push_back(step);
  }
  if (steps.size() < 10) return 0;
  const double least = *std::min_element(steps.begin(), steps.end());
  const auto whole = std::count_if(steps.begin(), steps.end(), [least](double step) {
    const double count = step / least;
    return count < 1e4 && std::abs(count - std::round(count)) < 0.05;
  });
  return static_cast<double>(whole) > 0.95 * static_cast<double>(steps.size()) ? least : 0;
}

/// Standard deviation of a channel's noise, from its third differences, which a motion hardly has.
double noise_of(const MatrixXd& value, Index channel) {
  std::vector<double> differences;
  for (Index i = 3; i < value.cols(); ++i) {
    differences.push_back(std::abs(value(channel, i) - 3 * value(channel, i - 1) +
                                   3 * value(channel, i - 2) - value(channel, i - 3)));
  }
  const double quantum = quantum_of(value, channel);
  return std::max(median_of(std::move(differences)) / (0.6745 * std::sqrt(20.0)),
                  quantum / std::sqrt(12.0));
}

/// Noise of the rate over the noise of samples `step` apart, 1/s.
double rate_gain(double h, double step) {
  const auto reach = static_cast<Index>(std::floor(h / step * (1 - 1e-9)));
  const VectorXd u =
      VectorXd::LinSpaced(2 * reach + 1, -static_cast<double>(reach), static_cast<double>(reach)) *
      (step / h);
  VectorXd value, slope;
  return local_weights(u, value, slope) ? slope.norm() / h : 1 / step;
}

}  // namespace

RecordFilter choose_smoothing(const std::vector<TorqueRecord>& records) {
  std::vector<double> steps;
  const Index n = records.front().position.rows();
  VectorXd noise = VectorXd::Zero(n), speed = VectorXd::Zero(n);
  std::vector<Samples> all;
  for (const TorqueRecord& record : records) {
    // Smoothing has to reach over several samples of whichever comes more rarely.
    for (const MatrixXd* value : {&record.torque, &record.position}) {
      Samples samples = samples_of(record.time, *value);
      std::vector<double> own;
      for (std::size_t i = 1; i < samples.time.size(); ++i) {
        own.push_back(samples.time[i] - samples.time[i - 1]);
      }
      steps.push_back(median_of(std::move(own)));
      if (value == &record.position) all.push_back(std::move(samples));
    }
  }
  const double step = *std::max_element(steps.begin(), steps.end());
  if (!(step > 0)) throw std::invalid_argument("too few samples of positions and torques");
  for (const Samples& samples : all) {
    for (Index j = 0; j < n; ++j) {
      noise[j] = std::max(noise[j], noise_of(samples.value, j));
      if (samples.time.size() < 2) continue;
      // Mean speed along the path between samples far apart.
      const auto apart = std::max<Index>(1, static_cast<Index>(0.1 / step));
      double way = 0;
      for (Index i = apart; i < samples.value.cols(); i += apart) {
        way += std::abs(samples.value(j, i) - samples.value(j, i - apart));
      }
      speed[j] = std::max(speed[j], way / (samples.time.back() - samples.time.front()));
    }
  }
  RecordFilter how;
  how.half_width = std::max(0.025, 4.5 * step);
  for (int widening = 0; widening < 3; ++widening) {
    how.rate_noise = noise * rate_gain(how.half_width, step);
    bool clear = true;
    for (Index j = 0; j < n; ++j) {
      // A joint that rests has no speed to keep clear of.
      const bool rests = speed[j] * 0.1 < 3 * noise[j];
      clear = clear && (rests || how.rate_noise[j] < 0.05 * speed[j]);
    }
    if (clear || 2 * how.half_width > std::max(0.1, 9 * step)) break;
    how.half_width *= 2;
  }
  how.step = how.half_width / 3;
  return how;
}

std::vector<SmoothRun> smooth(const std::vector<TorqueRecord>& records, const RecordFilter& how) {
  std::vector<SmoothRun> runs;
  for (std::size_t number = 0; number < records.size(); ++number) {
    const TorqueRecord& record = records[number];
    const Index n = record.position.rows();
    Smoother position(samples_of(record.time, record.position), how.half_width);
    Smoother torque(samples_of(record.time.array() + how.torque_delay, record.torque),
                    how.half_width);
    const double begin = record.time[0], length = record.time[record.time.size() - 1] - begin;
    const auto count = static_cast<Index>(length / how.step) + 1;
    Index filled = 0;
    SmoothRun run;
    const auto finish = [&] {
      for (MatrixXd* value : {&run.position, &run.velocity, &run.torque}) {
        value->conservativeResize(n, filled);
      }
      if (filled > 0) runs.push_back(std::move(run));
      filled = 0;
    };
    VectorXd q, v, tau, unused;
    for (Index i = 0; i < count; ++i) {
      const double time = begin + static_cast<double>(i) * how.step;
      const bool there = position.at(time, q, v) && torque.at(time, tau, unused);
      if (!there) {
        finish();
        continue;
      }
      if (filled == 0) {
        run = {static_cast<int>(number), time, MatrixXd(n, count - i), MatrixXd(n, count - i),
               MatrixXd(n, count - i)};
      }
      run.position.col(filled) = q;
      run.velocity.col(filled) = v;
      run.torque.col(filled++) = tau;
    }
    finish();
  }
  return runs;
}

}  // namespace dashpot::identification
