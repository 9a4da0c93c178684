#include <dashpot/apps/identify/identify.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/report/text_table.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace dashpot::apps {
namespace {

using Align = TextTable::Align;

std::string count(std::size_t n, const std::string& what) {
  return (n == 0 ? "no" : std::to_string(n)) + " " + what + (n == 1 ? "" : "s");
}

/// "q2 - 0.43 q5 + 0.21 q1 (95 deg)", with the channels' names.
std::string shape_text(const Eigen::VectorXcd& shape, const std::vector<MotionChannel>& channels) {
  std::vector<Eigen::Index> order(static_cast<std::size_t>(shape.size()));
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Eigen::Index>(i);
  std::sort(order.begin(), order.end(), [&shape](Eigen::Index a, Eigen::Index b) {
    return std::abs(shape[a]) > std::abs(shape[b]);
  });
  std::string text;
  for (const Eigen::Index i : order) {
    const analysis::Complex part = shape[i] / shape[order.front()];
    const double size = std::abs(part);
    if (size < 0.1 || text.size() > 50) break;
    double phase = std::arg(part) * 180 / std::numbers::pi;
    const bool minus = std::abs(phase) > 90;
    if (minus) phase -= std::copysign(180, phase);
    if (!text.empty()) {
      text += (minus ? " - " : " + ") + format_number(size, 2) + " ";
    }
    text += channels[static_cast<std::size_t>(i)].name;
    if (std::abs(phase) > 10) text += " (" + format_number(phase, 2) + " deg)";
  }
  return text;
}

/// The name of a part, by the kind of motion.
std::string kind_text(MotionKind kind) {
  return kind == MotionKind::kDriven    ? "driven record"
         : kind == MotionKind::kAmbient ? "ambient record"
                                        : "free decay";
}

const char* verdict_text(MotionKind kind) {
  switch (kind) {
    case MotionKind::kDecays:
      return "decay";
    case MotionKind::kAmbient:
      return "ambient";
    case MotionKind::kDriven:
      return "driven";
    case MotionKind::kLimitCycle:
      return "limit cycle";
    case MotionKind::kLargeMotion:
      return "large motion";
    case MotionKind::kNothing:
      break;
  }
  return "nothing";
}

std::string hertz(const MeasuredMode& mode) {
  return format_number(mode.natural_frequency / (2 * std::numbers::pi), 4);
}

std::string modes_table(const PostureReport& posture, const std::vector<MotionChannel>& channels) {
  TextTable table;
  table.add_column(Align::kRight, {"", "mode"});
  table.add_column(Align::kLeft, {"natural", "rad/s"});
  table.add_column(Align::kPoint, {"frequency", "Hz"});
  table.add_column(Align::kLeft, {"damping", "ratio"});
  table.add_column(Align::kPoint, {"stable", "%"});
  table.add_column(Align::kPoint, {"energy", "%"});
  table.add_column(Align::kLeft, {"", "shape"});
  int number = 0;
  for (const MeasuredMode& mode : posture.found.modes) {
    table.add_row({std::to_string(++number),
                   with_deviation(mode.natural_frequency, mode.natural_frequency_std), hertz(mode),
                   with_deviation(mode.damping_ratio, mode.damping_ratio_std),
                   format_number(100 * mode.stability, 3), format_number(100 * mode.energy, 2),
                   shape_text(mode.shape, channels)});
  }
  return table.text();
}

std::string rejected_table(const std::vector<MeasuredMode>& rejected) {
  TextTable table;
  table.add_column(Align::kPoint, {"natural", "rad/s"});
  table.add_column(Align::kPoint, {"damping", "ratio"});
  table.add_column(Align::kPoint, {"energy", "%"});
  table.add_column(Align::kLeft, {"", "not believed: why"});
  for (const MeasuredMode& mode : rejected) {
    table.add_row({format_number(mode.natural_frequency, 4), format_number(mode.damping_ratio, 3),
                   format_number(100 * mode.energy, 2), mode.reason});
  }
  return table.text();
}

/// Whether two numbers agree within 1.96 standard deviations.
bool agrees(double difference, double deviation) {
  return std::abs(difference) <= 1.96 * deviation;
}

std::string against_table(const PostureReport& posture) {
  TextTable table;
  table.add_column(Align::kPoint, {"predicted", "rad/s"});
  table.add_column(Align::kPoint, {"", "ratio"});
  table.add_column(Align::kRight, {"measured", "mode"});
  table.add_column(Align::kPoint, {"difference", "%"});
  table.add_column(Align::kPoint, {"of ratio", ""});
  table.add_column(Align::kPoint, {"shapes", "alike"});
  table.add_column(Align::kLeft, {"", "within 95 %"});
  for (const PredictedMode& mode : posture.predicted) {
    std::vector<std::string> row = {format_number(mode.natural_frequency, 5),
                                    format_number(mode.damping_ratio, 4)};
    if (mode.measured < 0) {
      row.insert(row.end(), {"-", "", "", "", "not measured"});
    } else {
      const MeasuredMode& found = posture.found.modes[static_cast<std::size_t>(mode.measured)];
      const double dw = found.natural_frequency - mode.natural_frequency;
      const double dz = found.damping_ratio - mode.damping_ratio;
      const bool w = agrees(dw, found.natural_frequency_std),
                 z = agrees(dz, found.damping_ratio_std);
      row.insert(row.end(), {std::to_string(mode.measured + 1),
                             format_number(100 * dw / mode.natural_frequency, 2),
                             format_number(dz, 2), format_number(mode.likeness, 2),
                             w && z ? "yes"
                             : w    ? "frequency only"
                             : z    ? "ratio only"
                                    : "no"});
    }
    table.add_row(std::move(row));
  }
  return table.text();
}

std::string calibration_table(const Calibration& calibration) {
  TextTable table;
  table.add_column(Align::kLeft, {"parameter"});
  table.add_column(Align::kPoint, {"before"});
  table.add_column(Align::kLeft, {"calibrated"});
  table.add_column(Align::kLeft, {"unit"});
  table.add_column(Align::kLeft, {""});
  for (const CalibratedParameter& one : calibration.parameters) {
    table.add_row({one.name, format_number(one.before, 4), with_deviation(one.value, one.std),
                   one.unit, one.determined ? "" : "not determined"});
  }
  std::string text = table.text() + "  Differences, root mean square in deviations: " +
                     format_number(calibration.misfit_before, 3) + " before, " +
                     format_number(calibration.misfit, 3) + " after, of " +
                     count(static_cast<std::size_t>(calibration.numbers), "number") + ".\n";
  for (const std::string& warning : calibration.warnings) text += "  Warning: " + warning + "\n";
  return text;
}

Json calibration_json(const Calibration& calibration) {
  Json json;
  json["parameters"] = Json::array();
  for (const CalibratedParameter& one : calibration.parameters) {
    json["parameters"].push_back({{"name", one.name},
                                  {"unit", one.unit},
                                  {"before", one.before},
                                  {"value", one.value},
                                  {"std", one.std},
                                  {"determined", one.determined}});
  }
  json["misfit_before"] = calibration.misfit_before;
  json["misfit"] = calibration.misfit;
  json["consistent"] = calibration.consistent;
  json["numbers"] = calibration.numbers;
  json["warnings"] = calibration.warnings;
  return json;
}

Json mode_json(const MeasuredMode& mode) {
  Json json;
  const auto real = [](double value) { return std::isfinite(value) ? Json(value) : Json(); };
  json["natural_frequency"] = mode.natural_frequency;
  json["natural_frequency_std"] = real(mode.natural_frequency_std);
  json["damping_ratio"] = mode.damping_ratio;
  json["damping_ratio_std"] = real(mode.damping_ratio_std);
  json["eigenvalues"] = Json::array();
  for (const analysis::Complex& lambda : mode.eigenvalues) {
    json["eigenvalues"].push_back({lambda.real(), lambda.imag()});
  }
  json["shape"] = Json::array();
  for (const analysis::Complex& entry : mode.shape) {
    json["shape"].push_back({entry.real(), entry.imag()});
  }
  json["stability"] = mode.stability;
  json["energy"] = mode.energy;
  if (!mode.reason.empty()) json["reason"] = mode.reason;
  return json;
}

Json posture_json(const PostureReport& posture, bool against) {
  Json json;
  json["modes"] = Json::array();
  for (const MeasuredMode& mode : posture.found.modes) json["modes"].push_back(mode_json(mode));
  json["rejected"] = Json::array();
  for (const MeasuredMode& mode : posture.found.rejected) {
    json["rejected"].push_back(mode_json(mode));
  }
  if (against) {
    json["predicted"] = json["difference"] = Json::array();
    for (const PredictedMode& mode : posture.predicted) {
      Json shape = Json::array();
      for (const analysis::Complex& entry : mode.shape) {
        shape.push_back({entry.real(), entry.imag()});
      }
      json["predicted"].push_back({{"natural_frequency", mode.natural_frequency},
                                   {"damping_ratio", mode.damping_ratio},
                                   {"shape", shape}});
      if (mode.measured < 0) continue;
      const MeasuredMode& found = posture.found.modes[static_cast<std::size_t>(mode.measured)];
      const double dw = found.natural_frequency - mode.natural_frequency;
      const double dz = found.damping_ratio - mode.damping_ratio;
      json["difference"].push_back({{"predicted", json["predicted"].size() - 1},
                                    {"measured", mode.measured},
                                    {"natural_frequency", dw},
                                    {"damping_ratio", dz},
                                    {"likeness", mode.likeness},
                                    {"within", agrees(dw, found.natural_frequency_std) &&
                                                   agrees(dz, found.damping_ratio_std)}});
    }
  }
  json["rest"] = json_list(posture.rest);
  json["parts"] = posture.parts;
  json["order"] = posture.found.order;
  json["noise"] = json_list(posture.found.noise);
  json["whiteness"] = posture.found.whiteness;
  json["explained"] = posture.found.explained;
  if (posture.found.friction > 0) {
    json["friction"] = posture.found.friction;
    json["friction_std"] = posture.found.friction_std;
  }
  return json;
}

}  // namespace

