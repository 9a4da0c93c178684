#include <dashpot/identification/model/decay_columns.hpp>
#include <dashpot/identification/records/common.hpp>

#include <Eigen/QR>
#include <algorithm>

namespace dashpot::identification {

namespace {

/// A record's samples, which begin at a row, as a part of their own.
DecayPart record_of(const DecayPart& part, std::size_t record, Index row) {
  return {{part.time[record]},
          part.output.middleRows(row, part.time[record].size()),
          part.channels,
          part.drifts};
}

}  // namespace

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
  // The response of each factor to each source, by itself.
  const Index eigen = factor_width(factors);
  const auto blocks = static_cast<Index>(sources);
  std::vector<MatrixXd> amplitudes(sources, MatrixXd::Zero(eigen, data.channels));
  MatrixXd size = MatrixXd::Zero(eigen, blocks);  // squares of the columns
  for (const DecayPart& whole : data.parts) {
    // Without inputs each record stands for itself.
    const std::size_t groups = whole.inputs() > 0 ? 1 : data.records;
    Index row = 0;
    for (std::size_t g = 0; g < groups; ++g) {
      const DecayPart part = groups > 1 ? record_of(whole, g, row) : whole;
      const Index N = samples_of(part);
      row += N;
      if (N == 0) continue;
      const std::size_t here = groups > 1 ? 1 : sources;
      MatrixXd basis(N, eigen * static_cast<Index>(here) + part.inputs());
      Index at = 0;
      for (std::size_t s = 0; s < here; ++s) {
        for (DecayFactor factor : factors) {
          factor.has_products = false;
          factor.scale.assign(here, {0, 0});
          factor.scale[s] = {1, 0};
          factor.reference = s;
          basis.middleCols(at, factor.parameters()) = columns_of(factor, part, false).value;
          at += factor.parameters();
        }
      }
      basis.rightCols(part.inputs()) = direct_columns(part);
      MatrixXd output = part.output;
      take_constants(part, basis);
      take_constants(part, output);
      const VectorXd norm = basis.colwise().norm().transpose().cwiseMax(kTiny);
      basis *= norm.cwiseInverse().asDiagonal();
      const MatrixXd all =
          norm.cwiseInverse().asDiagonal() * basis.colPivHouseholderQr().solve(output);
      for (std::size_t s = 0; s < here; ++s) {
        const Index first = static_cast<Index>(s) * eigen;
        const std::size_t source = g + s;
        size.col(static_cast<Index>(source)) += norm.segment(first, eigen).cwiseAbs2();
        for (std::size_t c = 0; c < part.channels.size(); ++c) {
          amplitudes[source].col(part.channels[c]) =
              all.col(static_cast<Index>(c)).segment(first, eigen) / noise[part.channels[c]];
        }
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

}  // namespace dashpot::identification
