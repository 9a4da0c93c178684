#pragma once

namespace dashpot::apps {

/// What the operating system granted to a loop in real time.
struct Privileges {
  bool scheduled = false;  ///< SCHED_FIFO
  bool locked = false;     ///< all memory stays resident
};

/// Locks all memory, now and to come, unless the limit on it could stop the program later.
bool lock_memory() noexcept;
/// Schedules the calling thread ahead of others.
bool schedule_ahead_of_others() noexcept;

}  // namespace dashpot::apps
