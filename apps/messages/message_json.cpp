#include <dashpot/analysis/mode.hpp>
#include <dashpot/analysis/solver_status.hpp>
#include <dashpot/apps/messages/message_json.hpp>
#include <dashpot/controller/tick_status.hpp>

#include <string>

namespace dashpot::apps {
namespace {

using MessageJson = nlohmann::ordered_json;

template <std::size_t N>
MessageJson fixed_list(const double (&values)[N]) {
  return MessageJson(std::vector<double>(values, values + N));
}

std::string analysis_text(std::int8_t status) {
  return analysis::to_text(static_cast<analysis::Status>(status));
}

std::string controller_text(std::int8_t status) {
  return controller::to_text(static_cast<controller::Status>(status));
}

MessageJson kind_texts(const std::vector<std::int8_t>& kinds) {
  MessageJson list = MessageJson::array();
  for (const std::int8_t kind : kinds) {
    list.push_back(analysis::to_text(static_cast<analysis::ModeKind>(kind)));
  }
  return list;
}

MessageJson schema_of(const MessageJson& value) {
  if (value.is_object()) {
    MessageJson schema{{"type", "object"}, {"properties", MessageJson::object()}};
    for (const auto& [key, item] : value.items()) schema["properties"][key] = schema_of(item);
    return schema;
  }
  if (value.is_array()) {
    return {{"type", "array"},
            {"items", value.empty() ? MessageJson{{"type", MessageJson({"number", "null"})}}
                                    : schema_of(value.front())}};
  }
  if (value.is_string()) return {{"type", "string"}};
  if (value.is_number_integer()) return {{"type", "integer"}};
  // A plain "number": readers of MCAP take the first type of a list for all, and null for NaN.
  return {{"type", "number"}};
}

}  // namespace

MessageJson message_json(const state_t& m) {
  return {{"n", m.n},
          {"utime", m.utime},
          {"tick", m.tick},
          {"restarts", m.restarts},
          {"mode", m.mode},
          {"status", m.status},
          {"status_text", controller_text(m.status)},
          {"fault", m.fault},
          {"fault_text", controller_text(m.fault)},
          {"fault_tick", m.fault_tick},
          {"joint_position", m.joint_position},
          {"joint_velocity", m.joint_velocity},
          {"joint_torque", m.joint_torque},
          {"law_torque", m.law_torque},
          {"reference_joint_position", m.reference_joint_position},
          {"tip_position", fixed_list(m.tip_position)},
          {"tip_quaternion", fixed_list(m.tip_quaternion)},
          {"reference_tip_position", fixed_list(m.reference_tip_position)},
          {"reference_tip_quaternion", fixed_list(m.reference_tip_quaternion)},
          {"tip_error", fixed_list(m.tip_error)},
          {"tip_wrench", fixed_list(m.tip_wrench)},
          {"joint_damping_ratio", m.joint_damping_ratio},
          {"task_damping_ratio", m.task_damping_ratio},
          {"damping_level", m.damping_level},
          {"payload_mass", m.payload_mass},
          {"payload_center", fixed_list(m.payload_center)},
          {"tool_position", fixed_list(m.tool_position)},
          {"tool_quaternion", fixed_list(m.tool_quaternion)},
          {"tick_time", m.tick_time},
          {"longest_tick_time", m.longest_tick_time},
          {"overruns", m.overruns},
          {"states_dropped", m.states_dropped},
          {"commander", m.commander},
          {"commands_accepted", m.commands_accepted},
          {"commands_rejected", m.commands_rejected}};
}

MessageJson message_json(const modes_t& m) {
  return {{"n", m.n},
          {"num_modes", m.num_modes},
          {"utime", m.utime},
          {"tick", m.tick},
          {"sequence", m.sequence},
          {"origin", m.origin},
          {"status", m.status},
          {"status_text", analysis_text(m.status)},
          {"joint_position", m.joint_position},
          {"zero_modes", m.zero_modes},
          {"label", m.label},
          {"eigenvalue_real", m.eigenvalue_real},
          {"eigenvalue_imag", m.eigenvalue_imag},
          {"natural_frequency", m.natural_frequency},
          {"damping_ratio", m.damping_ratio},
          {"damped_frequency", m.damped_frequency},
          {"kind", m.kind},
          {"kind_text", kind_texts(m.kind)},
          {"eigenvalue_bound", m.eigenvalue_bound},
          {"natural_frequency_bound", m.natural_frequency_bound},
          {"damping_ratio_bound", m.damping_ratio_bound},
          {"shape_real", m.shape_real},
          {"shape_imag", m.shape_imag}};
}

MessageJson message_json(const sampled_modes_t& m) {
  return {{"n", m.n},
          {"num_modes", m.num_modes},
          {"utime", m.utime},
          {"tick", m.tick},
          {"sequence", m.sequence},
          {"status", m.status},
          {"status_text", analysis_text(m.status)},
          {"joint_position", m.joint_position},
          {"spectral_radius", m.spectral_radius},
          {"gain_margin", m.gain_margin},
          {"continuous_frequency", m.continuous_frequency},
          {"continuous_ratio", m.continuous_ratio},
          {"natural_frequency", m.natural_frequency},
          {"damping_ratio", m.damping_ratio},
          {"damped_frequency", m.damped_frequency},
          {"kind", m.kind},
          {"kind_text", kind_texts(m.kind)}};
}

MessageJson json_schema(const MessageJson& example, const std::string& title) {
  MessageJson schema = schema_of(example);
  schema["$schema"] = "http://json-schema.org/draft-07/schema#";
  schema["title"] = title;
  return schema;
}

}  // namespace dashpot::apps
