#include <dashpot/identification/model/decay_data.hpp>
#include <dashpot/identification/records/common.hpp>

#include <algorithm>
#include <cmath>
#include <map>

namespace dashpot::identification {

std::array<Complex, 2> DecayFactor::eigenvalues() const {
  if (!pair) return {first, first};
  const double w = std::exp(first), a = second * w;
  const double D = w * w * (1 - second * second);
  if (D >= 0) return {Complex(-a, std::sqrt(D)), Complex(-a, -std::sqrt(D))};
  const double far = -(a + std::copysign(std::sqrt(-D), a));
  return {far, w * w / far};
}

DecayFactor DecayFactor::of_pair(Complex eigenvalue) {
  const double w = modulus(eigenvalue);
  return {true, std::log(w), -eigenvalue.real() / w};
}

DecayFactor DecayFactor::one_of_pair(double eigenvalue) const {
  DecayFactor one = of_single(eigenvalue);
  one.reference = reference;
  for (const auto& [same, rate] : scale) {
    one.scale.push_back({same + rate * eigenvalue / std::exp(first), 0});
  }
  return one;
}

DecayData::DecayData(const std::vector<MotionRecord>& all,
                     const std::shared_ptr<const std::vector<DrivenGrid>>& driven)
    : channels(all.front().output.rows()),
      records(all.size()),
      inputs(driven ? static_cast<std::size_t>(driven->front().input.rows()) : 0) {
  std::map<std::vector<bool>, std::vector<Index>> alike;  // channels with the same samples
  for (Index c = 0; c < channels; ++c) {
    std::vector<bool> there;
    for (const MotionRecord& record : all) {
      for (const double y : record.output.row(c)) there.push_back(std::isfinite(y));
    }
    alike[std::move(there)].push_back(c);
  }
  for (const auto& [there, members] : alike) {
    DecayPart part{
        {},
        MatrixXd(std::count(there.begin(), there.end(), true), static_cast<Index>(members.size())),
        members};
    part.driven = driven;
    Index row = 0;
    std::size_t sample = 0;
    for (const MotionRecord& record : all) {
      std::vector<double> times;
      std::vector<Index> cells;
      for (Index i = 0; i < record.time.size(); ++i) {
        if (!there[sample++]) continue;
        times.push_back(record.time[i] - record.time[0]);
        cells.push_back(i);
        for (std::size_t c = 0; c < members.size(); ++c) {
          part.output(row, static_cast<Index>(c)) = record.output(members[c], i);
        }
        ++row;
      }
      part.time.emplace_back(VectorXd::Map(times.data(), static_cast<Index>(times.size())));
      if (driven) part.cells.push_back(std::move(cells));
    }
    parts.push_back(std::move(part));
  }
  motion.setZero(channels);
  rounding.setZero(channels);
  for (const DecayPart& part : parts) {
    for (std::size_t c = 0; c < part.channels.size(); ++c) {
      const auto y = part.output.col(static_cast<Index>(c));
      const double mean = y.mean();
      motion[part.channels[c]] = std::sqrt((y.array() - mean).square().mean());
    }
  }
}

double DecayData::least_noise(Index channel) const {
  return std::max({kLinear * motion[channel], rounding[channel], kTiny});
}

}  // namespace dashpot::identification
