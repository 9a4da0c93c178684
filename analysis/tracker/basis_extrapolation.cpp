#include <dashpot/analysis/tracker/basis_extrapolation.hpp>

#include <dashpot/analysis/base/arithmetic.hpp>

namespace dashpot::analysis {
namespace {

/// Squared error of an extrapolation, relative to a simpler one, that makes it worth using.
constexpr double kForeseen = 0.25;

}  // namespace

void BasisExtrapolation::Side::apply(int rows, PackedMatrix& Z) noexcept {
  if (!begun_) {
    for (PackedMatrix* known : {&step_, &change_, &curve_}) set_zero(Z.width, rows, *known);
    copy(Z, rows, last_);
    begun_ = true;
    return;
  }
  const int size = rows * Z.width;
  Vec4d by_last{}, by_step{}, by_change{}, by_curve{};  // squared errors of each degree
  for (int k = 0; k < size; k += 4) {
    const Vec4d now = load(&Z.items[at(k)]);
    const Vec4d step = now - load(&last_.items[at(k)]);
    const Vec4d change = step - load(&step_.items[at(k)]);
    const Vec4d curve = change - load(&change_.items[at(k)]);
    const Vec4d rest = curve - load(&curve_.items[at(k)]);
    by_last += step * step;
    by_step += change * change;
    by_change += curve * curve;
    by_curve += rest * rest;
    store(&last_.items[at(k)], now);
    store(&step_.items[at(k)], step);
    store(&change_.items[at(k)], change);
    store(&curve_.items[at(k)], curve);
  }
  const double last = sum(by_last), first = sum(by_step), second = sum(by_change),
               third = sum(by_curve);
  const double least = second < third ? second : third;
  if (!(first < kForeseen * last || least < kForeseen * last)) return;
  const double change = least < kForeseen * first ? 1 : 0;
  const double curve = change != 0 && third < kForeseen * second ? 1 : 0;
  for (int k = 0; k < size; k += 4) {
    store(&Z.items[at(k)], load(&last_.items[at(k)]) + load(&step_.items[at(k)]) +
                               change * load(&change_.items[at(k)]) +
                               curve * load(&curve_.items[at(k)]));
  }
}

void BasisExtrapolation::apply(BlockEigenbasis& basis) noexcept {
  right_.apply(basis.columns(), basis.Z);
  if (basis.two_sided) left_.apply(basis.columns(), basis.Y);
}

void BasisExtrapolation::go_back(BlockEigenbasis& basis) noexcept {
  copy(right_.last(), basis.columns(), basis.Z);
  if (basis.two_sided) copy(left_.last(), basis.columns(), basis.Y);
  forget();
}

}  // namespace dashpot::analysis
