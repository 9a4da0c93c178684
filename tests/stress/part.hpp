#pragma once
// The parts of the program: what each does, and its options.

#include <cstdint>
#include <string>
#include <vector>

namespace dashpot::stress {

/// A part's options on the command line.
struct Request {
  std::string kind;  ///< one of the part's
  double count = 0;  ///< of ticks, steps, cases, seconds, ...
  std::uint64_t seed = 1;
  double times = 1;                  ///< as fast as real time
  std::vector<std::string> plugins;  ///< [LABEL=]FILE
  bool brief = false;                ///< --short
  bool verbose = false;

  long whole() const { return static_cast<long>(count); }
};

/// The amount of a part, of one kind if it has several.
struct Amount {
  double count, brief;  ///< by default, and with --short
  const char* kind = "";
  const char* what = "";  ///< of the kind: a line of help
  bool of_all = true;     ///< `all` does it
};

/// A subcommand.
struct Part {
  const char* name;
  int place;  ///< in `all`; 0: only by its name
  const char* help;
  const char* unit;                    ///< what is counted: "TICKS"
  std::vector<Amount> amounts;         ///< one, or one for each kind
  bool (*run)(const Request&);         ///< prints what it saw; whether all is well
  std::vector<std::string> more = {};  ///< of SEED, TIMES, PLUGIN, --verbose
};

/// The parts of this program, by the files that it is made of.
inline std::vector<Part>& parts() {
  static std::vector<Part> all;
  return all;
}

/// A global one of these makes a part known.
struct AddPart {
  explicit AddPart(const Part& part) { parts().push_back(part); }
};

}  // namespace dashpot::stress
