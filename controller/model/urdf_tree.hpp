#pragma once
#include <urdf_model/model.h>

#include <memory>
#include <string>

namespace dashpot::controller {

/// Throws InvalidModel: "arm.urdf: link 'hand': reason", where `name` is "arm.urdf" and `kind`
/// "link".
[[noreturn]] void refuse(const std::string& name, const std::string& kind,
                         const std::string& element, const std::string& reason);

/// Parses a URDF that text::check_xml accepts, and checks that it is a tree: one root, one parent
/// for every other link, no loop. urdfdom's messages become the text of InvalidModel and do not
/// reach the console. `name` stands in front of every message.
std::shared_ptr<urdf::ModelInterface> read_urdf(const std::string& text, const std::string& name);

/// Returns the links of the tree as text, the links with names nearest to `name` first: "its links
/// are a, b", or, if there are more than ten, "the nearest of its 30 links are ...".
std::string links_near(const std::string& name, const urdf::ModelInterface& tree);

/// Returns the text of a file, which must be a regular file. Throws InvalidModel if it cannot be
/// read.
std::string read_text(const std::string& path);

}  // namespace dashpot::controller
