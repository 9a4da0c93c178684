#pragma once
#include <dashpot/apps/audit/audit_options.hpp>
#include <dashpot/controller/contact_audit.hpp>

#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// A limit at one of many postures.
struct PostureContact {
  bool held = false;  ///< the arm can hold itself there
  /// The stiffness is NaN if the arm cannot hold itself, the tip cannot move in the direction, or
  /// the eigenvalue iteration fails.
  controller::ContactAt touch;
};

/// The results of `dashpot contact`.
struct ContactReport {
  controller::ContactOptions options;
  double asked = 0;  ///< stiffness that the arm is to touch, N/m; 0: none
  controller::ContactAudit posture;
  std::vector<analysis::ContactPoint> curve;
  double limit_with_rotors = 0;  ///< N/m, with published rotors in place of missing ones; or NaN
  std::vector<PostureContact> workspace;          ///< empty if it was not asked for
  std::vector<controller::JointVector> postures;  ///< of the workspace
  bool interrupted = false;
};

std::string contact_json(const AuditTask& task, const ContactReport& report);
/// Returns tables after one line with the verdict.
std::string contact_table(const AuditTask& task, const ContactReport& report);

/// Draws ratio and frequency over the stiffness to a file whose name ends with .svg or .png. Throws
/// std::runtime_error if gnuplot fails.
void draw_contact(const std::string& path, const AuditTask& task, const ContactReport& report);

}  // namespace dashpot::apps
