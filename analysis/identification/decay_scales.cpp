#include <dashpot/analysis/identification/decay_columns.hpp>
#include <dashpot/analysis/identification/decay_scales.hpp>

#include <Eigen/QR>
#include <algorithm>

namespace dashpot::analysis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void find_scales(const DecayData& data, const VectorXd& noise, std::vector<DecayFactor>& factors) {
  const std::size_t sources = data.sources();
  const bool known =
      std::all_of(factors.begin(), factors.end(),
                  [sources](const DecayFactor& factor) { return factor.scale.size() == sources; });
  if (known) return;
  if (sources == 1) {
    for (DecayFactor& factor : factors) factor.scale.assign(1, {1, 0});
    return;
  }
  // What each source makes of each factor, by itself.
  const Index eigen = factor_width(factors);
  const auto blocks = static_cast<Index>(sources);
  std::vector<MatrixXd> amplitudes(sources, MatrixXd::Zero(eigen, data.channels));
  MatrixXd size = MatrixXd::Zero(eigen, blocks);  // squares of the columns
  for (const DecayPart& part : data.parts) {
    const Index N = samples_of(part);
    MatrixXd basis = MatrixXd::Zero(N, eigen * blocks + blocks);
    Index at = 0;
    for (std::size_t s = 0; s < sources; ++s) {
      for (DecayFactor factor : factors) {
        factor.scale.assign(sources, {0, 0});
        factor.scale[s] = {1, 0};
        factor.reference = s;
        basis.middleCols(at, factor.parameters()) = columns_of(factor, part, false).value;
        at += factor.parameters();
      }
    }
    Index from = 0;
    for (const VectorXd& time : part.time) {
      basis.col(at++).segment(from, time.size()).setOnes();
      from += time.size();
    }
    basis.rightCols(part.inputs()) = direct_columns(part);
    const VectorXd norm = basis.colwise().norm().transpose().cwiseMax(1e-300);
    basis *= norm.cwiseInverse().asDiagonal();
    const MatrixXd all =
        norm.cwiseInverse().asDiagonal() * basis.colPivHouseholderQr().solve(part.output);
    for (std::size_t s = 0; s < sources; ++s) {
      const Index first = static_cast<Index>(s) * eigen;
      size.col(static_cast<Index>(s)) += norm.segment(first, eigen).cwiseAbs2();
      for (std::size_t c = 0; c < part.channels.size(); ++c) {
        amplitudes[s].col(part.channels[c]) =
            all.col(static_cast<Index>(c)).segment(first, eigen) / noise[part.channels[c]];
      }
    }
  }
  Index at = 0;
  for (DecayFactor& factor : factors) {
    const int width = factor.parameters();
    const auto of = [&](std::size_t s) { return amplitudes[s].middleRows(at, width); };
    const auto motion = [&](std::size_t s) {
      const auto squares = size.col(static_cast<Index>(s)).segment(at, width);
      return (squares.cwiseSqrt().asDiagonal() * of(s)).norm();
    };
    factor.scale.assign(sources, {1, 0});
    factor.reference = 0;
    for (std::size_t s = 1; s < sources; ++s) {
      if (motion(s) > motion(factor.reference)) factor.reference = s;
    }
    const MatrixXd reference = of(factor.reference);
    MatrixXd columns(reference.size(), width);
    columns.col(0) = reference.reshaped();
    if (factor.pair) {  // x' / omega for x = (c, w s) times the amplitudes
      const double zeta = factor.second;
      MatrixXd rate(2, reference.cols());
      rate.row(0) = -zeta * reference.row(0) + reference.row(1);
      rate.row(1) = -(1 - zeta * zeta) * reference.row(0) - zeta * reference.row(1);
      columns.col(1) = rate.reshaped();
    }
    const auto qr = columns.colPivHouseholderQr();
    for (std::size_t s = 0; s < sources; ++s) {
      if (s == factor.reference) continue;
      const MatrixXd wanted = of(s);
      const VectorXd scale = qr.solve(wanted.reshaped());
      factor.scale[s] = {scale[0], factor.pair ? scale[1] : 0};
    }
    at += width;
  }
}

}  // namespace dashpot::analysis
