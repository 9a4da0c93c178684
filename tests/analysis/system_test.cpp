// What validate() accepts, and the words in which it refuses the rest.
#include <dashpot/analysis/elastic_form.hpp>
#include <dashpot/analysis/mode.hpp>
#include <dashpot/analysis/system.hpp>

#include <gtest/gtest.h>

#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;

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

TEST(Validate, AcceptsProperSystems) {
  EXPECT_EQ(refusal(proper_system()), "");
  EXPECT_EQ(refusal(System<>(1)), "");
}

TEST(Validate, AcceptsASystemWithoutCoordinates) {
  EXPECT_EQ(refusal(System<>(0)), "");
}

TEST(Validate, AcceptsDampingAndStiffnessOfAnyKind) {
  System<> system = proper_system();
  system.damping << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  system.stiffness = -system.damping;
  EXPECT_EQ(refusal(system), "");
}

TEST(Validate, NamesTheMatrixOfWrongSize) {
  System<> system = proper_system();
  system.mass = MatrixXd::Identity(3, 2);
  EXPECT_EQ(refusal(system), "mass: is 3 x 2, expected 3 x 3");
  system = proper_system();
  system.damping = MatrixXd::Zero(2, 3);
  EXPECT_EQ(refusal(system), "damping: is 2 x 3, expected 3 x 3");
  system = proper_system();
  system.stiffness = MatrixXd::Zero(4, 4);
  EXPECT_EQ(refusal(system), "stiffness: is 4 x 4, expected 3 x 3");
}

TEST(Validate, NamesTheEntryThatIsNotFinite) {
  System<> system = proper_system();
  system.damping(1, 2) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refusal(system), "damping: entry (2,3) is not a finite number");
  system = proper_system();
  system.stiffness(2, 0) = -std::numeric_limits<double>::infinity();
  EXPECT_EQ(refusal(system), "stiffness: entry (3,1) is not a finite number");
  system = proper_system();
  system.mass(0, 0) = std::numeric_limits<double>::infinity();
  EXPECT_EQ(refusal(system), "mass: entry (1,1) is not a finite number");
}

TEST(Validate, NamesTheEntriesOfAnUnsymmetricMass) {
  System<> system = proper_system();
  system.mass(0, 1) = 3;
  system.mass(1, 0) = 4;
  EXPECT_EQ(refusal(system), "mass: is not symmetric: entry (1,2) is 3, entry (2,1) is 4");
}

TEST(Validate, AllowsRoundingInTheSymmetryOfTheMass) {
  System<> system = proper_system();
  system.mass(0, 2) = 3e-10;
  EXPECT_EQ(refusal(system), "");
  system.mass(0, 2) = 5e-10;
  EXPECT_EQ(refusal(system), "mass: is not symmetric: entry (1,3) is 5e-10, entry (3,1) is 0");
}

TEST(Validate, RefusesAMassThatIsNotPositiveDefinite) {
  System<> system = proper_system();
  system.mass(2, 2) = -1;
  EXPECT_EQ(refusal(system), "mass: is not positive definite");
  system.mass = MatrixXd::Ones(3, 3);
  EXPECT_EQ(refusal(system), "mass: is not positive definite");
  system.mass = MatrixXd::Zero(3, 3);
  EXPECT_EQ(refusal(system), "mass: is not positive definite");
}

TEST(Validate, ChecksTheOptionalParts) {
  System<> system = proper_system();
  system.stiffness_factor = MatrixXd::Zero(2, 4);
  EXPECT_EQ(refusal(system), "stiffness_factor: is 2 x 4, expected 2 x 3");
  system = proper_system();
  system.has_low_words = true;
  EXPECT_EQ(refusal(system), "damping_low: is 0 x 0, expected 3 x 3");
  system.damping_low = system.stiffness_low = MatrixXd::Zero(3, 3);
  EXPECT_EQ(refusal(system), "");
  system.mass_error = MatrixXd::Zero(2, 3);
  EXPECT_EQ(refusal(system), "mass_error: is 2 x 3, expected 3 x 3");
  system.mass_error = MatrixXd::Constant(3, 3, std::numeric_limits<double>::infinity());
  EXPECT_EQ(refusal(system), "");
  system.stiffness_error = system.damping_error = MatrixXd::Zero(3, 3);
  system.stiffness_error(1, 2) = -1e-300;
  EXPECT_EQ(refusal(system), "stiffness_error: entry (2,3) is negative or not a number");
  system.damping_error(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refusal(system), "damping_error: entry (1,1) is negative or not a number");
  system.damping_error.resize(0, 0);
  system.stiffness_error.resize(0, 0);
  system.stiffness_low(0, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refusal(system), "stiffness_low: entry (1,2) is not a finite number");
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
