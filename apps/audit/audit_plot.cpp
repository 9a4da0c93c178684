#include <dashpot/apps/audit/audit_report.hpp>
#include <dashpot/apps/cli/gnuplot.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/text/printable.hpp>

#include <algorithm>
#include <cmath>
#include <sstream>

namespace dashpot::apps {
namespace {

using Numbers = std::vector<controller::PostureNumbers>;

/// The share of the postures, in %, in each of equal classes of the smallest ratio, as lines for
/// gnuplot: middle of the class, share.
std::string histogram(const Numbers& numbers, double most, int classes) {
  std::vector<std::int64_t> counts(static_cast<std::size_t>(classes));
  std::int64_t all = 0;
  for (const controller::PostureNumbers& one : numbers) {
    if (std::isnan(one.smallest_ratio)) continue;
    const double place = classes * std::max(0.0, one.smallest_ratio) / most;
    ++counts[static_cast<std::size_t>(std::min(place, classes - 0.5))];
    ++all;
  }
  std::ostringstream lines;
  for (int i = 0; i < classes; ++i) {
    const auto count = static_cast<double>(counts[static_cast<std::size_t>(i)]);
    lines << (i + 0.5) * most / classes << ' '
          << 100 * count / static_cast<double>(std::max<std::int64_t>(all, 1)) << '\n';
  }
  return lines.str();
}

/// At most some thousand postures with a finite margin: ratio, margin.
std::string margins(const Numbers& numbers) {
  constexpr std::size_t kMost = 4000;
  const std::size_t step = std::max<std::size_t>(1, numbers.size() / kMost);
  std::ostringstream lines;
  for (std::size_t i = 0; i < numbers.size(); i += step) {
    if (!std::isfinite(numbers[i].smallest_ratio + numbers[i].gain_margin)) continue;
    lines << numbers[i].smallest_ratio << ' ' << numbers[i].gain_margin << '\n';
  }
  return lines.str();
}

/// The diagonal of a matrix of gains; says so if other entries are not zero.
std::string gains_text(const std::string& name, const Eigen::MatrixXd& gains) {
  const Eigen::VectorXd diagonal = gains.diagonal();
  return name + " = diag(" + format_list(diagonal, 3) + ")" +
         (gains.isDiagonal(0) ? "" : " and more");
}

/// The arm and its gains as a title of two lines, in gnuplot's words.
std::string title(const AuditTask& task) {
  const controller::Gains& gains = task.options.gains;
  const bool joint = task.options.mode == controller::Mode::kJoint;
  const std::string stiffness =
      joint ? gains_text("K", gains.joint_stiffness) : gains_text("K_C", gains.task_stiffness);
  const std::string damping =
      joint ? gains_text("C", gains.joint_damping) : gains_text("C_C", gains.task_damping);
  return quoted_for_gnuplot(text::printable(task.model.name()) + ", " + stiffness) + ".\"\\n\"." +
         quoted_for_gnuplot(damping) + "\n";
}

std::string script(const std::string& path, const AuditTask& task, const Numbers& numbers) {
  constexpr int kClasses = 60;
  double most = std::isnan(task.intended_ratio) ? 0.1 : 1.1 * task.intended_ratio;
  for (const controller::PostureNumbers& one : numbers) {
    if (one.smallest_ratio <= 2) most = std::max(most, 1.05 * one.smallest_ratio);
  }
  const std::string points = margins(numbers);
  std::ostringstream out;
  out << plot_heading(path, 900, points.empty() ? 420 : 760) << "$ratios << EOD\n"
      << histogram(numbers, most, kClasses) << "EOD\nset xrange [0:" << most
      << "]\nset style fill solid 0.7\nset boxwidth " << most / kClasses
      << "\nset key top right\nset xlabel 'smallest damping ratio of a posture'\n"
      << "set ylabel '% of " << numbers.size() << " postures'\n";
  out << "set termoption noenhanced\n"
      << (points.empty() ? "set title " : "set multiplot layout 2,1 title ") << title(task);
  if (!std::isnan(task.intended_ratio)) {
    out << "set arrow 1 from " << task.intended_ratio << ", graph 0 to " << task.intended_ratio
        << ", graph 1 nohead lw 2 lc rgb '#d62728'\nset label 1 ' meant: "
        << format_number(task.intended_ratio, 3) << "' at " << task.intended_ratio
        << ", graph 0.9 right tc rgb '#d62728'\n";
  }
  out << "plot $ratios using 1:2 with boxes lc rgb '#1f77b4' notitle\n";
  if (!points.empty()) {
    out << "$margins << EOD\n"
        << points << "EOD\nset ylabel 'gain margin'\nset yrange [0:*]\nunset label 1\n"
        << "plot $margins using 1:2 with points pt 7 ps 0.3 lc rgb '#1f77b4' notitle, "
        << "1 with lines lw 2 lc rgb '#d62728' title '"
        << (controller::unknown_rotors(task.model).any() ? "too little below 1; rotors unknown"
                                                         : "unstable below 1")
        << "'\nunset multiplot\n";
  }
  return out.str();
}

}  // namespace

void draw_audit(const std::string& path, const AuditTask& task, const Numbers& numbers) {
  run_gnuplot(path, script(path, task, numbers));
}

}  // namespace dashpot::apps
