#include <dashpot/identification/model/variable_projection.hpp>
#include <dashpot/identification/records/common.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::identification {

VariableProjection::VariableProjection(const DecayData& data,
                                       const std::vector<DecayFactor>& factors,
                                       const VectorXd& noise, const VectorXd& record_noise)
    : squares(MatrixXd::Zero(data.channels, static_cast<Index>(data.records))),
      count(squares),
      data_(&data),
      factors_(factors),
      products_(products_of(factors)) {
  const auto sources = static_cast<Index>(data.sources() + (data.drifts() ? data.records : 0));
  amplitudes.setZero(factor_width(factors) + sources + product_width(products_), data.channels);
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
    MatrixXd all = MatrixXd::Zero(J.motions(), J.shapes.cols());
    for (std::size_t r = 0; r < data_->records; ++r) {
      all += sums(J, fitted_[k], r, 0, J.of_record[r].rows());
    }
    gradient += scores(J, all).rowwise().sum();
    // Sums over the samples before those over the channels.
    const MatrixXd products = VariableProjection::products(J);
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
    const Index N = J.basis.rows();
    const Index length = std::max<Index>(1, N / (kStretches * static_cast<Index>(data_->records)));
    for (std::size_t r = 0; r < data_->records; ++r) {
      const Index rows = J.of_record[r].rows();
      for (Index at = 0; at < rows; at += length) {
        const MatrixXd part = sums(J, fitted_[k], r, at, std::min(length, rows - at));
        sum += factor.matrixL().solve(scores(J, part)).squaredNorm();
      }
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
  const Index eigen = at, constants = static_cast<Index>(part.time.size());
  basis.middleCols(at, part.inputs()) = direct_columns(part);
  at += part.inputs();
  const Index products = product_width(products_);
  basis.middleCols(at, products) = product_columns(products_, part);
  basis.conservativeResize(Eigen::NoChange, at + products);
  MatrixXd plain = basis, output = part.output;
  take_constants(part, basis);
  take_constants(part, output);
  VectorXd weight(N);
  Index from = 0;
  for (std::size_t r = 0; r < part.time.size(); ++r) {
    const Index n = part.time[r].size();
    weight.segment(from, n).setConstant(1 / record_noise[static_cast<Index>(r)]);
    from += n;
  }
  basis = weight.asDiagonal() * basis;
  output = weight.asDiagonal() * output;
  // Scaled, so that columns of very different size, such as of a fast decay, do not look deficient.
  const VectorXd size = basis.colwise().norm().transpose().cwiseMax(kTiny);
  basis *= size.cwiseInverse().asDiagonal();
  Fitted fitted{Eigen::ColPivHouseholderQR<MatrixXd>(basis), std::move(weight), {}, {}};
  const auto& qr = fitted.qr;
  fitted.amplitude = size.cwiseInverse().asDiagonal() * qr.solve(output);
  plain = part.output - plain * fitted.amplitude;  // and of this the constants
  MatrixXd& residual = fitted.residual;
  residual = qr.householderQ().transpose() * output;
  residual.topRows(qr.rank()).setZero();
  residual.applyOnTheLeft(qr.householderQ());
  for (Index c = 0; c < channels; ++c) {
    const Index channel = part.channels[static_cast<std::size_t>(c)];
    amplitudes.col(channel).head(eigen) = fitted.amplitude.col(c).head(eigen);
    amplitudes.col(channel).segment(eigen + constants, at + products - eigen) =
        fitted.amplitude.col(c).tail(at + products - eigen);
    from = 0;
    for (std::size_t k = 0; k < part.time.size(); ++k) {
      const auto record = static_cast<Index>(k);
      const Index n = part.time[k].size();
      if (n > 0) amplitudes(eigen + record, channel) = plain.col(c).segment(from, n).mean();
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
  const std::size_t records = part.time.size();
  const Index most = std::min<Index>(2, channels) * factor_width(factors_);
  Jacobian J;
  J.first_row.push_back(0);
  for (const VectorXd& time : part.time) J.first_row.push_back(J.first_row.back() + time.size());
  J.everywhere.resize(N, most * (1 + part.inputs()));
  J.shapes.resize(most, channels);
  for (const VectorXd& time : part.time) J.of_record.emplace_back(time.size(), most);
  std::vector<Index> used(records + 1);  // motions, `everywhere` last
  std::vector<std::size_t> home;         // of each parameter's motions, among `used`
  Index column = 0, shape = 0;
  for (const DecayFactor& factor : factors_) {
    const Index width = factor.parameters(), rank = std::min(width, channels);
    // Large amplitudes of the two columns of a pair cancel here.
    const Eigen::HouseholderQR<MatrixXd> qr(fitted.amplitude.middleRows(column, width).transpose());
    const MatrixXd amplitude =
        MatrixXd(qr.matrixQR().topRows(rank).triangularView<Eigen::Upper>()).transpose();
    J.shapes.middleRows(shape, rank) =
        MatrixXd(qr.householderQ() * MatrixXd::Identity(channels, rank)).transpose();
    const auto add = [&](std::size_t where, const auto& derivative, auto& motions) {
      motions.middleCols(used[where], rank).noalias() = derivative * amplitude;
      J.parameters.push_back({shape, used[where], rank});
      home.push_back(where);
      used[where] += rank;
    };
    const FactorColumns columns = columns_of(factor, part, true);
    for (const MatrixXd& derivative : columns.by_eigenvalue) add(records, derivative, J.everywhere);
    for (std::size_t s = 0; s < data_->sources(); ++s) {
      if (s == factor.reference) continue;
      for (std::size_t i = 0; i < static_cast<std::size_t>(width); ++i) {
        if (s < records) {
          add(s, columns.by_record_scale[i].middleRows(J.first_row[s], part.time[s].size()),
              J.of_record[s]);
        } else {
          add(records, columns.by_input_scale[s - records][i], J.everywhere);
        }
      }
    }
    column += width;
    shape += rank;
  }
  J.shapes.conservativeResize(shape, channels);
  J.everywhere.conservativeResize(N, used.back());
  take_constants(part, J.everywhere);
  J.everywhere = fitted.weight.asDiagonal() * J.everywhere;
  J.basis = fitted.qr.householderQ() * MatrixXd::Identity(N, fitted.qr.rank());
  J.first.push_back(used.back());
  for (std::size_t r = 0; r < records; ++r) {
    MatrixXd& motions = J.of_record[r];
    motions.conservativeResize(Eigen::NoChange, used[r]);
    DecayPart alone{{part.time[r]}, {}, {}, part.drifts};
    take_constants(alone, motions);
    if (motions.rows() > 0) motions *= fitted.weight[J.first_row[r]];
    J.first.push_back(J.first.back() + used[r]);
  }
  for (std::size_t i = 0; i < home.size(); ++i) {
    if (home[i] < records) J.parameters[i].motion += J.first[home[i]];
  }
  J.on_basis.resize(J.basis.cols(), J.motions());
  J.on_basis.leftCols(used.back()).setZero();  // taken away at once, for the digits
  J.everywhere -= J.basis * (J.basis.transpose() * J.everywhere);
  for (std::size_t r = 0; r < records; ++r) {
    const MatrixXd& motions = J.of_record[r];
    J.on_basis.middleCols(J.first[r], used[r]).noalias() =
        J.basis.middleRows(J.first_row[r], motions.rows()).transpose() * motions;
  }
  return J;
}

MatrixXd VariableProjection::sums(const Jacobian& J, const Fitted& fitted, std::size_t record,
                                  Index from, Index count) {
  const Index row = J.first_row[record] + from;
  const auto rest = fitted.residual.middleRows(row, count);
  const MatrixXd& own = J.of_record[record];
  MatrixXd result =
      -J.on_basis.transpose() * MatrixXd(J.basis.middleRows(row, count).transpose() * rest);
  result.topRows(J.everywhere.cols()) += J.everywhere.middleRows(row, count).transpose() * rest;
  result.middleRows(J.first[record], own.cols()) += own.middleRows(from, count).transpose() * rest;
  return result;
}

/// J'J over the samples, motions x motions.
MatrixXd VariableProjection::products(const Jacobian& J) {
  MatrixXd result = MatrixXd::Zero(J.motions(), J.motions());
  const Index dense = J.everywhere.cols();
  result.topLeftCorner(dense, dense).noalias() = J.everywhere.transpose() * J.everywhere;
  for (std::size_t r = 0; r < J.of_record.size(); ++r) {
    const MatrixXd& own = J.of_record[r];
    const MatrixXd both = J.everywhere.middleRows(J.first_row[r], own.rows()).transpose() * own;
    result.block(0, J.first[r], dense, own.cols()) = both;
    result.block(J.first[r], 0, own.cols(), dense) = both.transpose();
    result.block(J.first[r], J.first[r], own.cols(), own.cols()).noalias() = own.transpose() * own;
  }
  result.noalias() -= J.on_basis.transpose() * J.on_basis;
  return result;
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

}  // namespace dashpot::identification