std::string identify_table(const IdentifyReport& report) {
  std::string text;
  for (const std::string& note : report.notes) text += "Note: " + note + "\n";
  text += std::string("Verdict: ") + verdict_text(report.kind) +
          (report.advice.empty() ? "" : ": " + report.advice) + "\n";
  std::size_t useful = 0;
  for (const PartReport& part : report.parts) useful += part.posture >= 0;
  text += count(useful, kind_text(report.kind)) + " of " +
          count(report.channels.size(), "channel") + " at " +
          count(report.postures.size(), "posture") + "\n";
  for (const PartReport& part : report.parts) {
    text +=
        "  " + part.file + ": " + format_number(part.from, 6) + " to " + format_number(part.to, 6) +
        " s" +
        (part.posture >= 0
             ? (report.postures.size() > 1 ? ", posture " + std::to_string(part.posture + 1) : "")
             : ", left out: " + part.reason) +
        "\n";
  }
  for (std::size_t k = 0; k < report.postures.size(); ++k) {
    const PostureReport& posture = report.postures[k];
    text += "\n" + (report.postures.size() > 1 ? "Posture " + std::to_string(k + 1) + ": " : "") +
            count(posture.found.modes.size(), "mode") + " from " +
            count(static_cast<std::size_t>(posture.parts),
                  report.kind == MotionKind::kDecays ? "decay" : "record") +
            "; the model explains " + format_number(100 * posture.found.explained, 6) +
            " % of the " + (report.kind == MotionKind::kAmbient ? "correlations" : "motion") +
            "\n" + modes_table(posture, report.channels);
    if (posture.found.friction > 0) {
      Eigen::Index moving = 0;  // the others are constant
      posture.found.noise.maxCoeff(&moving);
      text += "  with Coulomb friction worth " +
              with_deviation(posture.found.friction, posture.found.friction_std) + " " +
              report.channels[static_cast<std::size_t>(moving)].unit + " of deflection\n";
    }
    if (!posture.found.rejected.empty()) text += "\n" + rejected_table(posture.found.rejected);
    if (report.against) text += "\n" + against_table(posture);
  }
  if (report.calibration) text += "\n" + calibration_table(*report.calibration);
  return text;
}

