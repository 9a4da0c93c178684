// LCM logs as arrays.

#include <dashpot/analysis/mode.hpp>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/log_file.hpp>
#include <dashpot/lcmtypes/message_check.hpp>
#include <dashpot/lcmtypes/message_fields.hpp>
#include <dashpot/python/src/convert.hpp>

#include <nanobind/ndarray.h>
#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <stdexcept>
#include <type_traits>

namespace dashpot::python {
namespace {

using lcmtypes::LogFile;

/// The number that an array of arrays of numbers is made of, and how deep it lies.
template <class Value>
struct NestedNumbers {
  using Type = Value;
  static constexpr std::size_t kDepth = 0;
};
template <class Value, std::size_t Size>
struct NestedNumbers<Value[Size]> : NestedNumbers<Value> {  // NOLINT: as lcm-gen writes them
  static constexpr std::size_t kDepth = 1 + NestedNumbers<Value>::kDepth;
};
template <class Value>
struct NestedNumbers<std::vector<Value>> : NestedNumbers<Value> {
  static constexpr std::size_t kDepth = 1 + NestedNumbers<Value>::kDepth;
};

/// Enlarges shape[Depth], shape[Depth + 1], ... to what `value` needs.
template <std::size_t Depth, class Shape, class Value>
void grow(Shape& shape, const Value& value) {
  if constexpr (NestedNumbers<Value>::kDepth > 0) {
    shape[Depth] = std::max(shape[Depth], std::size(value));
    for (const auto& item : value) grow<Depth + 1>(shape, item);
  }
}

/// Writes `value`, whose sizes are at most shape[Depth], shape[Depth + 1], ..., to its place.
template <std::size_t Depth, class Number, class Shape, class Value>
void write(Number* place, const Shape& shape, const Value& value) {
  if constexpr (NestedNumbers<Value>::kDepth == 0) {
    *place = static_cast<Number>(value);
  } else {
    std::size_t step = 1;
    for (std::size_t i = Depth + 1; i < shape.size(); ++i) step *= shape[i];
    for (const auto& item : value) {
      write<Depth + 1>(place, shape, item);
      place += step;
    }
  }
}

/// Fields of messages as arrays whose first index counts the messages.
template <class Message>
class Columns {
 public:
  explicit Columns(const std::vector<Message>& messages) : messages_(messages) {}

  /// Adds a field. If sizes differ, missing entries are NaN, or -1 in arrays of integers.
  template <class Field>
  void operator()(const char* name, Field Message::*field) {
    constexpr bool kReal = std::is_floating_point_v<typename NestedNumbers<Field>::Type>;
    using Number = std::conditional_t<kReal, double, std::int64_t>;
    std::array<std::size_t, 1 + NestedNumbers<Field>::kDepth> shape{messages_.size()};
    for (const Message& message : messages_) grow<1>(shape, message.*field);
    constexpr Number kMissing = kReal ? std::numeric_limits<Number>::quiet_NaN() : Number(-1);
    std::size_t step = 1;  // from message to message
    for (std::size_t i = 1; i < shape.size(); ++i) step *= shape[i];
    auto numbers = std::make_unique<std::vector<Number>>(shape[0] * step, kMissing);
    for (std::size_t i = 0; i < messages_.size(); ++i) {
      write<1>(numbers->data() + i * step, shape, messages_[i].*field);
    }
    Number* const data = numbers->data();
    const nb::capsule owner(numbers.release(), [](void* kept) noexcept {
      delete static_cast<std::vector<Number>*>(kept);
    });
    result_[name] =
        nb::cast(nb::ndarray<nb::numpy, Number>(data, shape.size(), shape.data(), owner));
  }

  nb::dict result() const { return result_; }

 private:
  const std::vector<Message>& messages_;
  nb::dict result_;
};

template <class Message>
nb::dict columns_of(const std::vector<Message>& messages) {
  Columns columns(messages);
  lcmtypes::visit_fields<Message>(
      [&columns](const char* name, auto field) { columns(name, field); });
  return columns.result();
}

/// The events of one channel: decoded if they are Dashpot's.
struct Channel {
  std::vector<std::int64_t> utime;  ///< of the events
  std::vector<state_t> states;
  std::vector<modes_t> modes;
  std::vector<sampled_modes_t> sampled_modes;
  std::vector<command_t> commands;
  std::vector<contact_t> contacts;
  std::int64_t malformed = 0;
};

template <class Message>
void take(const LogFile::Event& event, Channel& channel, std::vector<Message>& messages) {
  Message message;
  if (lcmtypes::decode(event.data.data(), event.data.size(), message)) {
    channel.utime.push_back(event.utime);
    messages.push_back(std::move(message));
  } else {
    ++channel.malformed;
  }
}

void take(const LogFile::Event& event, Channel& channel) {
  if (event.channel == lcmtypes::kStateChannel) return take(event, channel, channel.states);
  if (event.channel == lcmtypes::kModesChannel) return take(event, channel, channel.modes);
  if (event.channel == lcmtypes::kSampledModesChannel) {
    return take(event, channel, channel.sampled_modes);
  }
  if (event.channel == lcmtypes::kContactChannel) return take(event, channel, channel.contacts);
  if (event.channel == lcmtypes::kCommandChannel) return take(event, channel, channel.commands);
  channel.utime.push_back(event.utime);  // of other programs
}

nb::dict entries_of(const std::string& name, const Channel& channel) {
  nb::dict result;
  if (name == lcmtypes::kStateChannel) result = columns_of(channel.states);
  if (name == lcmtypes::kModesChannel) result = columns_of(channel.modes);
  if (name == lcmtypes::kSampledModesChannel) result = columns_of(channel.sampled_modes);
  if (name == lcmtypes::kContactChannel) result = columns_of(channel.contacts);
  if (name == lcmtypes::kCommandChannel) result = columns_of(channel.commands);
  using Times = Eigen::Matrix<std::int64_t, Eigen::Dynamic, 1>;
  result["log_utime"] = nb::cast(Times(Eigen::Map<const Times>(
      channel.utime.data(), static_cast<Eigen::Index>(channel.utime.size()))));
  return result;
}

/// Returns the channels, the numbers of messages that could not be decoded, and the log's damage
/// ("" if it is intact).
nb::tuple read_log(const std::string& path) {
  std::map<std::string, Channel> channels;
  std::string damage;
  try {
    const nb::gil_scoped_release release;
    LogFile file(path);
    while (file.read()) take(file.event(), channels[file.event().channel]);
    damage = describe(file.damage());
  } catch (const std::runtime_error& error) {  // no such file
    throw std::invalid_argument(error.what());
  }
  nb::dict result, malformed;
  for (const auto& [name, channel] : channels) {
    result[name.c_str()] = entries_of(name, channel);
    if (channel.malformed > 0) malformed[name.c_str()] = channel.malformed;
  }
  return nb::make_tuple(result, malformed, damage);
}

/// Returns the names of the numbers in modes_t::kind and sampled_modes_t::kind, in their order.
nb::list mode_kinds() {
  nb::list names;
  for (int kind = modes_t::UNDERDAMPED; kind <= sampled_modes_t::ALTERNATING; ++kind) {
    names.append(analysis::to_text(static_cast<analysis::ModeKind>(kind)));
  }
  return names;
}

}  // namespace

void add_log(nb::module_& m) {
  m.def("read_log", &read_log, nb::arg("path"));
  m.def("mode_kinds", &mode_kinds);
}

}  // namespace dashpot::python
