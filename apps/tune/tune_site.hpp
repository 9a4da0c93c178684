#pragma once
#include <dashpot/apps/tune/tuned_design.hpp>
#include <dashpot/apps/web/http_server.hpp>
#include <dashpot/controller/contact_audit.hpp>

#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// The arm, posture and designs at the start of the page.
struct TuneStart {
  controller::JointVector q;
  nlohmann::ordered_json designs;                      ///< two of them
  std::string config;                                  ///< path; empty: there is none
  std::vector<controller::JointVector> postures = {};  ///< to choose from; at most kMostListed
};

/// Answers the page of `dashpot tune`. It computes, and keeps only models of the arm.
class TuneSite {
 public:
  static constexpr std::int64_t kMostPostures = 500;  ///< of one request
  static constexpr std::size_t kMostListed = 2000;

  TuneSite(TunedArm arm, TuneStart start);

  /// Answers a GET: the files of the page, and /setup.
  HttpAnswer get(const std::string& path) const;
  /// Answers a POST of JSON:
  /// /design {"q", "place", "design"}: TunedLoop::at, and "refused"; with "touches", N/m, also
  /// "contact": TunedLoop::contact;
  /// /workspace {"design", "seed", "first", "count"}: TunedLoop::workspace.
  HttpAnswer post(const std::string& path, const std::string& body);
  /// The secret that a POST must have in its header kTokenHeader.
  const std::string& token() const { return token_; }

 private:
  nlohmann::ordered_json setup() const;
  const TunedArm& arm_of(const nlohmann::ordered_json& design);
  nlohmann::ordered_json answer(const std::string& path, const nlohmann::ordered_json& asked);

  TunedArm arm_;
  TuneStart start_;
  std::string token_;
  std::map<std::string, TunedArm> arms_;  ///< by their parts
  /// By design and posture: the slider of the stiffness changes neither.
  std::map<std::string, std::optional<controller::ContactAt>> contacts_;
};

}  // namespace dashpot::apps
