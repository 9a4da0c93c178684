#include <dashpot/apps/audit/presets.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/tune/tune_site.hpp>
#include <dashpot/apps/tune/tuned_loop.hpp>
#include <dashpot/apps/web/arm_view.hpp>
#include <dashpot/apps/web/web_site.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/rotors.hpp>

#include <array>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <random>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

namespace dashpot::apps {
namespace {

using controller::InputError;

constexpr std::size_t kMostKept = 8;
constexpr const char* kPaper = "the paper's Discussion, C_C1";

HttpAnswer answer_of(unsigned status, const Json& document) {
  return {status, "application/json", std::make_shared<const std::string>(line_of(document))};
}

std::string random_token() {
  std::random_device random;
  std::string token;
  for (int i = 0; i < 4; ++i) {
    std::array<char, 9> word{};
    std::snprintf(word.data(), word.size(), "%08x", random());
    token += word.data();
  }
  return token;
}

/// The gains of public controllers as designs, and the task of the paper's Discussion: its
/// stiffness and its C_C1, see docs/tuning-page.md.
Json presets_json(int n) {
  Json list = Json::array();
  for (const GainPreset& preset : kPresets) {
    const JointGains* joints = preset.joints;
    if (joints != nullptr && n != static_cast<int>(joints->stiffness.size())) continue;
    const double t = preset.translation, r = preset.rotation;
    list.push_back(
        {{"name", std::string(preset.name)},
         {"design",
          {{"mode", "cartesian"},
           {"frame", "base"},
           {"stiffness", {t, t, t, r, r, r}},
           {"damping", {{"factor", kPresetFactor}}},
           {"null_stiffness", std::vector<double>(static_cast<std::size_t>(n), preset.null_space)},
           {"null_damping", {{"factor", kPresetFactor}}},
           {"null_projector", "kinematic"},
           {"rotation", preset.half_quaternion ? "half-quaternion" : "vector"},
           {"inertia_blocks", preset.inertia_blocks}}}});
    if (joints == nullptr) continue;
    const double c = joints->translation, w = joints->rotation;
    list.back()["design"].update({{"damping", {c, c, c, w, w, w}},
                                  {"null_stiffness", joints->stiffness},
                                  {"null_damping", joints->damping},
                                  {"null_projector", "none"}});
  }
  controller::Matrix6 C = controller::Vector6{0.1, 0.1, 0.1, 10, 10, 1}.asDiagonal();
  C(2, 4) = C(4, 2) = 10;
  list.push_back({{"name", kPaper},
                  {"design",
                   {{"mode", "cartesian"},
                    {"frame", "base"},
                    {"stiffness", {3000, 3000, 3000, 100, 100, 100}},
                    {"damping", json_rows(C)}}}});
  return list;
}

const Json& wanted(const Json& asked, const char* key) {
  if (!asked.is_object() || !asked.contains(key)) throw InputError(key, "missing");
  return asked[key];
}

controller::JointVector posture(const Json& told, const controller::RobotModel& model) {
  static constexpr auto kKeys = text::key_list("q");
  const text::YamlNode document = yaml_of({{"q", told}});
  const text::YamlMapping keys(document, "", kKeys);
  if (!keys.has("q")) throw keys.error("q", "missing");
  controller::JointVector q(model.dof());
  text::read_numbers(keys, "q", controller::joint_units(model, "rad", "m"), {-1e9, true, 1e9}, q);
  return q;
}

std::int64_t whole_number(const Json& asked, const char* key, std::int64_t most) {
  const Json& value = wanted(asked, key);
  const bool whole = value.is_number_unsigned();
  if (!whole || value.get<std::uint64_t>() > static_cast<std::uint64_t>(most)) {
    throw InputError(key, "has to be a whole number from 0 to " + std::to_string(most));
  }
  return value.get<std::int64_t>();
}

double touched(const Json& told) {
  constexpr double kMost = 1e9;  // N/m
  if (told.is_number() && told.get<double>() >= 0 && told.get<double>() <= kMost) return told;
  throw InputError("touches", "has to be a stiffness from 0 to 1e9 N/m");
}

}  // namespace

TuneSite::TuneSite(TunedArm arm, TuneStart start)
    : arm_(std::move(arm)), start_(std::move(start)), token_(random_token()) {}

Json TuneSite::setup() const {
  const controller::RobotModel& model = arm_.model();
  const controller::UnknownRotors rotors = controller::unknown_rotors(model);
  const controller::Drives* published = controller::drives_like(model);
  Json document = {{"token", token_},
                   {"arm", chain_json(model)},
                   {"robot",
                    {{"urdf", std::filesystem::absolute(arm_.robot().urdf).lexically_normal()},
                     {"base", arm_.robot().base},
                     {"tip", arm_.robot().tip},
                     {"config", start_.config},
                     {"keys", robot_keys(arm_.robot())}}},
                   {"q", json_list(start_.q)},
                   {"designs", start_.designs},
                   {"presets", presets_json(model.dof())},
                   {"usual_margin", controller::Settings().limits.gain_margin},
                   {"rotors_unknown", rotors.any()},
                   {"postures", Json::array()},
                   {"published", nullptr}};
  for (const controller::JointVector& q : start_.postures)
    document["postures"].push_back(json_list(q));
  for (const auto& [key, property] :
       {std::pair("reflected_inertia", &controller::Joint::reflected_inertia),
        {"viscous_friction", &controller::Joint::viscous_friction},
        {"gear_stiffness", &controller::Joint::gear_stiffness},
        {"gear_damping", &controller::Joint::gear_damping}}) {
    document["model"][key] = json_list(model.joint_values(property));
  }
  document["model"]["payload"] = model.attachment().mass;
  if (published != nullptr) {
    document["published"] = {
        {"name", std::string(published->name)},
        {"reflected_inertia", json_list(published->values(published->reflected_inertia))}};
  }
  return document;
}

HttpAnswer TuneSite::get(const std::string& path) const {
  if (path == "/setup") return answer_of(200, setup());
  const PageFile* file = find_page_file(path == "/" ? "/tune.html" : path);
  if (file == nullptr) {
    return {404, "text/plain", std::make_shared<const std::string>("not found\n")};
  }
  return {200, std::string(file->type), std::make_shared<const std::string>(file->text)};
}

const TunedArm& TuneSite::arm_of(const Json& design) {
  if (!design.is_object() || !design.contains("arm") || design["arm"].empty()) return arm_;
  const std::string parts = line_of(design["arm"]);
  const auto found = arms_.find(parts);
  if (found != arms_.end()) return found->second;
  if (arms_.size() >= kMostKept) arms_.clear();
  return arms_.emplace(parts, arm_.with(design["arm"])).first->second;
}

Json TuneSite::answer(const std::string& path, const Json& asked) {
  const Json& told = wanted(asked, "design");
  const TunedArm& arm = arm_of(told);
  const TunedDesign design = read_design(arm, told);
  if (path == "/workspace") {
    const std::int64_t seed = whole_number(asked, "seed", 1 << 30);
    const std::int64_t first = whole_number(asked, "first", 1 << 30);
    const std::int64_t count = whole_number(asked, "count", kMostPostures);
    return TunedLoop(arm, design).workspace(static_cast<std::uint64_t>(seed), first, count);
  }
  const Json& place = wanted(asked, "place");
  if (!place.is_string()) throw InputError("place", "has to be a text");
  const controller::JointVector q = posture(wanted(asked, "q"), arm.model());
  const TunedLoop loop(arm, design);
  Json result = loop.at(q, place.get<std::string>());
  if (asked.contains("touches")) {
    const std::string where = line_of(told) + line_of(asked["q"]);
    if (contacts_.size() >= kMostKept && !contacts_.contains(where)) contacts_.clear();
    result["contact"] = loop.contact(q, touched(asked["touches"]), contacts_[where]);
  }
  result["refused"] = refusals(arm, design, q);
  result["warned"] = warnings(arm, design);
  return result;
}

HttpAnswer TuneSite::post(const std::string& path, const std::string& body) {
  if (path != "/design" && path != "/workspace") return answer_of(404, {{"error", "not found"}});
  const Json asked = Json::parse(body, nullptr, false);
  if (asked.is_discarded()) return answer_of(400, {{"error", "is not JSON"}});
  try {
    return answer_of(200, answer(path, asked));
  } catch (const std::exception& error) {  // bad input, or a loop without a spectrum
    return answer_of(400, {{"error", error.what()}});
  }
}

}  // namespace dashpot::apps
