#include <dashpot/apps/cli/gnuplot.hpp>
#include <dashpot/apps/identify/identify_plot.hpp>

#include <algorithm>
#include <numbers>
#include <sstream>
#include <stdexcept>

namespace dashpot::apps {

void draw_identification(const std::string& path, const IdentifyReport& report) {
  if (report.postures.empty()) throw std::runtime_error("--plot: there is nothing to draw");
  const PostureReport& posture = report.postures.front();
  constexpr double kHertz = 1 / (2 * std::numbers::pi);
  // The measured modes fill the picture; predictions far from them are left out.
  double most = 0, largest_ratio = 1;
  for (const identification::MeasuredMode& mode : posture.found.modes) {
    most = std::max(most, 2 * kHertz * mode.natural_frequency);
  }
  for (const PredictedMode& mode : posture.predicted) {
    if (posture.found.modes.empty()) most = std::max(most, 1.2 * kHertz * mode.natural_frequency);
  }
  if (most == 0) most = 10;
  for (const identification::MeasuredMode& mode : posture.found.modes) {
    largest_ratio = std::max(largest_ratio, 1.1 * mode.damping_ratio);
  }
  for (const PredictedMode& mode : posture.predicted) {
    if (kHertz * mode.natural_frequency > most) continue;
    largest_ratio = std::max(largest_ratio, 1.1 * mode.damping_ratio);
  }
  std::ostringstream out;
  out << plot_heading(path, 900, 800) << "set multiplot layout 2,1\nset xrange [0:" << most
      << "]\nset style fill solid\n$all << EOD\n";
  for (const bool stable : {false, true}) {
    if (stable) out << "EOD\n$stable << EOD\n";
    for (const identification::ModelPole& pole : posture.found.poles) {
      if (pole.stable != stable || pole.damping_ratio >= 1) continue;
      out << kHertz * pole.natural_frequency << ' ' << pole.order << '\n';
    }
    out << "nan nan\n";  // gnuplot wants a line
  }
  out << "EOD\n$measured << EOD\n";
  for (const identification::MeasuredMode& mode : posture.found.modes) {
    out << kHertz * mode.natural_frequency << ' ' << mode.damping_ratio << ' '
        << 1.96 * kHertz * mode.natural_frequency_std << ' ' << 1.96 * mode.damping_ratio_std
        << '\n';
  }
  out << "nan nan nan nan\nEOD\n$predicted << EOD\n";
  for (const PredictedMode& mode : posture.predicted) {
    out << kHertz * mode.natural_frequency << ' ' << mode.damping_ratio << '\n';
  }
  out << "nan nan\nEOD\n";
  int number = 0;
  for (const identification::MeasuredMode& mode : posture.found.modes) {
    const double f = kHertz * mode.natural_frequency;
    out << "set arrow " << ++number << " from " << f << ", graph 0 to " << f
        << ", graph 1 nohead lc rgb '#bbbbbb'\n";
  }
  out << "set key outside top center horizontal\nset ylabel 'order of the model'\n"
      << "plot $all using 1:2 with points pt 6 ps 0.6 lc rgb '#999999' title 'pole', "
      << "$stable using 1:2 with points pt 7 ps 0.7 lc rgb '#1f77b4' title 'stable', "
      << "1/0 with lines lc rgb '#bbbbbb' title 'mode'\n"
      << "set xlabel 'natural frequency, Hz'\nset ylabel 'damping ratio'\nset yrange [0:"
      << largest_ratio << "]\n"
      << "plot $measured using 1:2:3:4 with xyerrorbars pt 7 ps 0.7 lw 1.5 lc rgb '#1f77b4' title "
         "'measured, 95 %'";
  if (report.against) {
    out << ", $predicted using 1:2 with points pt 4 ps 1.6 lw 1.5 lc rgb '#d62728' title "
           "'predicted'";
  }
  out << "\nunset multiplot\n";
  run_gnuplot(path, out.str());
}

}  // namespace dashpot::apps
