#pragma once
// Reference data of tests/data: second-order systems M q'' + C q' + K q = f with spectra known to
// 32 digits and responses to 16.
//
//   const SpectrumCase reference = spectrum_case(spectrum_names().front());
//   for (const Match& match : match_eigenvalues(computed_of(reference), reference.eigenvalues))
//     EXPECT_LT(match.relative, 1e-12L);
//
// The truth is that of the stored doubles; the tests that use it have FLINT and Arb prove each
// number. SI units throughout.

#include <dashpot/tests/support/places.hpp>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <fstream>
#include <limits>
#include <numeric>
#include <optional>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace dashpot::testing {

/// Returns the number in a longer type.
inline long double widened(double x) {
  return static_cast<long double>(x);
}

/// An eigenvalue in rad/s as unevaluated sums of two doubles: re = re_hi + re_lo, right to 1e-32
/// relative, each part by itself. A part that is exactly zero is stored as zero.
struct ReferenceEigenvalue {
  double re_hi = 0, re_lo = 0, im_hi = 0, im_lo = 0;
  /// How much it changes relatively, to first order, per entrywise relative change of M, C and K:
  /// what double precision can be asked for is this times 1e-16. Infinite for zero and multiple
  /// eigenvalues.
  double condition = std::numeric_limits<double>::infinity();

  [[nodiscard]] std::complex<long double> value() const {
    return {widened(re_hi) + widened(re_lo), widened(im_hi) + widened(im_lo)};
  }
  [[nodiscard]] bool is_zero() const { return re_hi == 0 && im_hi == 0; }
  [[nodiscard]] bool is_real() const { return im_hi == 0; }
};

/// One entry of spectra.json. Matrices are n x n and exactly symmetric; mass is positive definite.
struct SpectrumCase {
  std::string name;
  int n = 0;
  /// Zero modes: the exact dimension of the null space of the stored stiffness.
  int r = 0;
  Eigen::MatrixXd mass, damping, stiffness;
  /// W, (n - r) x n, with W' W = stiffness exactly.
  std::optional<Eigen::MatrixXd> stiffness_factor;
  /// All 2n, by modulus, conjugates adjacent (positive imaginary part first).
  std::vector<ReferenceEigenvalue> eigenvalues;
};

/// q(t) and q'(t), one column a time.
struct Trajectory {
  std::vector<double> times;  ///< s
  Eigen::MatrixXd position, velocity;
};

/// (K + i w C - w^2 M)^-1
struct ReferenceReceptance {
  double frequency = 0;  ///< rad/s
  Eigen::MatrixXcd value;
};

/// One entry of responses.json. Everything but the free response starts from rest at t = 0.
struct ResponseCase {
  std::string name;
  int n = 0;
  /// With a jacobian the truth is that of the exact products J' K_C J and J' C_C J, of which the
  /// stored stiffness and damping are the nearest doubles; without one it is that of the stored
  /// matrices.
  Eigen::MatrixXd mass, damping, stiffness;
  std::optional<Eigen::MatrixXd> jacobian, task_stiffness, task_damping;

  Eigen::VectorXd initial_position, initial_velocity;
  Trajectory free;

  Eigen::VectorXd impulse;  ///< generalized, at t = 0: q'(0+) = M^-1 impulse
  Trajectory impulse_response;

  Eigen::VectorXd constant_force;  ///< from t = 0
  Trajectory step_response;

  /// f(t) = cosine cos(w t) + sine sin(w t) from t = 0
  Eigen::VectorXd harmonic_cosine, harmonic_sine;
  double harmonic_frequency = 0;  ///< w in rad/s
  Trajectory harmonic_response;

  double sample_step = 0;  ///< s
  /// n x (number of samples): the force at k * sample_step, linear in between (first-order hold)
  Eigen::MatrixXd samples;
  Trajectory sampled_response;  ///< at times within the sampled span

  std::vector<ReferenceReceptance> receptance;
};

inline std::ostream& operator<<(std::ostream& out, const ReferenceEigenvalue& z) {
  return out << z.re_hi << (z.im_hi < 0 ? " - " : " + ") << std::abs(z.im_hi) << "i";
}

