// The three masses of spectrum.cpp, one pulled aside by 3 cm and let go: their positions at any
// time, in closed form. There is no time step.
#include <cstdio>
#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>

using namespace dashpot::analysis;

int main() {
  System<> system(3);
  system.mass << 8, 0, 0, 0, 2, 0, 0, 0, 5;                                        // kg
  system.damping << 25, -15, -10, -15, 35, -20, -10, -20, 30;                      // N s/m
  system.stiffness << 3600, -1200, -2400, -1200, 2700, -1500, -2400, -1500, 3900;  // N/m
  const Response response(system, analyze(system));
  const Eigen::Vector3d position{0, 0.03, 0}, velocity{0, 0, 0};  // m, m/s
  for (const double time : {0.0, 0.05, 0.3}) {                    // s
    const Motion motion = response.free(position, velocity, time);
    std::printf("%.2f s: %8.4f %8.4f %8.4f m, of which drift %.4f\n", time, motion.position[0],
                motion.position[1], motion.position[2], motion.zero_mode_position[0]);
  }
  const Motion struck = response.impulse(Eigen::Vector3d{1, 0, 0}, 30);  // N s; s
  std::printf("30 s after an impulse: %.4f m/s, all together\n", struck.velocity[1]);
}
