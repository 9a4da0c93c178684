#pragma once
#include <dashpot/apps/audit/audit_options.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/controller/contact_audit.hpp>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace dashpot::apps {

/// What `dashpot audit` found.
struct AuditReport {
  controller::PostureAudit posture;
  std::optional<controller::WorkspaceAudit> workspace;
  controller::DampingSuggestion suggestion;
  std::string no_suggestion;    ///< why there is none; empty if there is one
  std::string lost_directions;  ///< of the task, if the posture is singular
  bool interrupted = false;     ///< postures of the workspace are missing
};

std::string audit_json(const AuditTask& task, const AuditReport& report);
std::string audit_table(const AuditTask& task, const AuditReport& report);

/// The numbers of posture i as a line of a table in CSV; the heading has its units.
std::string csv_heading(const controller::RobotModel& model);
std::string csv_line(std::int64_t i, const controller::JointVector& q,
                     const controller::PostureNumbers& numbers);

/// A limit at one of many postures.
struct PostureContact {
  bool held = false;  ///< the arm can hold itself there
  /// The stiffness is NaN if the arm cannot hold itself, the tip cannot move in the direction, or
  /// the eigenvalue iteration fails.
  controller::ContactAt touch;
};

/// The results of `dashpot contact`.
struct ContactReport {
  controller::ContactOptions options;
  double asked = 0;  ///< stiffness that the arm is to touch, N/m; 0: none
  controller::ContactAudit posture;
  std::vector<analysis::ContactPoint> curve;
  double limit_with_rotors = 0;  ///< N/m, with published rotors in place of missing ones; or NaN
  std::vector<PostureContact> workspace;          ///< empty if it was not asked for
  std::vector<controller::JointVector> postures;  ///< of the workspace
  bool interrupted = false;
};

std::string contact_json(const AuditTask& task, const ContactReport& report);
/// Returns tables after one line with the verdict.
std::string contact_table(const AuditTask& task, const ContactReport& report);

/// Draws ratio and frequency over the stiffness to a file whose name ends with .svg or .png. Throws
/// std::runtime_error if gnuplot fails.
void draw_contact(const std::string& path, const AuditTask& task, const ContactReport& report);

/// Results at many postures in order, or at the first ones if the user stops it. Chunks are
/// handed out in order, so that the finished postures have no gap.
template <class Found>
class PostureWorkers {
 public:
  /// `find` returns the results at a number of postures from a first one on, in several threads.
  PostureWorkers(std::int64_t count,
                 std::function<std::vector<Found>(std::int64_t first, std::int64_t size)> find)
      : count_(count), find_(std::move(find)), found_(static_cast<std::size_t>(count)) {}

  std::vector<Found> run(int jobs) {
    const unsigned processors = std::max(1U, std::thread::hardware_concurrency());
    const unsigned threads = jobs > 0 ? static_cast<unsigned>(jobs) : processors;
    std::vector<std::exception_ptr> errors(threads);
    std::vector<std::thread> pool;
    for (unsigned i = 0; i < threads; ++i) {
      pool.emplace_back([this, &error = errors[i], first = i == 0] { work(first, error); });
    }
    for (std::thread& thread : pool) thread.join();
    show_progress(1);
    for (const std::exception_ptr& error : errors) {
      if (error) std::rethrow_exception(error);
    }
    found_.resize(static_cast<std::size_t>(std::min(next_.load(), count_)));
    return std::move(found_);
  }

 private:
  static constexpr std::int64_t kAtATime = 64;

  /// `shows`: whether this thread shows the progress.
  void work(bool shows, std::exception_ptr& error) {
    try {
      while (!stopped_ && !StopSignal::given()) {
        const std::int64_t first = next_.fetch_add(kAtATime);
        if (first >= count_) return;
        const std::int64_t size = std::min(kAtATime, count_ - first);
        const std::vector<Found> found = find_(first, size);
        std::copy(found.begin(), found.end(), found_.begin() + first);
        if (!shows) continue;
        show_progress(std::min(0.999, static_cast<double>(next_) / static_cast<double>(count_)));
      }
    } catch (...) {
      error = std::current_exception();
      stopped_ = true;
    }
  }

  StopSignal stop_;  // first, because room for many postures takes a while
  std::int64_t count_;
  std::function<std::vector<Found>(std::int64_t first, std::int64_t size)> find_;
  std::vector<Found> found_;
  std::atomic<std::int64_t> next_{0};
  std::atomic<bool> stopped_{false};
};

}  // namespace dashpot::apps
