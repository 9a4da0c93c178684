#include <dashpot/apps/cli/output_file.hpp>
#include <dashpot/apps/run/csv_sink.hpp>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <cstdio>

namespace dashpot::apps {
namespace {

constexpr std::int64_t kFlushPeriod = 100'000;  // us

class CsvSink : public lcmtypes::Sink {
 public:
  explicit CsvSink(const std::string& path) : file_(open_output("--csv", path)) {}

  bool send(const std::string& channel, const std::vector<std::uint8_t>& bytes,
            std::int64_t utime) override {
    if (channel != lcmtypes::kStateChannel) return true;
    state_t state;
    if (state.decode(bytes.data(), 0, static_cast<int>(bytes.size())) < 0) return false;
    if (!any_) write_heading(state.n);
    if (!any_) begin_ = utime;
    any_ = true;
    std::fprintf(file_.get(), "%.6f", 1e-6 * static_cast<double>(utime - begin_));
    for (const auto* list : {&state.joint_position, &state.joint_velocity, &state.joint_torque}) {
      write(list->data(), list->size());
    }
    write(state.tip_position, 3);
    write(state.tip_error, 6);
    std::fprintf(file_.get(), ",%d\n", state.status);
    if (utime - flushed_at_ >=
        kFlushPeriod) {     // so that errors are noticed, and a killed run leaves
      flushed_at_ = utime;  // its table
      std::fflush(file_.get());
    }
    return std::ferror(file_.get()) == 0;
  }

 private:
  void write_heading(int n) {
    std::fputs("time", file_.get());
    for (const char* name : {"q", "qd", "torque"}) {
      for (int i = 1; i <= n; ++i) std::fprintf(file_.get(), ",%s%d", name, i);
    }
    std::fputs(",x,y,z,error_x,error_y,error_z,error_rx,error_ry,error_rz,status\n", file_.get());
  }

  void write(const double* values, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) std::fprintf(file_.get(), ",%.17g", values[i]);
  }

  OutputFile file_;
  bool any_ = false;
  std::int64_t begin_ = 0;       // us
  std::int64_t flushed_at_ = 0;  // us
};

}  // namespace

std::unique_ptr<lcmtypes::Sink> make_csv_sink(const std::string& path) {
  return std::make_unique<CsvSink>(path);
}

}  // namespace dashpot::apps
