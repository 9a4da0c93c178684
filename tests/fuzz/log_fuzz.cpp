// The input as an LCM log.
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/tests/fuzz/fuzz_input.hpp>

namespace {

using namespace dashpot::lcmtypes;  // NOLINT(google-build-using-namespace)
using dashpot::fuzz::require;

constexpr std::uint64_t kEventSize = 28;  // without channel and data

/// Every byte belongs to an event, to a damaged place, or to the event that is cut off.
void account(const std::string& path, std::uint64_t size) {
  LogFile log(path);
  std::uint64_t events = 0;
  while (log.read()) {
    const LogFile::Event& event = log.event();
    require(event.data.empty() || event.data.size() == event.size, "data is whole or not there");
    events += kEventSize + event.channel.size() + event.size;
  }
  const LogFile::Damage& damage = log.damage();
  const std::uint64_t end = damage.cut.value_or(size);
  require(end <= size && events + damage.skipped == end, "every byte is accounted for");
  require(describe(log.damage()).empty() == (events == size), "damage is reported");
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const dashpot::fuzz::ScratchTree tree;
  const std::string path = tree.write("sim/scenes/log.lcm", data, size);
  account(path, size);
  MessageHandlers handlers;
  LogReader reader(path, handlers);
  while (reader.read()) reader.handle();
  return 0;
}
