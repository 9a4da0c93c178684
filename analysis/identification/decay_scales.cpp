#include <dashpot/analysis/identification/decay_columns.hpp>
#include <dashpot/analysis/identification/decay_scales.hpp>

#include <Eigen/QR>
#include <algorithm>

namespace dashpot::analysis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void find_scales(const DecayData& data, const VectorXd& noise, std::vector<DecayFactor>& factors) {
  const bool known = std::all_of(
      factors.begin(), factors.end(),
      [&data](const DecayFactor& factor) { return factor.scale.size() == data.records; });
  if (known) return;
  for (DecayFactor& factor : factors) factor.scale.assign(data.records, {1, 0});
  if (data.records == 1) return;
  const Index eigen = factor_width(factors);
  std::vector<MatrixXd> amplitudes(data.records, MatrixXd::Zero(eigen, data.channels));
  for (const DecayPart& part : data.parts) {
    Index from = 0;
    for (std::size_t r = 0; r < data.records; ++r) {
      const Index N = part.time[r].size();
      MatrixXd basis(N, eigen + 1);
      DecayPart alone{{part.time[r]}, part.output.middleRows(from, N), part.channels};
      from += N;
      if (N == 0) continue;
      Index at = 0;
      for (DecayFactor factor : factors) {
        factor.scale = {{1, 0}};
        factor.reference = 0;
        basis.middleCols(at, factor.parameters()) = columns_of(factor, alone, false).value;
        at += factor.parameters();
      }
      basis.col(at).setOnes();
      const VectorXd size = basis.colwise().norm().transpose().cwiseMax(1e-300);
      basis *= size.cwiseInverse().asDiagonal();
      const MatrixXd all =
          size.cwiseInverse().asDiagonal() * basis.colPivHouseholderQr().solve(alone.output);
      for (std::size_t c = 0; c < part.channels.size(); ++c) {
        amplitudes[r].col(part.channels[c]) =
            all.col(static_cast<Index>(c)).head(eigen) / noise[part.channels[c]];
      }
    }
  }
  Index at = 0;
  for (DecayFactor& factor : factors) {
    const int width = factor.parameters();
    const auto of = [&](std::size_t r) { return amplitudes[r].middleRows(at, width); };
    for (std::size_t r = 0; r < data.records; ++r) {
      if (of(r).norm() > of(factor.reference).norm()) factor.reference = r;
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
    for (std::size_t r = 0; r < data.records; ++r) {
      if (r == factor.reference) continue;
      const MatrixXd wanted = of(r);
      const VectorXd scale = qr.solve(wanted.reshaped());
      factor.scale[r] = {scale[0], factor.pair ? scale[1] : 0};
    }
    at += width;
  }
}

}  // namespace dashpot::analysis
