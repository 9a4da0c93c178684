#include <dashpot/apps/report/mode_pairs.hpp>

#include <algorithm>
#include <limits>

namespace dashpot::apps {
namespace {

/// Returns the column of each row for which the sum of the costs is least: the Hungarian method,
/// which adds one row after the other along the cheapest path of exchanges.
std::vector<int> assign(const Eigen::MatrixXd& cost) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const auto n = static_cast<int>(cost.rows());
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  Eigen::VectorXd of_row = Eigen::VectorXd::Zero(n), of_column = Eigen::VectorXd::Zero(n + 1);
  std::vector<int> row_of(at(n + 1), -1);  // column n stands for the row that is added
  for (int added = 0; added < n; ++added) {
    std::vector<double> least(at(n), kInfinity);
    std::vector<int> from(at(n), n);
    std::vector<bool> reached(at(n + 1), false);
    int column = n;
    row_of[at(n)] = added;
    while (row_of[at(column)] >= 0) {
      reached[at(column)] = true;
      const int row = row_of[at(column)];
      int next = n;
      double step = kInfinity;
      for (int k = 0; k < n; ++k) {
        if (reached[at(k)]) continue;
        const double reduced = cost(row, k) - of_row[row] - of_column[k];
        if (reduced < least[at(k)]) least[at(k)] = reduced, from[at(k)] = column;
        if (least[at(k)] < step) step = least[at(k)], next = k;
      }
      for (int k = 0; k <= n; ++k) {
        if (reached[at(k)]) {
          of_row[row_of[at(k)]] += step;
          of_column[k] -= step;
        } else {
          least[at(k)] -= step;
        }
      }
      column = next;
    }
    while (column != n) {
      row_of[at(column)] = row_of[at(from[at(column)])];
      column = from[at(column)];
    }
  }
  std::vector<int> column_of(at(n));
  for (int k = 0; k < n; ++k) column_of[at(row_of[at(k)])] = k;
  return column_of;
}

}  // namespace

std::vector<int> nearest_pairs(const Eigen::MatrixXd& distances, double farthest) {
  const Eigen::Index rows = distances.rows(), columns = distances.cols();
  const Eigen::Index size = std::max(rows, columns);
  Eigen::MatrixXd cost = Eigen::MatrixXd::Constant(size, size, farthest * farthest);
  const auto near = [&](Eigen::Index i, Eigen::Index k) { return distances(i, k) < farthest; };
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index k = 0; k < columns; ++k) {
      if (near(i, k)) cost(i, k) = distances(i, k) * distances(i, k);
    }
  }
  std::vector<int> pairs = assign(cost);
  pairs.resize(static_cast<std::size_t>(rows));
  for (Eigen::Index i = 0; i < rows; ++i) {
    int& k = pairs[static_cast<std::size_t>(i)];
    if (k >= columns || !near(i, k)) k = -1;
  }
  return pairs;
}

}  // namespace dashpot::apps
