#include <dashpot/analysis/identification/variable_projection.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::analysis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

VariableProjection::VariableProjection(const DecayData& data,
                                       const std::vector<DecayFactor>& factors,
                                       const VectorXd& noise, const VectorXd& record_noise)
    : squares(MatrixXd::Zero(data.channels, static_cast<Index>(data.records))),
      count(squares),
      data_(&data),
      factors_(factors),
      products_(products_of(factors)) {
  amplitudes.setZero(
      factor_width(factors) + static_cast<Index>(data.sources()) + product_width(products_),
      data.channels);
  for (const DecayPart& part : data.parts) fitted_.push_back(fit(part, noise, record_noise));
  cost = (noise.cwiseInverse().asDiagonal() * squares * record_noise.cwiseInverse().asDiagonal())
             .cwiseQuotient(noise * record_noise.transpose())
             .sum();
}

void VariableProjection::differentiate() {
  const Index p = factor_width(factors_) * static_cast<Index>(data_->sources());
  normal.setZero(p, p);
  gradient.setZero(p);
  for (std::size_t k = 0; k < fitted_.size(); ++k) {
    const Jacobian J = jacobian(data_->parts[k], fitted_[k]);
    gradient += scores(J, J.motions.transpose() * fitted_[k].residual).rowwise().sum();
    // Sums over the samples before those over the channels.
    MatrixXd products = MatrixXd::Zero(J.motions.cols(), J.motions.cols());
    products.selfadjointView<Eigen::Lower>().rankUpdate(J.motions.transpose());
    products.triangularView<Eigen::StrictlyUpper>() = products.transpose();
    const MatrixXd alike = J.shapes * J.shapes.transpose();
    for (Index i = 0; i < p; ++i) {
      const Parameter& a = J.parameters[static_cast<std::size_t>(i)];
      for (Index j = 0; j <= i; ++j) {
        const Parameter& b = J.parameters[static_cast<std::size_t>(j)];
        normal(i, j) += alike.block(a.shape, b.shape, a.rank, b.rank)
                            .cwiseProduct(products.block(a.motion, b.motion, a.rank, b.rank))
                            .sum();
      }
    }
  }
  normal.triangularView<Eigen::StrictlyUpper>() = normal.transpose();
}

double VariableProjection::squared_scores(const Eigen::LLT<MatrixXd>& factor) const {
  constexpr Index kStretches = 40;
  double sum = 0;
  for (std::size_t k = 0; k < fitted_.size(); ++k) {
    const Jacobian J = jacobian(data_->parts[k], fitted_[k]);
    const Index N = J.motions.rows();
    const Index length = std::max<Index>(1, N / (kStretches * static_cast<Index>(data_->records)));
    for (Index at = 0; at < N; at += length) {
      const Index n = std::min(length, N - at);
      const MatrixXd sums =
          J.motions.middleRows(at, n).transpose() * fitted_[k].residual.middleRows(at, n);
      sum += factor.matrixL().solve(scores(J, sums)).squaredNorm();
    }
  }
  return sum;
}

