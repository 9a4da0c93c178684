#include <dashpot/analysis/mode.hpp>

namespace dashpot::analysis {

const char* to_text(ModeKind kind) noexcept {
  switch (kind) {
    case ModeKind::kUnderdamped:
      return "underdamped";
    case ModeKind::kCritical:
      return "critical";
    case ModeKind::kOverdamped:
      return "overdamped";
    case ModeKind::kUndamped:
      return "undamped";
    case ModeKind::kUnstable:
      return "unstable";
    case ModeKind::kSoft:
      return "soft";
    case ModeKind::kAlternating:
      return "alternating";
  }
  return "unknown";
}

}  // namespace dashpot::analysis
