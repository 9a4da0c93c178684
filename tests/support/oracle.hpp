#pragma once
// Reference data of tests/data: second-order systems M q'' + C q' + K q = f with spectra known to
// 32 digits and responses to 16.
//
//   const SpectrumCase reference = spectrum_case(spectrum_names().front());
//   for (const Match& match : match_eigenvalues(computed_of(reference), reference.eigenvalues))
//     EXPECT_LT(match.relative, 1e-12L);
//
// The truth is that of the stored doubles; how it was found and proved is told in
// tests/data/exact.py. SI units throughout.

#include <dashpot/tests/support/places.hpp>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <fstream>
#include <limits>
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
  /// eigenvalues, and where it is not known (responses.json).
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
  int n = 0, r = 0;
  /// With a jacobian the truth is that of the exact products J' K_C J and J' C_C J, of which the
  /// stored stiffness and damping are the nearest doubles; without one it is that of the stored
  /// matrices.
  Eigen::MatrixXd mass, damping, stiffness;
  std::optional<Eigen::MatrixXd> jacobian, task_stiffness, task_damping;
  std::vector<ReferenceEigenvalue> eigenvalues;

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

inline const Json& member(const Json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end()) throw std::runtime_error(std::string("missing key '") + key + "'");
  return *found;
}

template <class T>
T get(const Json& object, const char* key) {
  try {
    return member(object, key).get<T>();
  } catch (const Json::exception& error) {
    throw std::runtime_error(std::string("key '") + key + "': " + error.what());
  }
}

