#pragma once
#include <dashpot/analysis/types.hpp>

#include <array>
#include <limits>

namespace dashpot::analysis {

/// score(i, j) of giving place j to item i
using Scores = std::array<std::array<double, kMaxDof>, kMaxDof>;

/// Returns the place of each of `count` items, one to one, with the largest sum of scores
/// (Hungarian method, shortest augmenting paths; at most count^3 steps). Scores are finite.
inline std::array<int, kMaxDof> assign(const Scores& score, int count) noexcept {
  constexpr std::size_t kSize = kMaxDof + 1;
  // Items and places count from 1; place 0 holds the item that is being placed.
  std::array<double, kSize> item_price{}, place_price{};
  std::array<std::size_t, kSize> item_of{}, previous{};
  const auto n = static_cast<std::size_t>(count);
  for (std::size_t item = 1; item <= n; ++item) {
    std::array<double, kSize> slack;
    slack.fill(std::numeric_limits<double>::infinity());
    std::array<bool, kSize> visited{};
    std::size_t place = 0;
    item_of[0] = item;
    do {
      visited[place] = true;
      const std::size_t current = item_of[place];
      double step = std::numeric_limits<double>::infinity();
      std::size_t next = 0;
      for (std::size_t j = 1; j <= n; ++j) {
        if (visited[j]) continue;
        const double reduced = -score[current - 1][j - 1] - item_price[current] - place_price[j];
        if (reduced < slack[j]) {
          slack[j] = reduced;
          previous[j] = place;
        }
        if (next == 0 || slack[j] < step) {
          step = slack[j];
          next = j;
        }
      }
      for (std::size_t j = 0; j <= n; ++j) {
        if (visited[j]) {
          item_price[item_of[j]] += step;
          place_price[j] -= step;
        } else {
          slack[j] -= step;
        }
      }
      place = next;
    } while (item_of[place] != 0);
    while (place != 0) {
      item_of[place] = item_of[previous[place]];
      place = previous[place];
    }
  }
  std::array<int, kMaxDof> places{};
  for (std::size_t j = 1; j <= n; ++j) places[item_of[j] - 1] = static_cast<int>(j) - 1;
  return places;
}

}  // namespace dashpot::analysis