nlohmann::ordered_json identify_json(const IdentifyReport& report) {
  Json json = report.postures.empty() ? Json{{"modes", Json::array()}, {"rejected", Json::array()}}
                                      : posture_json(report.postures.front(), report.against);
  json["verdict"] = verdict_text(report.kind);
  json["advice"] = report.advice;
  json["channels"] = Json::array();
  for (const MotionChannel& channel : report.channels) {
    json["channels"].push_back({{"name", channel.name}, {"unit", channel.unit}});
  }
  json["records"] = Json::array();
  for (const PartReport& part : report.parts) {
    Json entry{{"file", part.file}, {"from", part.from}, {"to", part.to}};
    if (part.posture >= 0) {
      entry["posture"] = part.posture;
    } else {
      entry["reason"] = part.reason;
    }
    json["records"].push_back(std::move(entry));
  }
  json["postures"] = Json::array();
  for (const PostureReport& posture : report.postures) {
    json["postures"].push_back(posture_json(posture, report.against));
  }
  json["poles"] = Json::array();  // of the first posture, for stabilisation pictures
  if (!report.postures.empty()) {
    for (const identification::ModelPole& pole : report.postures.front().found.poles) {
      json["poles"].push_back({{"order", pole.order},
                               {"natural_frequency", pole.natural_frequency},
                               {"damping_ratio", pole.damping_ratio},
                               {"stable", pole.stable}});
    }
  }
  if (report.calibration) {
    json["calibration"] = calibration_json(*report.calibration);
    for (const char* key : {"parameters", "misfit", "consistent"}) {
      json[key] = json["calibration"][key];
    }
  }
  json["notes"] = report.notes;
  return json;
}

}  // namespace dashpot::apps
