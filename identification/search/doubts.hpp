#pragma once
#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/motion_verdict.hpp>

#include <cstddef>
#include <span>

namespace dashpot::identification {

/// The records that modes were found in, and the residual of their model.
struct RecordFacts {
  double duration = 0, step = 0;           ///< s
  MotionKind kind = MotionKind::kAmbient;  ///< or kDecays, kDriven
  std::size_t records = 1;
  double whiteness = 1;    ///< as in Identification
  double unexplained = 0;  ///< of decays and driven motion: residual share of the squares
  bool rounded = false;    ///< the residual consists of the sensors' steps
  bool differs = false;    ///< parts of the records have other modes
};

/// The evidence on a mode, which a rule weighs.
struct Evidence {
  const MeasuredMode& mode;
  std::span<const MeasuredMode> all = {};  ///< the model's modes, this one among them
  RecordFacts records = {};
  double parts = 1;  ///< of ambient motion: share of the record's parts without which it is found
};

/// The stages at which modes are weighed, each once; a mode that has a reason keeps it.
enum class Stage {
  kHum,          ///< a steady line that was taken away
  kNotRepeated,  ///< in the model of the whole, but not in the models of its parts
  kParts,        ///< of ambient motion, with the spread of its parts
  kLeftOver,     ///< beside the model's residual, one mode after the other
  kMode,         ///< after single eigenvalues are paired
  kTogether      ///< with the verdicts on the other modes
};

/// A rule by which a mode is not believed.
struct Rule {
  Stage stage;
  const char* name;
  const char* words;  ///< MeasuredMode::reason
  bool (*holds)(const Evidence& evidence);
  bool not_linear = false;  ///< MeasuredMode::not_linear
};

/// All rules, in their order: of each stage the first that holds counts.
std::span<const Rule> doubts();

/// Gives a mode the words of the first rule of a stage that holds.
void weigh(Stage stage, const Evidence& evidence, MeasuredMode& mode);

}  // namespace dashpot::identification
