#pragma once
#include <urdf_model/model.h>

#include <memory>
#include <string>

namespace dashpot::controller {

/// Parses a URDF and makes sure that it is a tree: one root, one parent for every other link, no
/// loop. urdfdom's messages become the text of InvalidModel and do not reach the console. `name`
/// stands in front of every message.
std::shared_ptr<urdf::ModelInterface> read_urdf(const std::string& text, const std::string& name);

/// The whole file. Throws InvalidModel if it cannot be read.
std::string read_text(const std::string& path);

}  // namespace dashpot::controller
