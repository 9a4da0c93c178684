#include <dashpot/apps/audit/audit_options.hpp>
#include <dashpot/apps/cli/arm_option.hpp>
#include <dashpot/apps/cli/posture_option.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/scene/scene.hpp>
#include <dashpot/apps/tune/tuned_loop.hpp>
#include <dashpot/apps/web/arm_view.hpp>
#include <dashpot/apps/web/http_server.hpp>
#include <dashpot/apps/web/web_site.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/contact_audit.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/rotors.hpp>

#include <CLI/CLI.hpp>
#include <array>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace dashpot::apps {
namespace {

/// The arm, posture and designs at the start of the page.
struct TuneStart {
  controller::JointVector q;
  nlohmann::ordered_json designs;                      ///< two of them
  std::string config;                                  ///< path; empty: there is none
  std::vector<controller::JointVector> postures = {};  ///< to choose from; at most kMostListed
};

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

/// Answers the page of `dashpot tune`. It computes, and keeps only models of the arm.
class TuneSite {
 public:
  static constexpr std::int64_t kMostPostures = 500;  ///< of one request
  static constexpr std::size_t kMostListed = 2000;

  TuneSite(TunedArm arm, TuneStart start)
      : arm_(std::move(arm)), start_(std::move(start)), token_(random_token()) {}

  /// Answers a GET: the files of the page, and /setup.
  HttpAnswer get(const std::string& path) const {
    if (path == "/setup") return answer_of(200, setup());
    const PageFile* file = find_page_file(path == "/" ? "/tune.html" : path);
    if (file == nullptr) {
      return {404, "text/plain", std::make_shared<const std::string>("not found\n")};
    }
    return {200, std::string(file->type), std::make_shared<const std::string>(file->text)};
  }
  /// Answers a POST of JSON:
  /// /design {"q", "place", "design"}: TunedLoop::at, and "refused"; with "touches", N/m, also
  /// "contact": TunedLoop::contact;
  /// /workspace {"design", "seed", "first", "count"}: TunedLoop::workspace.
  HttpAnswer post(const std::string& path, const std::string& body) {
    if (path != "/design" && path != "/workspace") return answer_of(404, {{"error", "not found"}});
    const Json asked = Json::parse(body, nullptr, false);
    if (asked.is_discarded()) return answer_of(400, {{"error", "is not JSON"}});
    try {
      return answer_of(200, answer(path, asked));
    } catch (const std::exception& error) {  // bad input, or a loop without a spectrum
      return answer_of(400, {{"error", error.what()}});
    }
  }
  /// The secret that a POST must have in its header kTokenHeader.
  const std::string& token() const { return token_; }

