#include <dashpot/text/plain_urdf.hpp>
#include <dashpot/text/xml_check.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <functional>
#include <initializer_list>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace dashpot::text {
namespace {

/// Returns the element or expression outside comments by which a text is an unexpanded xacro; "" if
/// there is none. (An expanded xacro may keep the name space.)
std::string xacro_sign(std::string_view text) {
  std::size_t at = 0;
  while ((at = text.find_first_of("<$", at)) != std::string_view::npos) {
    if (text.compare(at, 4, "<!--") == 0) {
      at = text.find("-->", at);
      if (at == std::string_view::npos) break;
    }
    if (text.compare(at, 7, "<xacro:") == 0) {
      return std::string(text.substr(at, text.find_first_of(" \t\r\n/>", at) - at)) + ">";
    }
    if (text.compare(at, 2, "${") == 0) {
      return std::string(text.substr(at, text.find('}', at) - at)) + "}";
    }
    ++at;
  }
  return "";
}

bool one_of(std::string_view name, std::initializer_list<std::string_view> names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// The numbers of an attribute between white space; false if there are others than N finite ones.
template <std::size_t N>
bool read_numbers(std::string_view text, std::array<double, N>& numbers) {
  constexpr std::string_view kSpace = " \t\r\n";
  for (double& number : numbers) {
    const std::size_t begin = text.find_first_not_of(kSpace);
    if (begin == std::string_view::npos) return false;
    text.remove_prefix(begin);
    std::string_view word = text.substr(0, text.find_first_of(kSpace));
    text.remove_prefix(word.size());
    if (word.starts_with('+')) word.remove_prefix(1);
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(number)) {
      return false;
    }
  }
  return text.find_first_not_of(kSpace) == std::string_view::npos;
}

/// Roll, pitch and yaw of a unit quaternion x, y, z, w, as "r p y". Yaw is taken out first, then
/// pitch, so that their product is right also where yaw and roll turn about one axis.
std::string rpy_of(const std::array<double, 4>& quaternion) {
  const auto [x, y, z, w] = quaternion;
  // Columns of R, of which the third is their product: (R00 R10 R20), (R01 R11 R21).
  const double R00 = 1 - 2 * (y * y + z * z), R10 = 2 * (x * y + z * w), R20 = 2 * (x * z - y * w);
  const double R01 = 2 * (x * y - z * w), R11 = 1 - 2 * (x * x + z * z), R21 = 2 * (y * z + x * w);
  const double yaw = std::atan2(R10, R00);
  const double c = std::cos(yaw), s = std::sin(yaw);
  const double pitch = std::atan2(-R20, c * R00 + s * R10);
  const double cp = std::cos(pitch), sp = std::sin(pitch);
  const double cos_roll = c * R11 - s * R01;
  const double sin_roll = sp * (c * R01 + s * R11) + cp * R21;
  std::array<char, 100> text{};
  std::snprintf(text.data(), text.size(), "%.17g %.17g %.17g", std::atan2(sin_roll, cos_roll),
                pitch, yaw);
  return text.data();
}

/// Writes the parts of a description that the mechanics of a chain need.
class PlainWriter {
 public:
  explicit PlainWriter(PlainUrdf& result) : result_(result) {
    result_.text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
  }

  void visit(const XmlTag& tag) {
    if (tag.depth >= kept_.size()) return;
    if (tag.starts) {
      kept_[tag.depth] = keeps(tag);
      if (kept_[tag.depth]) write_start(tag);
    } else if (kept_[tag.depth]) {
      result_.text.append("</").append(tag.name).append(">");
    }
    if (tag.ends) kept_[tag.depth] = false;
  }

  /// Name of the first element unless it is a robot; "" otherwise.
  const std::string& stranger() const { return stranger_; }
  bool any_robot() const { return robot_; }

 private:
  [[noreturn]] void fail(const std::string& reason) const {
    throw std::runtime_error((part_.empty() ? "" : part_ + " '" + part_name_ + "': ") + reason);
  }

  static std::string_view value_of(const XmlTag& tag, std::string_view name) {
    for (const auto& [key, value] : tag.attributes) {
      if (key == name) return value;
    }
    return {};
  }
  static bool has(const XmlTag& tag, std::string_view name) {
    return std::any_of(tag.attributes.begin(), tag.attributes.end(),
                       [&](const auto& attribute) { return attribute.first == name; });
  }

  bool keeps(const XmlTag& tag) {
    switch (tag.depth) {
      case 0:
        return begin_robot(tag);
      case 1:
        if (!kept_[0] || !one_of(tag.name, {"link", "joint"})) return false;
        part_ = tag.name;
        part_name_ = value_of(tag, "name");
        limited_ = false;
        return true;
      case 2:
        if (!kept_[1]) return false;
        return part_ == "link" ? tag.name == "inertial"
                               : one_of(tag.name, {"parent", "child", "origin", "axis", "limit",
                                                   "dynamics", "mimic"});
      default:
        return kept_[2] && part_ == "link" && one_of(tag.name, {"origin", "mass", "inertia"});
    }
  }

  bool begin_robot(const XmlTag& tag) {
    if (tag.name != "robot") {
      if (!robot_ && stranger_.empty()) stranger_ = tag.name;
      return false;
    }
    if (robot_) return false;
    robot_ = true;
    part_.clear();
    if (has(tag, "version")) {
      const std::string_view version = value_of(tag, "version");
      if (!one_of(version, {"1.0", "1.1", "1.2", "1"})) {
        fail("is a URDF of version '" + std::string(version) + "'; 1.0, 1.1 and 1.2 are read");
      }
      minor_ = version.size() < 3 ? 0 : version[2] - '0';
    }
    return true;
  }

