// The Runge-Kutta method with an error estimate, and methods for stiff systems.
#include <dashpot/sim/integrator.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::sim {

/// E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, II.5 and II.10:
/// DOP853, whose error estimate combines one of order 5 with one of order 3.
Status Integrator::dormand_prince_8(System& system, double h) noexcept {
  auto& k = rates_;
  begin_step(system);
  stage_ = y_ + h * (5.26001519587677318785587544488e-2 * k[0]);
  system.rates(stage_, k[1]);
  stage_ = y_ + h * (1.97250569845378994544595329183e-2 * k[0] +
                     5.91751709536136983633785987549e-2 * k[1]);
  system.rates(stage_, k[2]);
  stage_ = y_ + h * (2.95875854768068491816892993775e-2 * k[0] +
                     8.87627564304205475450678981324e-2 * k[2]);
  system.rates(stage_, k[3]);
  stage_ = y_ + h * (2.41365134159266685502369798665e-1 * k[0] -
                     8.84549479328286085344864962717e-1 * k[2] +
                     9.24834003261792003115737966543e-1 * k[3]);
  system.rates(stage_, k[4]);
  stage_ = y_ + h * (1.0 / 27 * k[0] + 1.70828608729473871279604482173e-1 * k[3] +
                     1.25467687566822425016691814123e-1 * k[4]);
  system.rates(stage_, k[5]);
  stage_ = y_ + h * (3.7109375e-2 * k[0] + 1.70252211019544039314978060272e-1 * k[3] +
                     6.02165389804559606850219397283e-2 * k[4] - 1.7578125e-2 * k[5]);
  system.rates(stage_, k[6]);
  stage_ =
      y_ +
      h * (3.70920001185047927108779319836e-2 * k[0] + 1.70383925712239993810214054705e-1 * k[3] +
           1.07262030446373284651809199168e-1 * k[4] - 1.53194377486244017527936158236e-2 * k[5] +
           8.27378916381402288758473766002e-3 * k[6]);
  system.rates(stage_, k[7]);
  stage_ =
      y_ +
      h * (6.24110958716075717114429577812e-1 * k[0] - 3.36089262944694129406857109825 * k[3] -
           8.68219346841726006818189891453e-1 * k[4] + 2.75920996994467083049415600797e1 * k[5] +
           2.01540675504778934086186788979e1 * k[6] - 4.34898841810699588477366255144e1 * k[7]);
  system.rates(stage_, k[8]);
  stage_ =
      y_ +
      h * (4.77662536438264365890433908527e-1 * k[0] - 2.48811461997166764192642586468 * k[3] -
           5.90290826836842996371446475743e-1 * k[4] + 2.12300514481811942347288949897e1 * k[5] +
           1.52792336328824235832596922938e1 * k[6] - 3.32882109689848629194453265587e1 * k[7] -
           2.03312017085086261358222928593e-2 * k[8]);
  system.rates(stage_, k[9]);
  stage_ =
      y_ +
      h * (-9.3714243008598732571704021658e-1 * k[0] + 5.18637242884406370830023853209 * k[3] +
           1.09143734899672957818500254654 * k[4] - 8.14978701074692612513997267357 * k[5] -
           1.85200656599969598641566180701e1 * k[6] + 2.27394870993505042818970056734e1 * k[7] +
           2.49360555267965238987089396762 * k[8] - 3.0467644718982195003823669022 * k[9]);
  system.rates(stage_, k[10]);
  stage_ =
      y_ + h * (2.27331014751653820792359768449 * k[0] - 1.05344954667372501984066689879e1 * k[3] -
                2.00087205822486249909675718444 * k[4] - 1.79589318631187989172765950534e1 * k[5] +
                2.79488845294199600508499808837e1 * k[6] - 2.85899827713502369474065508674 * k[7] -
                8.87285693353062954433549289258 * k[8] + 1.23605671757943030647266201528e1 * k[9] +
                6.43392746015763530355970484046e-1 * k[10]);
  system.rates(stage_, k[11]);
  stage_ = 5.42937341165687622380535766363e-2 * k[0] + 4.45031289275240888144113950566 * k[5] +
           1.89151789931450038304281599044 * k[6] - 5.8012039600105847814672114227 * k[7] +
           3.1116436695781989440891606237e-1 * k[8] - 1.52160949662516078556178806805e-1 * k[9] +
           2.01365400804030348374776537501e-1 * k[10] + 4.47106157277725905176885569043e-2 * k[11];
  next_ = y_ + h * stage_;
  if (!options_.adaptive) return Status::kOk;
  stage_ -= 2.44094488188976377952755905512e-1 * k[0] + 7.33846688281611857341361741547e-1 * k[8] +
            2.20588235294117647058823529412e-2 * k[11];
  error_ = 1.312004499419488073250102996e-2 * k[0] - 1.225156446376204440720569753 * k[5] -
           4.957589496572501915214079952e-1 * k[6] + 1.664377182454986536961530415 * k[7] -
           3.503288487499736816886487290e-1 * k[8] + 3.341791187130174790297318841e-1 * k[9] +
           8.192320648511571246570742613e-2 * k[10] - 2.235530786388629525884427845e-2 * k[11];
  for (Eigen::Index i = 0; i < error_.size(); ++i) {
    const double fifth = std::abs(error_[i]), third = std::abs(stage_[i]);
    const double size = std::hypot(fifth, 0.1 * third);
    error_[i] = size > 0 ? h * fifth * fifth / size : size;
  }
  return Status::kOk;
}

