// Profiles of your own: an expression in the distance d and the time t, and a table of measured values. The program
// prints the force of both at some distances; the pulse is limited to 5 N.
#include <cstdio>
#include <iterator>

#include <forceserver/forceserver.hpp>

using namespace forceserver;

static fs_profile custom(const Curve& curve, double limit) {
  fs_profile profile = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, 1, 0, limit);
  profile.curve = curve.get();
  return profile;
}

int main() try {
  const double newtons[] = {2, 2.4, 2.6, 1.5, 0.4, 0.1, 0};  // a push-button: the force every millimetre
  const Curve pulse = Curve::create_expression("3*(1+sin(12*t))*exp(-d/0.01)");
  const Curve click = Curve::create_table(newtons, std::size(newtons), 0.001);

  const double distances[] = {0, 0.0015, 0.003, 0.0045, 0.006};  // m
  double at_start[5], later[5], table[5];
  const fs_profile pulsing = custom(pulse, 5), clicking = custom(click, 5);
  profile_evaluate(pulsing, 0, 0, distances, 5, at_start);
  profile_evaluate(pulsing, 0, 0.13, distances, 5, later);
  profile_evaluate(clicking, 0, 0, distances, 5, table);
  std::printf("distance   pulse, t = 0 s   t = 0.13 s     click\n");
  for (int i = 0; i < 5; ++i) {
    std::printf("%5.1f mm %14.2f N %10.2f N %7.2f N\n", distances[i] * 1e3, at_start[i], later[i], table[i]);
  }
} catch (const Error& error) {
  std::fprintf(stderr, "custom_profile: %s\n", error.what());
  return 1;
}
