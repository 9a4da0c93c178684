#include <dashpot/analysis/tracker/step_prediction.hpp>

#include <algorithm>

namespace dashpot::analysis {
namespace {

/// Squared error of an extrapolation, relative to that of a simpler one, that makes it worth using.
constexpr double kForeseen = 0.25;

std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

}  // namespace

void StepPrediction::learn(const PackedMatrix& step, int rows) noexcept {
  const int size = rows * step.width;
  for (PackedMatrix* known : {&next_, &step_, &change_, &curve_}) known->width = step.width;
  Vec4d by_nothing{}, by_step{}, by_change{}, by_curve{};
  for (int k = 0; k < size; k += 4) {
    const Vec4d now = load(&step.items[at(k)]);
    const Vec4d change = now - load(&step_.items[at(k)]);
    const Vec4d curve = change - load(&change_.items[at(k)]);
    const Vec4d rest = curve - load(&curve_.items[at(k)]);
    by_nothing += now * now;
    by_step += change * change;
    by_change += curve * curve;
    by_curve += rest * rest;
    store(&step_.items[at(k)], now);
    store(&change_.items[at(k)], change);
    store(&curve_.items[at(k)], curve);
  }
  const double none = sum(by_nothing), first = sum(by_step), second = sum(by_change),
               third = sum(by_curve);
  ready_ = std::min({first, second, third}) < kForeseen * none;
  if (!ready_) return;
  const double change = std::min(second, third) < kForeseen * first ? 1 : 0;
  const double curve = change != 0 && third < kForeseen * second ? 1 : 0;
  for (int k = 0; k < size; k += 4) {
    store(&next_.items[at(k)], load(&step_.items[at(k)]) + change * load(&change_.items[at(k)]) +
                                   curve * load(&curve_.items[at(k)]));
  }
}

void StepPrediction::forget(int width, int rows) noexcept {
  for (PackedMatrix* known : {&step_, &change_, &curve_}) set_zero(width, rows, *known);
  ready_ = false;
}

}  // namespace dashpot::analysis
