#include <dashpot/analysis/system.hpp>

#include <Eigen/Cholesky>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

/// The shortest decimal text that reads back as the same number.
std::string to_text(double value) {
  std::array<char, 32> text{};
  const auto result = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), result.ptr};
}

std::string size_text(Eigen::Index rows, Eigen::Index cols) {
  return std::to_string(rows) + " x " + std::to_string(cols);
}

std::string entry_text(Eigen::Index row, Eigen::Index col) {
  return "entry (" + std::to_string(row + 1) + "," + std::to_string(col + 1) + ")";
}

}  // namespace

void check_size(const std::string& key, const Eigen::MatrixXd& matrix, Eigen::Index rows,
                Eigen::Index cols) {
  if (matrix.rows() != rows || matrix.cols() != cols) {
    throw InvalidSystem(key, "is " + size_text(matrix.rows(), matrix.cols()) + ", expected " +
                                 size_text(rows, cols));
  }
}

void check_finite(const std::string& key, const Eigen::MatrixXd& matrix) {
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
      if (!std::isfinite(matrix(i, j))) {
        throw InvalidSystem(key, entry_text(i, j) + " is not a finite number");
      }
    }
  }
}

void check_symmetric(const std::string& key, const Eigen::MatrixXd& matrix) {
  if (matrix.size() == 0) return;
  Eigen::Index i = 0;
  Eigen::Index j = 0;
  const double worst = (matrix - matrix.transpose()).cwiseAbs().maxCoeff(&i, &j);
  if (worst <= kSymmetryTolerance * matrix.cwiseAbs().maxCoeff()) return;
  if (i > j) std::swap(i, j);
  throw InvalidSystem(key, "is not symmetric: " + entry_text(i, j) + " is " +
                               to_text(matrix(i, j)) + ", " + entry_text(j, i) + " is " +
                               to_text(matrix(j, i)));
}

void check_low_word(const std::string& key, const Eigen::MatrixXd& matrix,
                    const Eigen::MatrixXd& tail) {
  const double unit = std::numeric_limits<double>::epsilon();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
      if (std::abs(tail(i, j)) > unit * std::abs(matrix(i, j))) {
        throw InvalidSystem(key,
                            entry_text(i, j) + " is more than a rounding error of the coefficient");
      }
    }
  }
}

void check_error(const std::string& key, const Eigen::MatrixXd& error, Eigen::Index n) {
  if (error.rows() == 0) return;
  check_size(key, error, n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      if (!(error(i, j) >= 0))
        throw InvalidSystem(key, entry_text(i, j) + " is negative or not a number");
    }
  }
}

void make_symmetric(Eigen::MatrixXd& matrix, Eigen::MatrixXd& error) {
  if (matrix == matrix.transpose()) return;
  const Eigen::MatrixXd mean = 0.5 * matrix + 0.5 * matrix.transpose();
  if (error.rows() == 0) error.setZero(matrix.rows(), matrix.cols());
  error += (1 + 1e-10) * (mean - matrix).cwiseAbs();
  matrix = mean;
}

namespace {

void check_optional_parts(const System<>& system) {
  const Eigen::Index n = system.dof();
  if (system.stiffness_factor.rows() > 0) {
    check_size("stiffness_factor", system.stiffness_factor, system.stiffness_factor.rows(), n);
    check_finite("stiffness_factor", system.stiffness_factor);
  }
  if (system.has_low_words) {
    check_size("damping_low", system.damping_low, n, n);
    check_size("stiffness_low", system.stiffness_low, n, n);
    check_finite("damping_low", system.damping_low);
    check_finite("stiffness_low", system.stiffness_low);
    check_low_word("damping_low", system.damping, system.damping_low);
    check_low_word("stiffness_low", system.stiffness, system.stiffness_low);
  }
  check_error("mass_error", system.mass_error, n);
  check_error("damping_error", system.damping_error, n);
  check_error("stiffness_error", system.stiffness_error, n);
}

}  // namespace

void validate(const System<>& system) {
  const Eigen::Index n = system.mass.rows();
  check_size("mass", system.mass, n, n);
  check_size("damping", system.damping, n, n);
  check_size("stiffness", system.stiffness, n, n);
  check_finite("mass", system.mass);
  check_finite("damping", system.damping);
  check_finite("stiffness", system.stiffness);
  check_optional_parts(system);

  check_symmetric("mass", system.mass);
  if (n > 0 && system.mass.llt().info() != Eigen::Success) {
    throw InvalidSystem("mass", "is not positive definite");
  }
}

}  // namespace dashpot::analysis