/// y+ = 2 z - y with z = y + (h/2) f(z), by Newton's iteration with the Jacobian at y.
Status Integrator::implicit_midpoint(System& system, double h) noexcept {
  constexpr int kMaxIterations = 30;
  constexpr double kConverged = 1e-14;
  const Eigen::Index n = 2 * coordinates_of(y_);
  const double s = 2 / h;
  differentiate(system);
  if (!factor(s)) return Status::kStateNotFinite;
  StateVector& z = stage_;
  z = y_ + (h / 2) * rates_[0];
  double last_change = 0;
  for (int i = 0; i < kMaxIterations; ++i) {
    system.rates(z, rates_[1]);
    error_ = rates_[1] - s * (z - y_);
    solve(s, error_);
    z += error_;
    const double size = z.head(n).cwiseAbs().maxCoeff() + y_.head(n).cwiseAbs().maxCoeff();
    const double change = error_.head(n).cwiseAbs().maxCoeff();
    if (!std::isfinite(change)) return Status::kStateNotFinite;
    // Done, or as close as rounding lets it come.
    if (change <= kConverged * size || (i > 3 && change <= 1e-9 * size && change >= last_change)) {
      next_ = 2 * z - y_;
      return Status::kOk;
    }
    last_change = change;
  }
  return Status::kNotConverged;
}

/// A. Sandu et al., Atmospheric Environment 31 (1997), RODAS3, in the form of E. Hairer, G. Wanner,
/// Solving Ordinary Differential Equations II, IV.7: (1/(h gamma) - J) k_i = f(stage) + sum c k /
/// h.
Status Integrator::rosenbrock(System& system, double h) noexcept {
  const double s = 2 / h;  // gamma = 1/2
  differentiate(system);
  if (!factor(s)) return Status::kStateNotFinite;
  StateVector &k1 = rates_[1], &k2 = rates_[2], &k3 = rates_[3], &k4 = rates_[4];
  k1 = rates_[0];
  solve(s, k1);
  k2 = rates_[0] + (4 / h) * k1;
  solve(s, k2);
  stage_ = y_ + 2 * k1;
  system.rates(stage_, k3);
  k3 += (1 / h) * (k1 - k2);
  solve(s, k3);
  stage_ += k3;
  system.rates(stage_, k4);
  k4 += (1 / h) * (k1 - k2 - (8.0 / 3) * k3);
  solve(s, k4);
  next_ = stage_ + k4;
  error_ = k4;
  return Status::kOk;
}

void Integrator::differentiate(System& system) noexcept {
  constexpr double kStep = 1.5e-8;  // sqrt of the rounding unit
  const Eigen::Index n = coordinates_of(y_), rows = n + kWorkChannels;
  begin_step(system);
  if (jacobian_known_) return;
  jacobian_known_ = true;
  jacobian_.resize(rows, 2 * n);
  stage_ = y_;
  for (Eigen::Index j = 0; j < 2 * n; ++j) {
    const double moved = y_[j] + kStep * std::max(1.0, std::abs(y_[j]));
    stage_[j] = moved;
    system.rates(stage_, rates_[1]);
    jacobian_.col(j) = (rates_[1].tail(rows) - rates_[0].tail(rows)) / (moved - y_[j]);
    stage_[j] = y_[j];
  }
}

bool Integrator::factor(double s) noexcept {
  const Eigen::Index n = coordinates_of(y_);
  reduced_ = -jacobian_.topRightCorner(n, n) - (1 / s) * jacobian_.topLeftCorner(n, n);
  reduced_.diagonal().array() += s;
  if (!reduced_.allFinite()) return false;
  factors_.compute(reduced_);
  return true;
}

/// With J = [0 1 0; A B 0; D E 0] and x = (a, b, c): (s - B - A/s) v = b + A a / s, then
/// q = (a + v) / s, w = (c + D q + E v) / s.
void Integrator::solve(double s, StateVector& x) const noexcept {
  const Eigen::Index n = coordinates_of(y_);
  JointVector v = x.segment(n, n);
  v.noalias() += jacobian_.topLeftCorner(n, n).lazyProduct(x.head(n) / s);
  v = factors_.solve(v);
  x.head(n) = (x.head(n) + v) / s;
  x.segment(n, n) = v;
  x.tail<kWorkChannels>() += jacobian_.bottomRows<kWorkChannels>().lazyProduct(x.head(2 * n));
  x.tail<kWorkChannels>() /= s;
}

}  // namespace dashpot::sim
