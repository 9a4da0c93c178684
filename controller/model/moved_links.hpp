#pragma once
// The links that a chain moves: whether their inertias can be, and whether their units can be
// right.

#include <dashpot/controller/model/robot_model_data.hpp>

#include <kdl/chain.hpp>
#include <string>
#include <vector>

namespace dashpot::controller {

/// A link that moves and has a mass.
struct MovedLink {
  LinkBody body;
  int joint = 0;  ///< that moves it, from 0
};

/// Throws InvalidModel, which begins with `name` and names every link whose inertia no body can
/// have, unless the options accept it. A link whose inertia is less than 1e-4 of the chain's cannot
/// matter: it gets a warning instead.
void check_links(const std::vector<MovedLink>& links, const ModelOptions& options,
                 const KDL::Chain& chain, const std::string& name,
                 std::vector<std::string>& warnings);

/// Returns an upper bound of the arm's reach, the sum of the distances of its joints and centres of
/// mass, m.
double reach_of(const KDL::Chain& chain, const std::vector<Joint>& joints);

/// Adds a warning for each value whose unit is probably wrong: a link without mass, or much heavier
/// or lighter than the other joints' links, inertias of bodies much larger than the arm, rotors
/// heavier than it, limits of many turns, a tool or payload beyond its reach, and a weight ten
/// times what a joint can hold. `bare` is the chain with nothing attached.
void doubt_units(const RobotModel& model, const std::vector<MovedLink>& links,
                 const KDL::Chain& bare, std::vector<std::string>& warnings);

}  // namespace dashpot::controller