/// Eliminates the amplitudes.
VariableProjection::Fitted VariableProjection::fit(const DecayPart& part, const VectorXd& noise,
                                                   const VectorXd& record_noise) {
  const Index N = samples_of(part), channels = part.output.cols(), width = amplitudes.rows();
  MatrixXd basis = MatrixXd::Zero(N, width);
  Index at = 0;
  for (const DecayFactor& factor : factors_) {
    basis.middleCols(at, factor.parameters()) = columns_of(factor, part, false).value;
    at += factor.parameters();
  }
  const Index eigen = at;
  VectorXd weight(N);
  Index from = 0;
  for (std::size_t r = 0; r < part.time.size(); ++r) {
    const Index n = part.time[r].size();
    basis.col(at++).segment(from, n).setOnes();
    weight.segment(from, n).setConstant(1 / record_noise[static_cast<Index>(r)]);
    from += n;
  }
  basis.middleCols(at, part.inputs()) = direct_columns(part);
  basis.rightCols(width - at - part.inputs()) = product_columns(products_, part);
  basis = weight.asDiagonal() * basis;
  const MatrixXd output = weight.asDiagonal() * part.output;
  // Columns of very different size, as those of a mode that is over at once, are no deficiency.
  const VectorXd size = basis.colwise().norm().transpose().cwiseMax(1e-300);
  basis *= size.cwiseInverse().asDiagonal();
  Fitted fitted{Eigen::ColPivHouseholderQR<MatrixXd>(basis), std::move(weight), {}, {}};
  const auto& qr = fitted.qr;
  fitted.amplitude = size.cwiseInverse().asDiagonal() * qr.solve(output);
  MatrixXd& residual = fitted.residual;
  residual = qr.householderQ().transpose() * output;
  residual.topRows(qr.rank()).setZero();
  residual.applyOnTheLeft(qr.householderQ());
  for (Index c = 0; c < channels; ++c) {
    const Index channel = part.channels[static_cast<std::size_t>(c)];
    amplitudes.col(channel) = fitted.amplitude.col(c);
    from = 0;
    for (std::size_t k = 0; k < part.time.size(); ++k) {
      const auto record = static_cast<Index>(k);
      const Index n = part.time[k].size();
      squares(channel, record) +=
          residual.col(c).segment(from, n).squaredNorm() * std::pow(record_noise[record], 2);
      count(channel, record) += static_cast<double>(n);
      from += n;
    }
    residual.col(c) /= noise[channel];
    fitted.amplitude.col(c) /= noise[channel];
  }
  fitted.amplitude.conservativeResize(eigen, channels);
  return fitted;
}

VariableProjection::Jacobian VariableProjection::jacobian(const DecayPart& part,
                                                          const Fitted& fitted) const {
  const Index N = samples_of(part), channels = fitted.residual.cols();
  const Index p = factor_width(factors_) * static_cast<Index>(data_->sources());
  Jacobian J;
  J.motions.resize(N, std::min<Index>(2, channels) * p);
  J.shapes.resize(J.motions.cols(), channels);
  Index column = 0, shape = 0, motion = 0;
  for (const DecayFactor& factor : factors_) {
    const Index width = factor.parameters(), rank = std::min(width, channels);
    // Where large amplitudes of the two columns of a pair cancel, they do so here.
    const Eigen::HouseholderQR<MatrixXd> qr(fitted.amplitude.middleRows(column, width).transpose());
    const MatrixXd amplitude =
        MatrixXd(qr.matrixQR().topRows(rank).triangularView<Eigen::Upper>()).transpose();
    J.shapes.middleRows(shape, rank) =
        MatrixXd(qr.householderQ() * MatrixXd::Identity(channels, rank)).transpose();
    for (const MatrixXd& derivative : columns_of(factor, part, true).derivative) {
      J.parameters.push_back({shape, motion, rank});
      J.motions.middleCols(motion, rank).noalias() =
          fitted.weight.asDiagonal() * derivative * amplitude;
      motion += rank;
    }
    column += width;
    shape += rank;
  }
  J.motions.conservativeResize(N, motion);
  J.shapes.conservativeResize(shape, channels);
  const MatrixXd Q = fitted.qr.householderQ() * MatrixXd::Identity(N, fitted.qr.rank());
  J.motions -= Q * (Q.transpose() * J.motions);
  return J;
}

/// Each parameter's part of `gradient`, x channels, from sums over samples, motions x channels.
MatrixXd VariableProjection::scores(const Jacobian& J, const MatrixXd& sums) {
  MatrixXd result(static_cast<Index>(J.parameters.size()), sums.cols());
  for (Index i = 0; i < result.rows(); ++i) {
    const auto& [shape, motion, rank] = J.parameters[static_cast<std::size_t>(i)];
    result.row(i) = J.shapes.middleRows(shape, rank)
                        .cwiseProduct(sums.middleRows(motion, rank))
                        .colwise()
                        .sum();
  }
  return result;
}

}  // namespace dashpot::analysis