 private:
  Json setup() const {
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

  const TunedArm& arm_of(const Json& design) {
    if (!design.is_object() || !design.contains("arm") || design["arm"].empty()) return arm_;
    const std::string parts = line_of(design["arm"]);
    const auto found = arms_.find(parts);
    if (found != arms_.end()) return found->second;
    if (arms_.size() >= kMostKept) arms_.clear();
    return arms_.emplace(parts, arm_.with(design["arm"])).first->second;
  }

  Json answer(const std::string& path, const Json& asked) {
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

  TunedArm arm_;
  TuneStart start_;
  std::string token_;
  std::map<std::string, TunedArm> arms_;  ///< by their parts
  /// By design and posture: the slider of the stiffness changes neither.
  std::map<std::string, std::optional<controller::ContactAt>> contacts_;
};

constexpr int kTunePort = 8025;

struct TuneOptions {
  std::string config, urdf, base, tip, drives, payload;
  PostureOption posture;
  PosturesOption postures;  ///< a file or a log
  int port = kTunePort;
};

/// The Panda of the tree, or of an installation.
std::string panda_path() {
  constexpr const char* kPanda = "sim/models/panda.urdf";
  std::error_code ignored;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path();
  for (const auto& path : {std::filesystem::path(kPanda), program / "../../" / kPanda,
                           program / "../share/dashpot" / kPanda}) {
    if (std::filesystem::exists(path, ignored)) return path.lexically_normal();
  }
  throw InputError("", std::string("there is no ") + kPanda + " here: give CONFIG or --urdf");
}

/// The postures of the file or log, thinned out evenly to as many as the page takes.
std::vector<controller::JointVector> listed(const TuneOptions& options,
                                            const controller::RobotModel& model) {
  std::vector<controller::JointVector> all = options.postures.listed(options.posture, model);
  if (all.size() <= TuneSite::kMostListed) return all;
  std::vector<controller::JointVector> some;
  for (std::size_t i = 0; i < TuneSite::kMostListed; ++i) {
    some.push_back(all[i * (all.size() - 1) / (TuneSite::kMostListed - 1)]);
  }
  return some;
}

TuneSite make_site(const TuneOptions& options) try {
  if (!options.config.empty()) {
    const controller::Config config = controller::load_config(options.config);
    warn_of(config);
    TunedArm arm(config.robot, &config.settings);
    const auto design = design_json(arm);
    auto other = design;
    const bool joint = design["mode"] == "joint";
    other[joint ? "joint_damping" : "damping"] = {{"ratio", 0.7}};
    TuneStart start{posture_of(options.config, options.posture, config.model),
                    {design, other},
                    options.config,
                    listed(options, config.model)};
    return {std::move(arm), std::move(start)};
  }
  const bool own = !options.urdf.empty();
  controller::RobotDescription robot{options.urdf, options.base, options.tip, {}};
  if (!own) robot = {panda_path(), "panda_link0", "panda_hand_tcp", {}};
  take_drives(options.drives, robot.options);
  robot.options.payload = read_payload(options.payload);
  TunedArm arm(robot, nullptr);
  warn_of(arm.model());
  auto a = design_json(arm);
  a["mode"] = "cartesian";
  a["null_stiffness"] = json_list(Eigen::VectorXd::Zero(arm.model().dof()));
  a["null_damping"] = a["null_stiffness"];
  a["damping"] = {{"ratio", 0.7}};
  auto b = a;
  b["damping"] = {{"factor", 2}};
  PostureOption posture = options.posture;
  if (!own && posture.q.empty()) posture.q = "0.1,-0.7,0.2,-1.9,0.1,1.4,0.6";
  const controller::JointVector q = posture.read(arm.model());
  TuneStart start{q, {a, b}, "", listed(options, arm.model())};
  return {std::move(arm), std::move(start)};
} catch (const controller::InvalidModel& error) {
  const std::string what = error.what();
  throw what.starts_with("drives:") ? model_error(error) : InputError("--urdf", what);
}

void run_tune(const TuneOptions& options) {
  const StopSignal stop;
  TuneSite site = make_site(options);
  HttpContent content;
  content.answer = [&site](const auto& path, const auto&) { return site.get(path); };
  content.post = [&site](const auto& path, const auto& body) { return site.post(path, body); };
  content.token = site.token();
  std::unique_ptr<HttpServer> server;
  try {
    server = std::make_unique<HttpServer>(options.port, std::move(content));
  } catch (const std::runtime_error& error) {
    throw InputError("--port", error.what());
  }
  print("http://127.0.0.1:" + std::to_string(server->port()) + "/ (Ctrl-C ends)\n");
  server->run(StopSignal::given);
}

}  // namespace

void add_tune(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "tune", "Choose stiffness and damping on a page, by looking at the modes that they give");
  const auto options = std::make_shared<TuneOptions>();
  CLI::Option* config =
      command->add_option("config", options->config, "Configuration of the controller")
          ->option_text("[CONFIG]");
  CLI::Option* urdf = command->add_option("--urdf", options->urdf, "Robot description instead")
                          ->option_text("FILE")
                          ->excludes(config);
  CLI::Option* base = command->add_option("--base", options->base, "Link that stands still")
                          ->option_text("LINK")
                          ->needs(urdf);
  CLI::Option* tip = command->add_option("--tip", options->tip, "Link at the end of the chain")
                         ->option_text("LINK")
                         ->needs(urdf);
  urdf->needs(base)->needs(tip);
  command->add_option("--drives", options->drives, kDrivesHelp)
      ->option_text("NAME")
      ->check(not_empty());
  add_payload(*command, options->payload);
  for (const char* name : {"--drives", "--payload"}) command->get_option(name)->excludes(config);
  options->posture.add(*command);
  CLI::Option* file = command
                          ->add_option("--postures", options->postures.file,
                                       "Postures to choose from, YAML or JSON")
                          ->option_text("FILE");
  command->add_option("--log", options->postures.log, "LCM log with postures to choose from")
      ->excludes(file)
      ->option_text("FILE");
  command->add_option("--port", options->port, "Port of 127.0.0.1; 0 is any free port")
      ->check(CLI::Range(0, 65535))
      ->option_text("N (" + std::to_string(kTunePort) + ")");
  command->footer(
      "Without CONFIG and --urdf it shows a Panda. A has a damping ratio of 0.7, B D = 2 sqrt(K).\n"
      "The page computes; it commands no robot and writes no file.\n" +
      std::string(kExitStatusHelp));
  command->callback([options] { run_tune(*options); });
}

}  // namespace dashpot::apps
