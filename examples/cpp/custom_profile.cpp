// Profiles of your own: an expression in the distance d and the time t, and a table of measured values. The program
// prints the force of both at some distances; the pulse is limited to 5 N.
#include <cstdio>
#include <cstdlib>

#include <forceserver/forceserver.h>

static void check(fs_status status) {
  if (status >= 0) return;
  std::fprintf(stderr, "custom_profile: %s\n", fs_last_error());
  std::exit(1);
}

static fs_profile custom(fs_curve* curve, double limit) {
  fs_profile profile = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, 1, 0, limit);
  profile.curve = curve;
  return profile;
}

int main() {
  fs_curve *pulse, *click;
  const double newtons[] = {2, 2.4, 2.6, 1.5, 0.4, 0.1, 0};  // a push-button: the force every millimetre
  check(fs_curve_create_expression("3*(1+sin(12*t))*exp(-d/0.01)", &pulse));
  check(fs_curve_create_table(newtons, sizeof newtons / sizeof *newtons, 0.001, &click));

  const double distances[] = {0, 0.0015, 0.003, 0.0045, 0.006};  // m
  double at_start[5], later[5], table[5];
  const fs_profile pulsing = custom(pulse, 5), clicking = custom(click, 5);
  check(fs_profile_evaluate(&pulsing, 0, 0, distances, 5, at_start));
  check(fs_profile_evaluate(&pulsing, 0, 0.13, distances, 5, later));
  check(fs_profile_evaluate(&clicking, 0, 0, distances, 5, table));
  std::printf("distance   pulse, t = 0 s   t = 0.13 s     click\n");
  for (int i = 0; i < 5; ++i) {
    std::printf("%5.1f mm %14.2f N %10.2f N %7.2f N\n", distances[i] * 1e3, at_start[i], later[i], table[i]);
  }
  fs_curve_destroy(pulse);
  fs_curve_destroy(click);
}
