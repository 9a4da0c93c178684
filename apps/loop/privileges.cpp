#include <dashpot/apps/loop/privileges.hpp>

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

namespace dashpot::apps {

bool lock_memory() noexcept {
  rlimit limit{};
  if (getrlimit(RLIMIT_MEMLOCK, &limit) != 0 || limit.rlim_cur != RLIM_INFINITY) {
    if (geteuid() != 0) return false;
  }
  return mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
}

bool schedule_ahead_of_others() noexcept {
  constexpr int kPriority = 80;  // of SCHED_FIFO
  sched_param parameter{};
  parameter.sched_priority = kPriority;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter) == 0;
}

}  // namespace dashpot::apps
