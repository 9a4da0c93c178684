#include <dashpot/controller/audit.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::controller {
namespace {

constexpr double kNotFound = std::numeric_limits<double>::quiet_NaN();

using Numbers = std::vector<PostureNumbers>;

/// The indices of the postures that have a number, by rising number.
std::vector<std::int64_t> ranking(const Numbers& numbers, double PostureNumbers::*member) {
  std::vector<std::int64_t> order;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (!std::isnan(numbers[i].*member)) order.push_back(static_cast<std::int64_t>(i));
  }
  std::sort(order.begin(), order.end(), [&](std::int64_t i, std::int64_t j) {
    const double a = numbers[static_cast<std::size_t>(i)].*member;
    const double b = numbers[static_cast<std::size_t>(j)].*member;
    return a < b || (a == b && i < j);
  });
  return order;
}

/// Nearest rank: the least posture that a share of all does not exceed.
std::int64_t at_share(const std::vector<std::int64_t>& order, double share) {
  const auto rank = static_cast<std::int64_t>(std::ceil(share * static_cast<double>(order.size())));
  return order[static_cast<std::size_t>(std::max<std::int64_t>(rank, 1) - 1)];
}

}  // namespace

WorkspaceAudit summarize(const Audit& audit, const Numbers& numbers,
                         const std::function<JointVector(std::int64_t)>& posture) {
  WorkspaceAudit result;
  result.samples = static_cast<std::int64_t>(numbers.size());
  result.singular = std::count_if(numbers.begin(), numbers.end(),
                                  [](const PostureNumbers& one) { return one.singular; });
  const auto distribution = [&](double PostureNumbers::*member, double PostureAudit::*bound) {
    Distribution found;
    found.median = found.p05 = found.p95 = found.worst = kNotFound;
    if (bound == nullptr) found.bound = kNotFound;
    const std::vector<std::int64_t> order = ranking(numbers, member);
    if (order.empty()) return found;
    const auto number_at = [&](std::int64_t index) {
      const PostureAudit there = audit.audit(posture(index));
      if (bound != nullptr) found.bound = std::max(found.bound, there.*bound);
      return there.numbers.*member;
    };
    found.median = number_at(at_share(order, 0.5));
    found.p05 = number_at(at_share(order, 0.05));
    found.p95 = number_at(at_share(order, 0.95));
    found.worst = number_at(order.front());
    found.worst_q = posture(order.front());
    return found;
  };
  result.smallest_ratio =
      distribution(&PostureNumbers::smallest_ratio, &PostureAudit::smallest_ratio_bound);
  result.fastest_pole =
      distribution(&PostureNumbers::fastest_pole, &PostureAudit::fastest_pole_bound);
  result.gain_margin = distribution(&PostureNumbers::gain_margin, nullptr);
  return result;
}

}  // namespace dashpot::controller
