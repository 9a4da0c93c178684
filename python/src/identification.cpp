// Modes from recorded motion.

#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/motion_verdict.hpp>
#include <dashpot/python/src/convert.hpp>

namespace dashpot::python {

using identification::FreeDecay;
using identification::Identification;
using identification::MeasuredMode;
using identification::MotionKind;
using identification::MotionRecord;

namespace {

nb::dict measured_modes_of(const std::vector<MeasuredMode>& modes) {
  const auto column = [&](auto member) {
    return to_column(modes, [=](const MeasuredMode& mode) { return mode.*member; });
  };
  nb::dict result;
  result["natural_frequency"] = column(&MeasuredMode::natural_frequency);
  result["natural_frequency_std"] = column(&MeasuredMode::natural_frequency_std);
  result["damping_ratio"] = column(&MeasuredMode::damping_ratio);
  result["damping_ratio_std"] = column(&MeasuredMode::damping_ratio_std);
  result["eigenvalues"] =
      to_pairs(modes, [](const MeasuredMode& mode) { return mode.eigenvalues; });
  result["shapes"] = to_list(modes, [](const MeasuredMode& mode) { return to_array(mode.shape); });
  result["stability"] = column(&MeasuredMode::stability);
  result["energy"] = column(&MeasuredMode::energy);
  result["reason"] = to_list(modes, [](const MeasuredMode& mode) { return mode.reason; });
  return result;
}

/// The kind of a record, by its motion alone.
MotionKind kind_of(const MotionRecord& record) {
  const identification::MotionVerdict verdict = judge_motion(record);
  if (verdict.kind == MotionKind::kNothing) {
    throw std::invalid_argument("identify: nothing moves beyond the noise");
  }
  if (verdict.kind == MotionKind::kLimitCycle) {
    throw std::invalid_argument(
        "identify: a limit cycle: it repeats itself at " + std::to_string(verdict.frequency) +
        " rad/s with one amplitude; calm the loop, then push (find=False takes it as a decay)");
  }
  return verdict.kind;
}

/// `outputs`: channels x samples each. `inputs`: likewise, or no rows.
nb::dict identify(const std::vector<Eigen::VectorXd>& times,
                  const std::vector<Eigen::MatrixXd>& outputs,
                  const std::vector<Eigen::MatrixXd>& inputs, bool find, bool ambient,
                  int max_order) {
  std::vector<MotionRecord> records;
  std::vector<std::array<double, 3>> parts;  // number of the record, beginning and end
  const bool excited = !inputs.empty() && inputs.front().rows() > 0;
  MotionKind kind = ambient   ? MotionKind::kAmbient
                    : excited ? MotionKind::kDriven
                              : MotionKind::kDecays;
  const bool judged = find && kind == MotionKind::kDecays;
  Identification found;
  {
    const nb::gil_scoped_release release;
    for (std::size_t r = 0; r < times.size(); ++r) {
      const MotionRecord record{times[r], outputs[r], inputs[r]};
      identification::check_records({record});
      if (judged) {
        const MotionKind its = kind_of(record);
        if (r > 0 && its != kind) continue;  // `parts` shows it
        kind = its;
      }
      std::vector<FreeDecay> pieces{{0, record.time.size(), {}}};
      if (judged && kind == MotionKind::kDecays) pieces = find_decays(record);
      for (const FreeDecay& piece : pieces) {
        if (!piece.reason.empty()) continue;
        records.push_back(part_of(record, piece.from, piece.to));
        parts.push_back(
            {static_cast<double>(r), record.time[piece.from], record.time[piece.to - 1]});
      }
    }
    if (records.empty()) throw std::invalid_argument("identify: no free decay was found");
    const identification::IdentifyOptions options{.max_order = max_order};
    found = kind == MotionKind::kAmbient  ? identify_ambient(records, options)
            : kind == MotionKind::kDriven ? identify_excited(records, options)
                                          : identify_decays(records, options);
  }
  nb::dict result;
  result["modes"] = measured_modes_of(found.modes);
  result["rejected"] = measured_modes_of(found.rejected);
  result["parts"] = to_list(parts, [](const std::array<double, 3>& part) {
    return nb::make_tuple(static_cast<int>(part[0]), part[1], part[2]);
  });
  result["verdict"] = kind == MotionKind::kAmbient  ? "ambient"
                      : kind == MotionKind::kDriven ? "driven"
                                                    : "decay";
  result["noise"] = to_array(found.noise);
  result["whiteness"] = found.whiteness;
  result["explained"] = found.explained;
  result["order"] = found.order;
  result["friction"] = found.friction;
  result["friction_std"] = found.friction_std;
  return result;
}

}  // namespace

void add_identification(nb::module_& m) {
  m.def("identify", &identify, nb::arg("times"), nb::arg("outputs"), nb::arg("inputs"),
        nb::arg("find"), nb::arg("ambient"), nb::arg("max_order"));
}

}  // namespace dashpot::python
