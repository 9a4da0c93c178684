#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/urdf_tree.hpp>

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <exception>
#include <fstream>
#include <map>
#include <mutex>
#include <sstream>

namespace dashpot::controller {
namespace {

/// While it lives, keeps what urdfdom has to say.
class Messages : public console_bridge::OutputHandler {
 public:
  Messages() : previous_(console_bridge::getOutputHandler()) {
    console_bridge::useOutputHandler(this);
  }
  Messages(const Messages&) = delete;
  Messages& operator=(const Messages&) = delete;
  ~Messages() override { console_bridge::useOutputHandler(previous_); }

  void log(const std::string& text, console_bridge::LogLevel level, const char* /*file*/,
           int /*line*/) override {
    if (level != console_bridge::CONSOLE_BRIDGE_LOG_ERROR) return;
    errors_ += (errors_.empty() ? "" : "; ") + text;
  }
  bool any() const { return !errors_.empty(); }
  /// All errors, in one line.
  std::string errors() const {
    std::string line = errors_.empty() ? "not a URDF" : errors_;
    std::replace_if(
        line.begin(), line.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20; }, ' ');
    return line;
  }

 private:
  console_bridge::OutputHandler* previous_;
  std::string errors_;
};

std::shared_ptr<urdf::ModelInterface> parse(const std::string& text, const std::string& name) {
  static std::mutex one_at_a_time;  // the handler of messages is global
  const std::lock_guard lock(one_at_a_time);
  const Messages messages;
  std::shared_ptr<urdf::ModelInterface> model;
  try {
    model = urdf::parseURDF(text);
  } catch (const std::exception& error) {
    throw InvalidModel(name + ": " + error.what());
  }
  // Of a number that it cannot read, urdfdom just says so and goes on.
  if (!model || messages.any()) throw InvalidModel(name + ": " + messages.errors());
  return model;
}

void check_tree(const urdf::ModelInterface& model, const std::string& name) {
  std::map<std::string, std::string> joint_above;  // by link
  for (const auto& [joint_name, joint] : model.joints_) {
    const auto [other, is_new] = joint_above.emplace(joint->child_link_name, joint_name);
    if (is_new) continue;
    refuse(name, "link", joint->child_link_name,
           "child of two joints, '" + other->second + "' and '" + joint_name + "'");
  }
  for (const auto& [link_name, link] : model.links_) {
    std::string at = link_name;
    for (std::size_t steps = 0; joint_above.count(at) != 0; ++steps) {
      if (steps == model.links_.size()) refuse(name, "link", link_name, "part of a loop of joints");
      at = model.joints_.at(joint_above.at(at))->parent_link_name;
    }
  }
}

}  // namespace

void refuse(const std::string& name, const std::string& kind, const std::string& element,
            const std::string& reason) {
  throw InvalidModel(name + ": " + kind + " '" + element + "': " + reason);
}

std::shared_ptr<urdf::ModelInterface> read_urdf(const std::string& text, const std::string& name) {
  std::shared_ptr<urdf::ModelInterface> model = parse(text, name);
  check_tree(*model, name);
  return model;
}

std::string read_text(const std::string& path) {
  errno = 0;
  const std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  if (stream.is_open()) text << stream.rdbuf();
  if (!stream.is_open() || text.bad() || errno == EISDIR) {
    throw InvalidModel(path + ": cannot be read: " + std::strerror(errno));
  }
  return text.str();
}

}  // namespace dashpot::controller
