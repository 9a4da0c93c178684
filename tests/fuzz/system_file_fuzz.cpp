// The input as a file of `dashpot analyze` and `dashpot design`.
#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/apps/cli/system_file.hpp>
#include <dashpot/apps/report/system_report.hpp>
#include <dashpot/tests/fuzz/fuzz_input.hpp>

#include <nlohmann/json.hpp>
#include <vector>

namespace {

using namespace dashpot;  // NOLINT(google-build-using-namespace)

constexpr Eigen::Index kLargest = 24;  // coordinates; more take long

apps::Report report_on(const apps::SystemEntry& entry, const analysis::System<>& system) {
  return apps::make_report(entry, system, analysis::SpectrumOptions(), analysis::Pivot::kLargest);
}

void analyze(const apps::SystemFile& file) {
  std::vector<apps::Report> reports;
  for (const apps::SystemEntry& entry : file.entries) {
    if (entry.impedance.mass.rows() > kLargest) return;
    reports.push_back(report_on(entry, analysis::to_joint_space(entry.impedance)));
  }
  const std::string json = apps::to_json(reports, file.is_list);
  fuzz::require(nlohmann::json::accept(json), "what is printed is JSON");
  apps::to_table(reports, file.is_list, false);
}

void design(const apps::SystemFile& file) {
  for (const apps::SystemEntry& entry : file.entries) {
    if (entry.impedance.mass.rows() > kLargest) return;
    const auto target = analysis::DampingTarget::constant(0.7);
    for (const auto structure :
         {analysis::DampingStructure::kFull, analysis::DampingStructure::kDiagonal}) {
      const auto found = analysis::design_damping(entry.impedance, target, structure, {});
      fuzz::require(found.damping.allFinite(), "the damping is finite");
      analysis::with_damping(entry.impedance, found.damping);
    }
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const fuzz::ScratchTree tree;
  const std::string path = tree.write("system.yaml", data, size);
  apps::SystemFile file;
  try {
    file = apps::read_systems(path);
  } catch (const apps::InputError&) {
    return 0;
  }
  for (const auto& work : {analyze, design}) {
    try {
      work(file);
    } catch (const analysis::InvalidSystem&) {  // said in one line by the program
    }
  }
  return 0;
}
