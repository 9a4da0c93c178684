#pragma once
#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/model/realization.hpp>
#include <dashpot/identification/records/steady_lines.hpp>

#include <vector>

namespace dashpot::identification {

/// |u' v|^2 / (|u|^2 |v|^2), the modal assurance criterion.
double likeness(const Eigen::VectorXcd& u, const Eigen::VectorXcd& v);

/// Returns the shape with unit length, its largest entry real and positive.
Eigen::VectorXcd turned(const Eigen::VectorXcd& shape);

/// A hum that was taken away, as a mode that is not believed.
MeasuredMode to_mode(const SteadyLine& hum);

/// The eigenvalues of models of rising order, from order 1, and whether each is stable.
std::vector<ModelPole> model_poles(const std::vector<std::vector<RealizedPole>>& by_order);

/// The share of the models of `order` eigenvalues and more that have this mode.
double stability_of(const MeasuredMode& mode,
                    const std::vector<std::vector<RealizedPole>>& by_order, int order);

/// The records that modes are judged by.
struct Judgement {
  double duration = 0, step = 0;  ///< s
  bool decays = false;            ///< the motion is free, and modes fade
};

/// Makes overdamped modes of single eigenvalues of like shapes, and sorts out what is not to be
/// believed, with reasons; those with a reason have one already.
void judge(std::vector<MeasuredMode> modes, const Judgement& records, Identification& result);

}  // namespace dashpot::identification