  void write_start(const XmlTag& tag) {
    std::string& text = result_.text;
    text.append(text.back() == '>' ? "\n<" : "<").append(tag.name);
    const bool turned = tag.name == "origin" && has(tag, "quat_xyzw");
    for (const auto& [name, value] : tag.attributes) {
      if (tag.depth == 0 && name == "version") continue;
      if (turned && name == "quat_xyzw") {
        write_attribute("rpy", rotation(tag, value));
      } else {
        write_attribute(name, value);
      }
    }
    if (tag.depth == 2 && tag.name == "origin") note_turn(value_of(tag, "rpy"));
    const bool limit = tag.depth == 2 && tag.name == "limit";
    if (limit) complete(tag);
    text.append(tag.ends ? "/>" : ">");
    if (limit) read_limits(tag);
    if (tag.name == "dynamics" && has(tag, "reflected_inertia")) {
      std::array<double, 1> inertia{};
      if (!read_numbers(value_of(tag, "reflected_inertia"), inertia)) {
        fail("dynamics reflected_inertia: a number is wanted, kg m^2");
      }
      result_.reflected_inertia.emplace(part_name_, inertia[0]);
    }
  }

  void write_attribute(std::string_view name, std::string_view value) {
    const char* quote = value.find('"') == std::string_view::npos ? "\"" : "'";
    result_.text.append(" ").append(name).append("=").append(quote).append(value).append(quote);
  }

  void note_turn(std::string_view rpy) {
    constexpr double kTurn = 6.3;  // rad
    std::array<double, 3> angles{};
    if (part_ == "joint" && read_numbers(rpy, angles) &&
        std::any_of(angles.begin(), angles.end(), [](double a) { return std::abs(a) > kTurn; })) {
      result_.turns.emplace(part_name_, rpy);
    }
  }

  std::string rotation(const XmlTag& tag, std::string_view value) const {
    if (minor_ < 1) {
      fail(
          "quat_xyzw: belongs to URDF 1.1, and is ignored by programs that read 1.0; write "
          "version='1.1' in <robot>, or rpy");
    }
    if (has(tag, "rpy")) fail("its origin has rpy and quat_xyzw; one of them is wanted");
    std::array<double, 4> q{};
    if (!read_numbers(value, q)) fail("quat_xyzw: four finite numbers are wanted");
    const double norm = std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3]));
    if (!(std::abs(norm - 1) < 1e-2)) fail("quat_xyzw: is not of length 1");  // or in another unit
    for (double& entry : q) entry /= norm;
    return rpy_of(q);
  }

  /// Writes the values that a limit lacks; they do not matter for a joint that is not used.
  void complete(const XmlTag& tag) {
    for (const char* name : {"effort", "velocity"}) {
      if (has(tag, name)) continue;
      write_attribute(name, "0");
      std::string& lacks = result_.lacks[part_name_];
      lacks += (lacks.empty() ? "" : " and ") + std::string(name);
    }
  }

  void read_limits(const XmlTag& tag) {
    if (minor_ < 2 || std::exchange(limited_, true)) return;
    MotionLimits limits;
    bool any = false;
    for (const auto& [name, member] : {std::pair("acceleration", &MotionLimits::acceleration),
                                       {"deceleration", &MotionLimits::deceleration},
                                       {"jerk", &MotionLimits::jerk}}) {
      if (!has(tag, name)) continue;
      std::array<double, 1> number{};
      if (!read_numbers(value_of(tag, name), number) || !(number[0] > 0)) {
        fail(std::string("limit ") + name + ": a positive number is wanted");
      }
      limits.*member = number[0];
      any = true;
    }
    if (any) result_.limits.emplace(part_name_, limits);
  }

  PlainUrdf& result_;
  std::array<bool, 4> kept_{};  ///< of the open elements, by their depth
  std::string stranger_;
  bool robot_ = false;
  int minor_ = 0;                 ///< of version 1.x
  std::string part_, part_name_;  ///< the link or joint that is open
  bool limited_ = false;          ///< its limits were read: the first count
};

}  // namespace

PlainUrdf plain_urdf(std::string_view text, const std::string& name) {
  if (const std::string sign = xacro_sign(text); !sign.empty()) {
    constexpr std::size_t kEnough = 60;
    throw std::runtime_error("is a xacro that is not expanded yet (" + sign.substr(0, kEnough) +
                             "); expand it first: xacro " + name +
                             " > robot.urdf (xacro comes with ROS, or by pip install xacro)");
  }
  PlainUrdf result;
  PlainWriter writer(result);
  check_xml(text, [&](const XmlTag& tag) { writer.visit(tag); });
  if (writer.any_robot()) return result;
  const std::string& stranger = writer.stranger();
  if (one_of(stranger, {"mujoco", "mujocoinclude"})) {
    throw std::runtime_error(
        "is MJCF, MuJoCo's format, not a URDF; in Python, dashpot.Robot.from_mujoco(path, base, "
        "tip) reads it, and save() of that writes a URDF with its drives");
  }
  if (one_of(stranger, {"sdf", "gazebo"})) {
    throw std::runtime_error(
        "is SDF, Gazebo's format, not a URDF with one <robot>; give the URDF or xacro that it was "
        "made from");
  }
  result.text = text;  // for the parser to say what it misses
  return result;
}

}  // namespace dashpot::text
