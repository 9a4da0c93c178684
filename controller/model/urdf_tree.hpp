#pragma once
#include <dashpot/text/plain_urdf.hpp>

#include <urdf_model/model.h>

#include <functional>
#include <map>
#include <memory>
#include <string>

namespace dashpot::controller {

/// Throws InvalidModel: "arm.urdf: link 'hand': reason", where `name` is "arm.urdf" and `kind`
/// "link".
[[noreturn]] void refuse(const std::string& name, const std::string& kind,
                         const std::string& element, const std::string& reason);

/// A URDF as parsed by urdfdom, with the additional results of text::PlainUrdf.
struct UrdfTree {
  std::shared_ptr<urdf::ModelInterface> model;
  std::map<std::string, text::MotionLimits, std::less<>> limits;  ///< by joint
  std::map<std::string, double, std::less<>> reflected_inertia;   ///< by joint, kg m^2 (kg)
  std::map<std::string, std::string, std::less<>> lacks, turns;   ///< likewise
};

/// Parses what text::plain_urdf makes of a URDF, and checks that it is a tree: one root, one parent
/// for every other link, no loop. urdfdom's messages become the text of InvalidModel and do not
/// reach the console. `name` stands in front of every message.
UrdfTree read_urdf(const std::string& text, const std::string& name);

/// Returns the links of the tree as text, the links with names nearest to `name` first: "its links
/// are a, b", or, if there are more than ten, "the nearest of its 30 links are ...".
std::string links_near(const std::string& name, const urdf::ModelInterface& tree);

}  // namespace dashpot::controller