// ---------------------------------------------------------------------- loading

namespace detail {

using Json = nlohmann::json;

inline Eigen::VectorXd to_vector(const Json& numbers) {
  const auto values = numbers.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// `columns` gives the shape of a matrix without rows.
inline Eigen::MatrixXd to_matrix(const Json& rows, Eigen::Index columns) {
  Eigen::MatrixXd result(static_cast<Eigen::Index>(rows.size()), columns);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    result.row(static_cast<Eigen::Index>(i)) = to_vector(rows[i]).transpose();
  }
  return result;
}

/// Returns what both kinds of cases begin with.
template <class Case>
Case to_case(const Json& j) {
  Case c;
  c.name = j.at("name");
  c.n = j.at("n");
  c.mass = to_matrix(j.at("mass"), c.n);
  c.damping = to_matrix(j.at("damping"), c.n);
  c.stiffness = to_matrix(j.at("stiffness"), c.n);
  return c;
}

inline SpectrumCase to_spectrum_case(const Json& j) {
  auto c = to_case<SpectrumCase>(j);
  c.r = j.at("r");
  const Json &values = j.at("eigenvalues"), &conditions = j.at("conditions");
  for (std::size_t k = 0; k < values.size(); ++k) {
    const Json &re = values[k].at(0), &im = values[k].at(1);
    c.eigenvalues.push_back({re.at(0), re.at(1), im.at(0), im.at(1)});
    if (!conditions.at(k).is_null()) c.eigenvalues.back().condition = conditions[k];
  }
  if (j.contains("stiffness_factor")) {
    c.stiffness_factor = to_matrix(j["stiffness_factor"], c.n);
  }
  return c;
}

inline ResponseCase to_response_case(const Json& j) {
  auto c = to_case<ResponseCase>(j);
  if (j.contains("jacobian")) {
    c.jacobian = to_matrix(j["jacobian"], c.n);
    c.task_stiffness = to_matrix(j.at("task_stiffness"), c.jacobian->rows());
    c.task_damping = to_matrix(j.at("task_damping"), c.jacobian->rows());
  }
  const auto trajectory = [&](const Json& given) {
    return Trajectory{given.at("times"), to_matrix(given.at("position"), c.n).transpose(),
                      to_matrix(given.at("velocity"), c.n).transpose()};
  };
  const Json& free = j.at("free");
  c.initial_position = to_vector(free.at("initial_position"));
  c.initial_velocity = to_vector(free.at("initial_velocity"));
  c.free = trajectory(free);
  const Json& impulse = j.at("impulse");
  c.impulse = to_vector(impulse.at("impulse"));
  c.impulse_response = trajectory(impulse);
  const Json& step = j.at("constant_force");
  c.constant_force = to_vector(step.at("force"));
  c.step_response = trajectory(step);
  const Json& harmonic = j.at("harmonic");
  c.harmonic_cosine = to_vector(harmonic.at("cosine"));
  c.harmonic_sine = to_vector(harmonic.at("sine"));
  c.harmonic_frequency = harmonic.at("frequency");
  c.harmonic_response = trajectory(harmonic);
  const Json& sampled = j.at("sampled");
  c.sample_step = sampled.at("step");
  c.samples = to_matrix(sampled.at("samples"), c.n).transpose();
  c.sampled_response = trajectory(sampled);
  for (const Json& entry : j.at("receptance")) {
    ReferenceReceptance g{entry.at("frequency"), Eigen::MatrixXcd(c.n, c.n)};
    g.value.real() = to_matrix(entry.at("real"), c.n);
    g.value.imag() = to_matrix(entry.at("imag"), c.n);
    c.receptance.push_back(std::move(g));
  }
  return c;
}

/// The systems of a file, each in a line of its own, by their names. A line is read only when its
/// system is wanted: each test is a process, and most of them want none.
class Systems {
 public:
  /// Throws std::runtime_error naming the file.
  explicit Systems(const std::string& file) : path_(DASHPOT_TEST_DATA_DIR "/" + file) {
    std::ifstream stream(path_);
    const std::string begin = "{\"name\":\"";
    for (std::string line; std::getline(stream, line);) {
      if (line.compare(0, begin.size(), begin) != 0) continue;
      if (line.back() == ',') line.pop_back();
      names_.push_back(line.substr(begin.size(), line.find('"', begin.size()) - begin.size()));
      lines_.push_back(std::move(line));
    }
    if (names_.empty()) {
      throw std::runtime_error(path_ + ": no systems in it");
    }
  }