inline Eigen::VectorXd get_vector(const Json& object, const char* key) {
  const auto values = get<std::vector<double>>(object, key);
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// Rows of equal length; columns_if_empty gives the shape of a matrix without rows.
inline Eigen::MatrixXd get_matrix(const Json& object, const char* key,
                                  Eigen::Index columns_if_empty = 0) {
  const auto rows = get<std::vector<std::vector<double>>>(object, key);
  const auto columns =
      rows.empty() ? columns_if_empty : static_cast<Eigen::Index>(rows.front().size());
  Eigen::MatrixXd result(static_cast<Eigen::Index>(rows.size()), columns);
  for (Eigen::Index i = 0; i < result.rows(); ++i) {
    const auto& row = rows[static_cast<std::size_t>(i)];
    if (static_cast<Eigen::Index>(row.size()) != columns)
      throw std::runtime_error(std::string("key '") + key + "': rows of unequal length");
    for (Eigen::Index j = 0; j < columns; ++j) result(i, j) = row[static_cast<std::size_t>(j)];
  }
  return result;
}

inline Eigen::MatrixXd get_square(const Json& object, const char* key, int n) {
  Eigen::MatrixXd result = get_matrix(object, key);
  if (result.rows() != n || result.cols() != n)
    throw std::runtime_error(std::string("key '") + key + "': not " + std::to_string(n) + " x " +
                             std::to_string(n));
  return result;
}

inline std::optional<Eigen::MatrixXd> get_optional_matrix(const Json& object, const char* key) {
  if (!object.contains(key)) return std::nullopt;
  return get_matrix(object, key);
}

inline std::vector<ReferenceEigenvalue> get_eigenvalues(const Json& object, int n) {
  const auto values = get<std::vector<std::vector<std::vector<double>>>>(object, "eigenvalues");
  if (values.size() != 2 * static_cast<std::size_t>(n))
    throw std::runtime_error("key 'eigenvalues': not 2n of them");
  std::vector<ReferenceEigenvalue> result;
  for (const auto& z : values) {
    if (z.size() != 2 || z[0].size() != 2 || z[1].size() != 2)
      throw std::runtime_error("key 'eigenvalues': not [[re_hi, re_lo], [im_hi, im_lo]]");
    ReferenceEigenvalue eigenvalue;
    eigenvalue.re_hi = z[0][0];
    eigenvalue.re_lo = z[0][1];
    eigenvalue.im_hi = z[1][0];
    eigenvalue.im_lo = z[1][1];
    result.push_back(eigenvalue);
  }
  if (object.contains("conditions")) {
    const Json& conditions = member(object, "conditions");
    if (conditions.size() != result.size())
      throw std::runtime_error("key 'conditions': not 2n of them");
    for (std::size_t k = 0; k < result.size(); ++k)
      if (!conditions[k].is_null()) result[k].condition = conditions[k].get<double>();
  }
  return result;
}

inline Trajectory get_trajectory(const Json& object, int n) {
  Trajectory result{get<std::vector<double>>(object, "times"),
                    get_matrix(object, "position").transpose(),
                    get_matrix(object, "velocity").transpose()};
  const auto count = static_cast<Eigen::Index>(result.times.size());
  for (const auto* part : {&result.position, &result.velocity})
    if (part->rows() != n || part->cols() != count)
      throw std::runtime_error("trajectory: not n values a time");
  return result;
}

/// Returns what both kinds of cases begin with.
template <class Case>
Case to_case(const Json& j) {
  Case c;
  c.name = get<std::string>(j, "name");
  c.n = get<int>(j, "n");
  c.r = get<int>(j, "r");
  c.mass = get_square(j, "mass", c.n);
  c.damping = get_square(j, "damping", c.n);
  c.stiffness = get_square(j, "stiffness", c.n);
  c.eigenvalues = get_eigenvalues(j, c.n);
  return c;
}

inline SpectrumCase to_spectrum_case(const Json& j) {
  auto c = to_case<SpectrumCase>(j);
  if (j.contains("stiffness_factor")) c.stiffness_factor = get_matrix(j, "stiffness_factor", c.n);
  return c;
}

inline ResponseCase to_response_case(const Json& j) {
  auto c = to_case<ResponseCase>(j);
  c.jacobian = get_optional_matrix(j, "jacobian");
  c.task_stiffness = get_optional_matrix(j, "task_stiffness");
  c.task_damping = get_optional_matrix(j, "task_damping");
  const Json& free = member(j, "free");
  c.initial_position = get_vector(free, "initial_position");
  c.initial_velocity = get_vector(free, "initial_velocity");
  c.free = get_trajectory(free, c.n);
  const Json& impulse = member(j, "impulse");
  c.impulse = get_vector(impulse, "impulse");
  c.impulse_response = get_trajectory(impulse, c.n);
  const Json& step = member(j, "constant_force");
  c.constant_force = get_vector(step, "force");
  c.step_response = get_trajectory(step, c.n);
  const Json& harmonic = member(j, "harmonic");
  c.harmonic_cosine = get_vector(harmonic, "cosine");
  c.harmonic_sine = get_vector(harmonic, "sine");
  c.harmonic_frequency = get<double>(harmonic, "frequency");
  c.harmonic_response = get_trajectory(harmonic, c.n);
  const Json& sampled = member(j, "sampled");
  c.sample_step = get<double>(sampled, "step");
  c.samples = get_matrix(sampled, "samples").transpose();
  c.sampled_response = get_trajectory(sampled, c.n);
  for (const Json& entry : member(j, "receptance")) {
    ReferenceReceptance g{get<double>(entry, "frequency"), Eigen::MatrixXcd(c.n, c.n)};
    g.value.real() = get_square(entry, "real", c.n);
    g.value.imag() = get_square(entry, "imag", c.n);
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
      throw std::runtime_error(path_ + ": no systems in it (tests/data/make_oracle.py writes it)");
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

/// Pairs each computed eigenvalue with a reference one so that the sum of the relative distances is
/// least (Hungarian method, so clusters and multiple eigenvalues are paired one to one). Result k
/// belongs to computed[k]. Throws if the lists differ in length.
inline std::vector<Match> match_eigenvalues(const std::vector<std::complex<double>>& computed,
                                            const std::vector<ReferenceEigenvalue>& reference) {
  const std::size_t n = computed.size();
  if (reference.size() != n)
    throw std::invalid_argument("match_eigenvalues: " + std::to_string(n) + " computed, " +
                                std::to_string(reference.size()) + " reference eigenvalues");
  // Rows and columns count from 1; column 0 holds the row being placed. row_of[j] is the row placed
  // in column j.
  std::vector<long double> row_price(n + 1, 0), column_price(n + 1, 0);
  std::vector<std::size_t> row_of(n + 1, 0), previous(n + 1, 0);
  for (std::size_t row = 1; row <= n; ++row) {
    std::vector<long double> slack(n + 1, std::numeric_limits<long double>::infinity());
    std::vector<bool> visited(n + 1, false);
    std::size_t column = 0;
    row_of[0] = row;
    do {
      visited[column] = true;
      const std::size_t current = row_of[column];
      long double step = std::numeric_limits<long double>::infinity();
      std::size_t next = 0;
      for (std::size_t j = 1; j <= n; ++j) {
        if (visited[j]) continue;
        const long double reduced = relative_distance(computed[current - 1], reference[j - 1]) -
                                    row_price[current] - column_price[j];
        if (reduced < slack[j]) {
          slack[j] = reduced;
          previous[j] = column;
        }
        if (slack[j] < step) {
          step = slack[j];
          next = j;
        }
      }
      for (std::size_t j = 0; j <= n; ++j) {
        if (visited[j]) {
          row_price[row_of[j]] += step;
          column_price[j] -= step;
        } else {
          slack[j] -= step;
        }
      }
      column = next;
    } while (row_of[column] != 0);
    while (column != 0) {
      row_of[column] = row_of[previous[column]];
      column = previous[column];
    }
  }
  std::vector<Match> matches(n);
  for (std::size_t j = 1; j <= n; ++j) {
    const std::size_t i = row_of[j] - 1;
    matches[i] = {j - 1, distance(computed[i], reference[j - 1]),
                  relative_distance(computed[i], reference[j - 1])};
  }
  return matches;
}

}  // namespace dashpot::testing
