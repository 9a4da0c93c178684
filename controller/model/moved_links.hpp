#pragma once
// The links that a chain moves: whether their inertias can be, and whether their units can be
// right.

#include <dashpot/controller/model/rigid_bodies.hpp>

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
/// have, unless the options accept it. A link whose mass and inertia are less than 1e-6 of the
/// chain's cannot matter: it gets a warning instead.
void check_links(const std::vector<MovedLink>& links, const ModelOptions& options,
                 const KDL::Chain& chain, const std::string& name,
                 std::vector<std::string>& warnings);

/// Adds a warning for each figure whose unit is hardly the one of URDFs: a link much heavier or
/// lighter than those of the other joints, an inertia of a body much larger than the arm, and a
/// weight ten times what a joint can hold.
void doubt_units(const RobotModel& model, const std::vector<MovedLink>& links,
                 std::vector<std::string>& warnings);

}  // namespace dashpot::controller
