#pragma once
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/identification/check_model.hpp>

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace dashpot::apps {

struct CheckModelReport {
  identification::ModelCheck check;
  std::vector<std::string> files;
  std::vector<std::string> joints;  ///< names
  std::vector<std::string> notes;
};

std::string check_model_table(const CheckModelReport& report);
nlohmann::ordered_json check_model_json(const CheckModelReport& report);

}  // namespace dashpot::apps
