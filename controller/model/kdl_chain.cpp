#include <dashpot/controller/kdl_chain.hpp>
#include <dashpot/controller/model/robot_model_data.hpp>

namespace dashpot::controller {

const KDL::Chain& kdl_chain(const RobotModel& model) noexcept {
  return model.data().chain;
}

}  // namespace dashpot::controller
