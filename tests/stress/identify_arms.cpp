#include <dashpot/tests/stress/identify_arms.hpp>
#include <dashpot/tests/stress/recorded_arm.hpp>
#include <dashpot/tests/support/places.hpp>

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

namespace dashpot::stress {
namespace {

using Eigen::Index;
using Complex = std::complex<double>;
using Json = nlohmann::json;

/// A mode is right within this distance of one of the arm's, relative to its frequency.
constexpr double kNear = 0.1;
constexpr double kMostFalse = 0.05, kLeastFound = 0.7, kLeastInside = 0.88;
/// Recordings of kinds that do not say how many, as of a clean release.
constexpr double kClean = 36;

/// A row of the table.
struct Row {
  const char* what;
  double recordings;
  Recipe recipe;
  bool finds = false;  ///< as many have to be found as kLeastFound of the strong, determined ones
};

const std::vector<Row>& rows() {
  static const std::vector<Row> all = {
      {"clean release", kClean, {}, true},
      {"elastic gears", 14, {.gears = true}, true},
      {"ambient, 60 s", 8, {.motion = Motion::kAmbient, .size = 0.04}},
      {"ambient, friction of 0.1 N m",
       8,
       {.motion = Motion::kAmbient, .size = 0.04, .least_friction = 0.1, .most_friction = 0.1}},
      {"friction of 0.05 N m", kClean, {.least_friction = 0.05, .most_friction = 0.05}},
      {"the same, three pushes",
       kClean,
       {.motion = Motion::kPushes, .least_friction = 0.05, .most_friction = 0.05}},
      {"the same, ratios 0.01 to 0.1",
       kClean,
       {.least_ratio = 0.01, .most_ratio = 0.1, .least_friction = 0.05, .most_friction = 0.05}},
      {"ratios 0.2 to 3, three pushes, friction to 0.5 N m",
       72,
       {.motion = Motion::kPushes, .least_ratio = 0.2, .most_ratio = 3, .most_friction = 0.5}},
      {"chirp of 0.1 rad", 12, {.motion = Motion::kChirp, .size = 0.1}},
      {"chirp of 0.02 rad", 12, {.motion = Motion::kChirp}},
      {"chirp of 0.1 rad, friction of 0.1 N m",
       12,
       {.motion = Motion::kChirp, .size = 0.1, .least_friction = 0.1, .most_friction = 0.1}},
      {"16-bit encoder, 250 Hz", 18, {.rate = 250, .noise = 0, .bits = 16}},
      {"12-bit encoder", 18, {.noise = 0, .bits = 12}},
      {"torque clipped", 18, {.clip = 0.5}},
      {"release of 0.15 rad", 18, {.size = 0.15}},
      {"one-sided contact", 14, {.wall = true}},
      {"jitter of 0.3 ms", 18, {.jitter = 3e-4}, true},
      {"drift", 18, {.drift = 1e-3}, true},
      {"delay of 2 ticks", 18, {.delay = 2}},
      {"hum of a thousandth", 18, {.hum = 2e-5}, true},
      {"hum of a hundredth", 18, {.hum = 2e-4}, true},
  };
  return all;
}

struct Found {
  Complex first, second;  ///< eigenvalues
  double frequency = 0, frequency_std = 0, ratio = 0, ratio_std = 0;
};

/// Processor time of the program, s.
double processor_time() {
  rusage usage{};
  getrusage(RUSAGE_CHILDREN, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

std::string written(const Recording& recording) {
  std::string text = "time [s]";
  std::array<char, 40> cell{};
  for (Index c = 0; c < recording.output.rows(); ++c) {
    text += ",q" + std::to_string(c + 1) + " [rad]";
  }
  const bool driven = recording.input.size() > 0;
  text += driven ? ",u\n" : "\n";
  for (Index i = 0; i < recording.time.size(); ++i) {
    std::snprintf(cell.data(), cell.size(), "%.9g", recording.time[i]);
    text += cell.data();
    for (const double q : recording.output.col(i)) {
      std::snprintf(cell.data(), cell.size(), ",%.9g", q);
      text += cell.data();
    }
    if (driven) {
      std::snprintf(cell.data(), cell.size(), ",%.9g", recording.input[i]);
      text += cell.data();
    }
    text += '\n';
  }
  return text;
}

/// The program's JSON output.
Json report_on(const Recording& recording, const std::string& file) {
  std::FILE* out = std::fopen(file.c_str(), "w");
  if (out == nullptr) throw std::runtime_error("cannot write " + file);
  const std::string rows = written(recording);
  std::fwrite(rows.data(), 1, rows.size(), out);
  std::fclose(out);
  const std::string command = std::string(DASHPOT_PROGRAM) + " identify --json " + file +
                              (recording.input.size() > 0 ? " --inputs u" : "") + " 2>/dev/null";
  std::FILE* pipe = popen(command.c_str(), "r");  // NOLINT(cert-env33-c)
  if (pipe == nullptr) throw std::runtime_error("cannot start " + command);
  std::string text;
  std::array<char, 65536> part{};
  for (std::size_t n = 0; (n = std::fread(part.data(), 1, part.size(), pipe)) > 0;) {
    text.append(part.data(), n);
  }
  const int status = pclose(pipe);
  constexpr int kNoModes = 1;
  if (!WIFEXITED(status) || WEXITSTATUS(status) > kNoModes)
    throw std::runtime_error("failed: " + command);
  return Json::parse(text);
}

std::vector<Found> believed(const Json& report) {
  std::vector<Found> all;
  for (const Json& posture : report["postures"]) {
    for (const Json& mode : posture["modes"]) {
      const auto number = [&mode](const char* key) {
        return mode[key].is_null() ? std::numeric_limits<double>::infinity()
                                   : mode[key].get<double>();
      };
      Found found;
      found.frequency = number("natural_frequency");
      found.frequency_std = number("natural_frequency_std");
      found.ratio = number("damping_ratio");
      found.ratio_std = number("damping_ratio_std");
      const Complex root = std::sqrt(Complex(found.ratio * found.ratio - 1));
      found.first = found.frequency * (-found.ratio + root);
      found.second = found.frequency * (-found.ratio - root);
      all.push_back(found);
    }
  }
  return all;
}

struct Tally {
  int recordings = 0, believed = 0, wrong = 0, strong = 0, determined = 0, found = 0;
  int frequency_inside = 0, ratio_inside = 0;
  double time = 0, longest = 0;
};

double distance(const TrueMode& mode, Complex value) {
  return std::abs(value - mode.value) / std::abs(mode.value);
}

/// Which of the arm's modes is nearest to an eigenvalue.
std::size_t nearest(const std::vector<TrueMode>& modes, Complex value) {
  const auto at =
      std::min_element(modes.begin(), modes.end(), [value](const TrueMode& a, const TrueMode& b) {
        return distance(a, value) < distance(b, value);
      });
  return static_cast<std::size_t>(at - modes.begin());
}

void compare(const std::vector<TrueMode>& modes, const std::vector<Found>& all, Tally& tally) {
  std::vector<bool> seen(modes.size());
  for (const Found& found : all) {
    ++tally.believed;
    const std::size_t at = nearest(modes, found.first);
    const bool pair = std::abs(found.first.imag()) > 0;
    const bool right =
        distance(modes[at], found.first) < kNear &&
        (pair || distance(modes[nearest(modes, found.second)], found.second) < kNear);
    if (!right) {
      ++tally.wrong;
      continue;
    }
    seen[at] = true;
    if (!pair) continue;
    const double frequency = std::abs(modes[at].value);
    tally.frequency_inside += std::abs(found.frequency - frequency) <= 1.96 * found.frequency_std;
    tally.ratio_inside +=
        std::abs(found.ratio + modes[at].value.real() / frequency) <= 1.96 * found.ratio_std;
  }
  for (std::size_t i = 0; i < modes.size(); ++i) {
    tally.strong += modes[i].strong;
    tally.determined += modes[i].strong && modes[i].determined;
    tally.found += modes[i].strong && seen[i];
  }
}

void print(const Row& row, long k, const RecordedArm& arm, const std::vector<Found>& all,
           const std::string& verdict) {
  std::printf("%s %ld: %s\n", row.what, k, verdict.c_str());
  for (const TrueMode& mode : arm.modes()) {
    std::printf("  true  %9.4f          %8.5f %s\n", std::abs(mode.value),
                -mode.value.real() / std::abs(mode.value), mode.strong ? "strong" : "");
  }
  for (const Found& found : all) {
    std::printf("  found %9.4f+-%7.4f %8.5f+-%7.5f\n", found.frequency, found.frequency_std,
                found.ratio, found.ratio_std);
  }
}

Tally tally_of(const Row& row, std::size_t number, const Request& request,
               const std::string& file) {
  Tally tally;
  tally.recordings =
      std::max(1, static_cast<int>(std::lround(request.count * row.recordings / kClean)));
  for (int k = 0; k < tally.recordings; ++k) {
    testing::Dice draw(1'000'003 * request.seed + 1000 * number + static_cast<std::uint64_t>(k));
    RecordedArm arm(row.recipe, static_cast<std::size_t>(k), draw);
    const Recording recording = arm.record(draw);
    const double before = processor_time();
    const Json report = report_on(recording, file);
    const double time = processor_time() - before;
    tally.time += time;
    tally.longest = std::max(tally.longest, time);
    const std::vector<Found> all = believed(report);
    if (request.verbose) print(row, k, arm, all, report["verdict"]);
    compare(arm.modes(), all, tally);
  }
  return tally;
}

/// The requirements that a row misses; empty if none.
std::string missed(const Row& row, const Tally& tally) {
  std::string text;
  const int right = tally.believed - tally.wrong;
  if (tally.wrong > kMostFalse * tally.believed) text += " false";
  if (row.finds && tally.found < kLeastFound * tally.determined) text += " found";
  if (std::min(tally.frequency_inside, tally.ratio_inside) < kLeastInside * right)
    text += " inside";
  return text;
}

/// A folder of this process alone, removed with it.
class Folder {
 public:
  Folder() : path_((std::filesystem::temp_directory_path() / "dashpot.XXXXXX").string()) {
    if (mkdtemp(path_.data()) == nullptr) throw std::runtime_error("no scratch directory");
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() { std::filesystem::remove_all(path_); }
  std::string operator/(const char* name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

}  // namespace

bool identify_arms(const Request& request) {
  if (!testing::MujocoArm::available()) {
    std::printf("skipped: this build has no MuJoCo\n");
    return true;
  }
  std::printf(
      "seed %lu\n"
      "| record | recordings | believed | false | strong modes found, and determined | inside 95 "
      "%%: frequency, "
      "ratio | time: mean, longest | misses |\n"
      "|---|---|---|---|---|---|---|---|\n",
      request.seed);
  const Folder folder;
  bool good = true;
  for (std::size_t i = 0; i < rows().size(); ++i) {
    const Row& row = rows()[i];
    const Tally tally = tally_of(row, i, request, folder / "record.csv");
    const std::string lacks = missed(row, tally);
    good = good && (i > 0 || 2 * tally.found >= tally.strong);
    const double count = tally.recordings;
    std::printf("| %s | %d | %d | %d | %d of %d, %d | %d, %d of %d | %.2f s, %.1f s |%s |\n",
                row.what, tally.recordings, tally.believed, tally.wrong, tally.found, tally.strong,
                tally.determined, tally.frequency_inside, tally.ratio_inside,
                tally.believed - tally.wrong, tally.time / count, tally.longest, lacks.c_str());
    std::fflush(stdout);
  }
  return good;
}

}  // namespace dashpot::stress
