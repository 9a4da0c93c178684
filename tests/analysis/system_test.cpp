// Systems that validate() accepts, and its words for the others.
#include <dashpot/analysis/elastic_form.hpp>
#include <dashpot/analysis/mode.hpp>
#include <dashpot/analysis/system.hpp>
#include <dashpot/tests/support/special_values.hpp>

#include <gtest/gtest.h>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::kInfinity;
using testing::kNan;

/// "key: reason" of the refusal, or "" if the system is a proper one.
std::string refusal(const System<>& system) {
  try {
    validate(system);
    return "";
  } catch (const InvalidSystem& error) {
    EXPECT_EQ(std::string(error.what()).find(error.key() + ": "), 0u);
    return error.what();
  }
}

System<> proper_system() {
  System<> system(3);
  system.mass << 4, 1, 0, 1, 3, 1, 0, 1, 2;
  return system;
}

TEST(Validate, AcceptsProperSystemsAndSaysWhatIsWrongWithOthers) {
  using Change = void (*)(System<>&);
  struct Case {
    Change change;
    const char* refusal;
  };
  for (const Case& c : {
           Case{[](System<>&) {}, ""},
           Case{[](System<>& s) { s = System<>(1); }, ""},
           Case{[](System<>& s) { s = System<>(0); }, ""},
           Case{[](System<>& s) {  // damping and stiffness of any kind
                  s.damping << 1, 2, 3, 4, 5, 6, 7, 8, 9;
                  s.stiffness = -s.damping;
                },
                ""},
           Case{[](System<>& s) { s.mass = MatrixXd::Identity(3, 2); },
                "mass: is 3 x 2, expected 3 x 3"},
           Case{[](System<>& s) { s.damping = MatrixXd::Zero(2, 3); },
                "damping: is 2 x 3, expected 3 x 3"},
           Case{[](System<>& s) { s.stiffness = MatrixXd::Zero(4, 4); },
                "stiffness: is 4 x 4, expected 3 x 3"},
           Case{[](System<>& s) { s.damping(1, 2) = kNan; },
                "damping: entry (2,3) is not a finite number"},
           Case{[](System<>& s) { s.stiffness(2, 0) = -kInfinity; },
                "stiffness: entry (3,1) is not a finite number"},
           Case{[](System<>& s) { s.mass(0, 0) = kInfinity; },
                "mass: entry (1,1) is not a finite number"},
           Case{[](System<>& s) { s.mass(0, 1) = 3, s.mass(1, 0) = 4; },
                "mass: is not symmetric: entry (1,2) is 3, entry (2,1) is 4"},
           Case{[](System<>& s) { s.mass(0, 2) = 3e-10; }, ""},  // rounding
           Case{[](System<>& s) { s.mass(0, 2) = 5e-10; },
                "mass: is not symmetric: entry (1,3) is 5e-10, entry (3,1) is 0"},
           Case{[](System<>& s) { s.mass(2, 2) = -1; }, "mass: is not positive definite"},
           Case{[](System<>& s) { s.mass.setOnes(); }, "mass: is not positive definite"},
           Case{[](System<>& s) { s.mass.setZero(); }, "mass: is not positive definite"},
           Case{[](System<>& s) { s.stiffness_factor = MatrixXd::Zero(2, 4); },
                "stiffness_factor: is 2 x 4, expected 2 x 3"},
           Case{[](System<>& s) { s.damping_low.resize(0, 0); },
                "damping_low: is 0 x 0, expected 3 x 3"},
           Case{[](System<>& s) { s.stiffness_low(0, 1) = kNan; },
                "stiffness_low: entry (1,2) is not a finite number"},
           Case{[](System<>& s) { s.mass_error = MatrixXd::Zero(2, 3); },
                "mass_error: is 2 x 3, expected 3 x 3"},
           Case{[](System<>& s) { s.mass_error = MatrixXd::Constant(3, 3, kInfinity); }, ""},
           Case{[](System<>& s) {
                  s.stiffness_error = MatrixXd::Zero(3, 3);
                  s.stiffness_error(1, 2) = -1e-300;
                },
                "stiffness_error: entry (2,3) is negative or not a number"},
           Case{[](System<>& s) { s.damping_error = MatrixXd::Constant(3, 3, kNan); },
                "damping_error: entry (1,1) is negative or not a number"},
       }) {
    SCOPED_TRACE(c.refusal);
    System<> system = proper_system();
    if (std::string(c.refusal).find("_low") != std::string::npos) {
      system.has_low_words = true;
      system.damping_low = system.stiffness_low = MatrixXd::Zero(3, 3);
      EXPECT_EQ(refusal(system), "");
    }
    c.change(system);
    EXPECT_EQ(refusal(system), c.refusal);
  }
}

TEST(ElasticForm, RefusesWhatOverflowsInItsCoordinates) {
  System<> system(1);
  system.mass << 1e-10;
  system.stiffness_factor = MatrixXd::Ones(1, 1);
  ElasticForm<> form;
  EXPECT_EQ(to_elastic_form(system, form), Status::kOk);
  system.damping << 1e300;
  EXPECT_EQ(to_elastic_form(system, form), Status::kNotFinite);
  system.damping << 0;
  system.stiffness_factor *= 1e305;
  EXPECT_EQ(to_elastic_form(system, form), Status::kNotFinite);
}

TEST(ModeList, BeginsEmpty) {
  EXPECT_TRUE(ModeList<kDynamic>().empty());
  EXPECT_TRUE(ModeList<kMaxDof>().empty());
}

}  // namespace
}  // namespace dashpot::analysis
