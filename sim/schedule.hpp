#pragma once
#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

namespace dashpot::sim {

/// A value that acts from `begin` until just before `end`, s.
template <class Value>
struct Piece {
  double begin = 0;
  double end = 0;
  Value value;
};

/// A sum of pieces, as a function of time that is constant between its edges. If empty, it is
/// always zero.
template <class Value>
class Schedule {
 public:
  Schedule() = default;
  /// `zero` is the value where no piece acts. Pieces may overlap.
  Schedule(const std::vector<Piece<Value>>& pieces, const Value& zero) {
    for (const Piece<Value>& piece : pieces) {
      if (!(piece.begin < piece.end)) continue;  // never acts
      edges_.push_back(piece.begin);
      edges_.push_back(piece.end);
    }
    std::sort(edges_.begin(), edges_.end());
    edges_.erase(std::unique(edges_.begin(), edges_.end()), edges_.end());
    values_.assign(edges_.size() + 1, zero);
    for (const Piece<Value>& piece : pieces) {
      for (std::size_t i = 0; i < edges_.size(); ++i) {
        if (piece.begin <= edges_[i] && edges_[i] < piece.end) values_[i + 1] += piece.value;
      }
    }
  }

  bool empty() const noexcept { return edges_.empty(); }
  /// Returns the value from time t on, until next_edge(t).
  const Value& at(double t) const noexcept { return values_[edges_up_to(t)]; }
  /// Returns the first edge after t, s, or infinity if there is none.
  double next_edge(double t) const noexcept {
    const std::size_t i = edges_up_to(t);
    return i < edges_.size() ? edges_[i] : std::numeric_limits<double>::infinity();
  }

 private:
  std::size_t edges_up_to(double t) const noexcept {
    return static_cast<std::size_t>(std::upper_bound(edges_.begin(), edges_.end(), t) -
                                    edges_.begin());
  }

  std::vector<double> edges_;
  std::vector<Value> values_;  // values_[i] acts before edges_[i]
};

}  // namespace dashpot::sim
