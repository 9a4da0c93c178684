#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/run/csv_sink.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/contact_t.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <array>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <utility>

namespace dashpot::apps {
namespace {

constexpr std::int64_t kFlushPeriod = 100'000;  // us
constexpr std::array kJointColumns = {"q", "qd", "torque"};

class CsvSink : public lcmtypes::Sink {
 public:
  CsvSink(const std::string& path, std::array<text::Units, 3> units)
      : file_("--csv", path), units_(std::move(units)) {}

  bool send(const std::string& channel, const std::vector<std::uint8_t>& bytes,
            std::int64_t utime) override {
    const int size = static_cast<int>(bytes.size());
    if (channel == lcmtypes::kContactChannel) {  // before the state of its tick
      return contact_.emplace().decode(bytes.data(), 0, size) >= 0;
    }
    if (channel != lcmtypes::kStateChannel) return true;
    state_t state;
    if (state.decode(bytes.data(), 0, size) < 0) return false;
    line_.clear();
    if (!any_) write_heading(state.n);
    if (!any_) begin_ = utime;
    any_ = true;
    write("%.6f", 1e-6 * static_cast<double>(utime - begin_));
    for (const auto* list : {&state.joint_position, &state.joint_velocity, &state.joint_torque}) {
      write(list->data(), list->size());
    }
    write(state.tip_position, 3);
    write(state.tip_error, 6);
    write(",%d", state.status);
    if (contact_) write(contact_->force, 3);
    line_ += '\n';
    return keeps([&] {
      file_.write(line_);
      if (utime - flushed_at_ < kFlushPeriod) return;
      flushed_at_ = utime;  // errors are noticed, and a killed run leaves its table
      file_.flush();
    });
  }

  bool finish() override {
    return keeps([this] { file_.finish(); });
  }

 private:
  void write_heading(int n) {
    line_ = "time [s]";
    for (std::size_t k = 0; k < units_.size(); ++k) {
      for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
        line_.append(",").append(kJointColumns[k]).append(std::to_string(i + 1));
        line_.append(" [").append(units_[k][i]).append("]");
      }
    }
    line_ +=
        ",x [m],y [m],z [m],error_x [m],error_y [m],error_z [m],error_rx [rad],error_ry [rad],"
        "error_rz [rad],status";
    if (contact_) line_ += ",contact_x [N],contact_y [N],contact_z [N]";
    line_ += '\n';
  }

  void write(const char* format, auto value) {
    std::array<char, 40> text{};
    std::snprintf(text.data(), text.size(), format, value);
    line_ += text.data();
  }
  void write(const double* values, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) write(",%.17g", values[i]);
  }

  /// Whether `call` could write.
  static bool keeps(const auto& call) {
    try {
      call();
      return true;
    } catch (const std::runtime_error&) {
      return false;
    }
  }

  OutputFile file_;
  std::array<text::Units, 3> units_;
  std::optional<contact_t> contact_;  // of the next state
  std::string line_;
  bool any_ = false;
  std::int64_t begin_ = 0;       // us
  std::int64_t flushed_at_ = 0;  // us
};

}  // namespace

std::unique_ptr<lcmtypes::Sink> make_csv_sink(const std::string& path,
                                              const controller::RobotModel& model) {
  return std::make_unique<CsvSink>(path, std::array{controller::joint_units(model, "rad", "m"),
                                                    controller::joint_units(model, "rad/s", "m/s"),
                                                    controller::joint_units(model, "N m", "N")});
}

}  // namespace dashpot::apps
