#include <dashpot/apps/cli/posture_files.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/text/yaml_document.hpp>

#include <array>
#include <fstream>
#include <string_view>

namespace dashpot::apps {

using controller::InputError;
using controller::JointVector;

std::vector<JointVector> read_postures(const std::string& path, int n) try {
  const text::YamlNode document = text::parse_yaml(text::read_input(path));
  if (document.kind != text::YamlNode::Kind::kSequence || document.items.empty()) {
    throw InputError("", "a list of postures is wanted, each a list of joint positions");
  }
  std::vector<JointVector> postures;
  for (const text::YamlNode& item : document.items) {
    text::YamlNode holder;  // a mapping, which reads lists of numbers
    text::YamlNode key;
    key.kind = text::YamlNode::Kind::kScalar;
    key.text = "posture";
    holder.kind = text::YamlNode::Kind::kMap;
    holder.line = item.line;
    holder.items = {key, item};
    static constexpr auto kKeys = text::key_list("posture");
    const text::YamlMapping mapping(holder, "[" + std::to_string(postures.size()) + "].", kKeys);
    const Eigen::VectorXd q = *mapping.vector("posture");
    if (q.size() != n) {
      throw mapping.error("posture",
                          std::to_string(q.size()) + " numbers, expected " + std::to_string(n));
    }
    postures.emplace_back(q);
  }
  return postures;
} catch (const InputError& error) {
  throw error.in_file(path);
}

std::vector<JointVector> read_log_postures(const std::string& path, int n, double step) {
  std::vector<JointVector> postures;
  lcmtypes::MessageHandlers handlers;
  handlers.on_state = [&](const state_t& state) {
    if (state.n != n) {
      throw InputError("--log", path + ": its states have " + std::to_string(state.n) +
                                    " joints, expected " + std::to_string(n));
    }
    const JointVector q = Eigen::Map<const Eigen::VectorXd>(state.joint_position.data(), n);
    if (!q.allFinite()) return;
    if (!postures.empty() && !((q - postures.back()).cwiseAbs().maxCoeff() > step)) return;
    postures.push_back(q);
  };
  if (!std::ifstream(path)) throw InputError("--log", path + ": cannot be read");
  lcmtypes::LogReader log(path, handlers);
  while (log.read()) log.handle();
  if (postures.empty()) throw InputError("--log", path + ": has no states of a controller");
  return postures;
}

}  // namespace dashpot::apps
