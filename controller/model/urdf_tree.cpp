#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/model/urdf_tree.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/text/read_file.hpp>
#include <dashpot/text/xml_check.hpp>

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <exception>
#include <mutex>
#include <numeric>
#include <utility>
#include <vector>

namespace dashpot::controller {
namespace {

/// Collects the messages of urdfdom during its lifetime.
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
    constexpr std::size_t kEnough = 1000;  // bytes; a bad file may cause a message for each line
    if (level != console_bridge::CONSOLE_BRIDGE_LOG_ERROR || errors_.size() > kEnough) return;
    errors_ += (errors_.empty() ? "" : "; ") + text;
  }
  bool any() const { return !errors_.empty(); }
  std::string errors() const { return errors_.empty() ? "not a URDF" : errors_; }

 private:
  console_bridge::OutputHandler* previous_;
  std::string errors_;
};

std::shared_ptr<urdf::ModelInterface> parse(const std::string& text, const std::string& name,
                                            UrdfTree& tree) {
  static std::mutex one_at_a_time;  // the handler of messages is global
  const std::lock_guard lock(one_at_a_time);
  const Messages messages;
  std::shared_ptr<urdf::ModelInterface> model;
  if (text.find('<') == std::string::npos) {
    throw InvalidModel(
        one_line(name + ": is not a robot description: it contains no XML" +
                 (text.find("urdf:") == std::string::npos
                      ? ""
                      : "; a configuration or scene names one under robot.urdf, and is read by "
                        "dashpot run, drive, tune and check-model")));
  }
  try {
    text::PlainUrdf plain = text::plain_urdf(text, name);
    model = urdf::parseURDF(plain.text);
    tree.limits = std::move(plain.limits);
    tree.reflected_inertia = std::move(plain.reflected_inertia);
    tree.lacks = std::move(plain.lacks);
    tree.turns = std::move(plain.turns);
  } catch (const std::exception& error) {
    throw InvalidModel(one_line(name + ": " + error.what()));
  }
  // If urdfdom cannot read a number, it only logs that and continues.
  if (!model || messages.any()) throw InvalidModel(one_line(name + ": " + messages.errors()));
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
  std::map<std::string, std::size_t> walk_through;  // by link: which of the walks up came there
  std::size_t walk = 0;
  for (const auto& [link_name, link] : model.links_) {
    ++walk;
    for (std::string at = link_name; joint_above.count(at) != 0;
         at = model.joints_.at(joint_above.at(at))->parent_link_name) {
      const auto [seen, is_new] = walk_through.emplace(at, walk);
      if (is_new) continue;
      if (seen->second == walk) refuse(name, "link", link_name, "part of a loop of joints");
      break;  // an earlier walk came to its end from here
    }
  }
}

/// Returns how many letters have to be deleted, inserted or replaced to turn one word into the
/// other; compares the first 100 bytes of the words.
std::size_t edits(const std::string& a, const std::string& b) {
  constexpr std::size_t kLongest = 100;
  const std::size_t m = std::min(a.size(), kLongest), n = std::min(b.size(), kLongest);
  std::vector<std::size_t> row(n + 1);  // from the first i letters of a to the first j of b
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= m; ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 1; j <= n; ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row[n];
}

}  // namespace

void refuse(const std::string& name, const std::string& kind, const std::string& element,
            const std::string& reason) {
  throw InvalidModel(one_line(name + ": " + kind + " '" + element + "': " + reason));
}

UrdfTree read_urdf(const std::string& text, const std::string& name) {
  UrdfTree tree;
  tree.model = parse(text, name, tree);
  check_tree(*tree.model, name);
  return tree;
}

std::string links_near(const std::string& name, const urdf::ModelInterface& tree) {
  constexpr std::size_t kShown = 10, kCompared = 1000;  // enough for a robot; files may have more
  std::vector<std::pair<std::size_t, std::string>> links;
  for (const auto& [link, unused] : tree.links_) {
    if (links.size() == kCompared) break;
    links.emplace_back(edits(name, link), link);
  }
  std::sort(links.begin(), links.end());
  const std::string count = std::to_string(tree.links_.size());
  std::string text = tree.links_.size() <= kShown ? "its links are "
                                                  : "the nearest of its " + count + " links are ";
  for (std::size_t i = 0; i < std::min(kShown, links.size()); ++i) {
    text += (i == 0 ? "" : ", ") + links[i].second;
  }
  return text;
}

std::string read_urdf_file(const std::string& path) try {
  return text::read_file(path, text::kLargestXml);
} catch (const std::runtime_error& error) {
  throw InvalidModel(one_line(path + ": " + error.what()));
}

}  // namespace dashpot::controller
