#pragma once
#include <dashpot/identification/model/decay_columns.hpp>
#include <dashpot/identification/model/decay_data.hpp>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <vector>

namespace dashpot::identification {

/// The least-squares problem of a sum of decays whose amplitudes are eliminated, at some factors:
/// variable projection (Golub and Pereyra 1973) with Kaufman's Jacobian, in which the small
/// products of motions count as constant.
class VariableProjection {
 public:
  /// `noise` is each channel's, `record_noise` each record's, relative to it; standard deviations.
  VariableProjection(const DecayData& data, const std::vector<DecayFactor>& factors,
                     const Eigen::VectorXd& noise, const Eigen::VectorXd& record_noise);

  /// Finds `normal` and `gradient`.
  void differentiate();

  /// The sum over stretches of time and channels of s' N^-1 s, with N = `normal` = L L' and the
  /// part s of `gradient` from such a stretch.
  double squared_scores(const Eigen::LLT<Eigen::MatrixXd>& factor) const;

  /// J'J, weighted; parameters: of each factor the eigenvalues, then its scales.
  Eigen::MatrixXd normal;
  Eigen::VectorXd gradient;    ///< J'r, weighted
  double cost = 0;             ///< r'r, weighted
  Eigen::MatrixXd amplitudes;  ///< width x channels
  Eigen::MatrixXd squares;     ///< r'r of each channel and record, unweighted
  Eigen::MatrixXd count;       ///< samples of each channel and record

 private:
  /// What a parameter changes is the sum of `rank` motions from `motion`, each in the channels by
  /// its shape, from `shape`.
  struct Parameter {
    Eigen::Index shape, motion, rank;
  };
  /// J of a part. The motions by eigenvalues and inputs, in all records, come first; then each
  /// record's motions by its scales, in its rows alone.
  struct Jacobian {
    std::vector<Parameter> parameters;
    Eigen::MatrixXd everywhere;              ///< samples x motions
    std::vector<Eigen::MatrixXd> of_record;  ///< samples of the record x motions
    std::vector<Eigen::Index> first;         ///< row and motion of each record, and the end
    std::vector<Eigen::Index> first_row;
    Eigen::MatrixXd shapes;    ///< shapes x channels, a factor's shapes orthonormal
    Eigen::MatrixXd basis;     ///< Q, samples x rank: the span of the amplitudes
    Eigen::MatrixXd on_basis;  ///< Q' J, rank x motions

    Eigen::Index motions() const { return first.back(); }
  };
  /// The weighted fit of a part.
  struct Fitted {
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;  ///< of the model's columns
    Eigen::VectorXd weight;                          ///< of each sample, of its record
    Eigen::MatrixXd residual;                        ///< samples x channels
    Eigen::MatrixXd amplitude;                       ///< columns of the factors x channels
  };

  Fitted fit(const DecayPart& part, const Eigen::VectorXd& noise,
             const Eigen::VectorXd& record_noise);
  Jacobian jacobian(const DecayPart& part, const Fitted& fitted) const;
  /// motions x channels: sums over rows from `from` of a record, of J times the residual.
  static Eigen::MatrixXd sums(const Jacobian& jacobian, const Fitted& fitted, std::size_t record,
                              Eigen::Index from, Eigen::Index count);
  static Eigen::MatrixXd products(const Jacobian& jacobian);
  static Eigen::MatrixXd scores(const Jacobian& jacobian, const Eigen::MatrixXd& sums);

  const DecayData* data_;
  std::vector<DecayFactor> factors_;
  std::vector<MotionProduct> products_;
  std::vector<Fitted> fitted_;  ///< of each part
};

}  // namespace dashpot::identification