  const std::vector<std::string>& names() const { return names_; }

  /// Throws std::runtime_error naming the file and the system.
  Json read(const std::string& name) const {
    const auto found = std::find(names_.begin(), names_.end(), name);
    if (found == names_.end()) throw std::runtime_error(path_ + ": no system '" + name + "'");
    return Json::parse(lines_[static_cast<std::size_t>(found - names_.begin())]);
  }

 private:
  std::string path_;
  std::vector<std::string> names_, lines_;
};

inline const Systems& spectra() {
  static const Systems systems("spectra.json");
  return systems;
}

inline const Systems& responses() {
  static const Systems systems("responses.json");
  return systems;
}

}  // namespace detail

/// The systems of spectra.json.
inline const std::vector<std::string>& spectrum_names() {
  return detail::spectra().names();
}
inline SpectrumCase spectrum_case(const std::string& name) {
  return detail::to_spectrum_case(detail::spectra().read(name));
}

/// The systems of responses.json.
inline const std::vector<std::string>& response_names() {
  return detail::responses().names();
}
inline ResponseCase response_case(const std::string& name) {
  return detail::to_response_case(detail::responses().read(name));
}

// ---------------------------------------------------------------------- comparing

/// |computed - reference|, right to long double however close they are: hi is subtracted first,
/// then lo.
inline long double distance(std::complex<double> computed, const ReferenceEigenvalue& reference) {
  const long double re =
      (widened(computed.real()) - widened(reference.re_hi)) - widened(reference.re_lo);
  const long double im =
      (widened(computed.imag()) - widened(reference.im_hi)) - widened(reference.im_lo);
  return std::hypot(re, im);
}

/// distance / max(|computed|, |reference|): 0 if both are zero, 1 if one of them is, at most 2; 4
/// if computed is not finite.
inline long double relative_distance(std::complex<double> computed,
                                     const ReferenceEigenvalue& reference) {
  if (!std::isfinite(computed.real()) || !std::isfinite(computed.imag())) return 4;
  const long double size = std::max(std::hypot(static_cast<long double>(computed.real()),
                                               static_cast<long double>(computed.imag())),
                                    std::abs(reference.value()));
  return size == 0 ? 0 : distance(computed, reference) / size;
}

/// The partner of one computed eigenvalue.
struct Match {
  std::size_t reference = 0;  ///< index into the reference list
  long double absolute = 0;   ///< rad/s
  long double relative = 0;   ///< as relative_distance
};

/// Pairs each computed eigenvalue with the nearest reference one that is left. Result k belongs to
/// computed[k]. Throws if the lists differ in length.
inline std::vector<Match> match_eigenvalues(const std::vector<std::complex<double>>& computed,
                                            const std::vector<ReferenceEigenvalue>& reference) {
  if (reference.size() != computed.size()) {
    throw std::invalid_argument("match_eigenvalues: " + std::to_string(computed.size()) +
                                " computed, " + std::to_string(reference.size()) +
                                " reference eigenvalues");
  }
  std::vector<std::size_t> left(reference.size());
  std::iota(left.begin(), left.end(), 0U);
  std::vector<Match> matches;
  for (const std::complex<double>& value : computed) {
    const auto nearest = std::min_element(left.begin(), left.end(), [&](auto a, auto b) {
      return distance(value, reference[a]) < distance(value, reference[b]);
    });
    const ReferenceEigenvalue& z = reference[*nearest];
    matches.push_back({*nearest, distance(value, z), relative_distance(value, z)});
    left.erase(nearest);
  }
  return matches;
}

}  // namespace dashpot::testing
