#include <dashpot/lcmtypes/command_verdict.hpp>

namespace dashpot::lcmtypes {

const char* to_text(CommandVerdict verdict) noexcept {
  switch (verdict) {
    case CommandVerdict::kAccepted:
      return "accepted";
    case CommandVerdict::kMalformed:
      return "not the bytes of a command";
    case CommandVerdict::kWrongSize:
      return "wrong number of joints";
    case CommandVerdict::kUnknown:
      return "unknown part, mode or frame";
    case CommandVerdict::kNotFinite:
      return "not finite";
    case CommandVerdict::kNotUnit:
      return "quaternion not of length 1";
    case CommandVerdict::kOutOfLimits:
      return "out of limits";
    case CommandVerdict::kIndefinite:
      return "gains not symmetric positive semidefinite";
    case CommandVerdict::kStale:
      return "too old";
    case CommandVerdict::kFromFuture:
      return "from the future";
    case CommandVerdict::kReplayed:
      return "replayed or out of order";
    case CommandVerdict::kTooMany:
      return "too many";
    case CommandVerdict::kNoSender:
      return "no sender";
    case CommandVerdict::kOtherSender:
      return "another sender commands";
    case CommandVerdict::kUnstable:
      return "refused by the controller";
    case CommandVerdict::kNoSuchFault:
      return "releases no fault that is latched";
  }
  return "unknown";
}

}  // namespace dashpot::lcmtypes
