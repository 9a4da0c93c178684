#include <dashpot/apps/cli/arm_option.hpp>
#include <dashpot/apps/cli/posture_option.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/apps/cli/terminal.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/scene/scene_file.hpp>
#include <dashpot/apps/tune/tune_site.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/posture.hpp>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace dashpot::apps {
namespace {

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
