// What a run was like: who pushed how hard, and how well the servo kept its time.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "beat.h"
#include "landscape.h"

class Flight {
 public:
  // rover: the name under which it was added to the scene.
  Flight(fs_scene* scene, fs_servo* servo, const char* rover) : scene_(scene), servo_(servo), rover_(rover) {}

  // Samples for that long, with a line to look at meanwhile. False: Ctrl-C has ended it earlier.
  bool watch(double seconds, Beat& beat);
  void print_table() const;
  void write_csv(const std::string& path) const;
  void require_all_felt() const;  // throws std::runtime_error
  void require_no_fault() const;  // the same

 private:
  void sample(double period);
  void fetch_ticks();
  void print_line(double time) const;

  fs_scene* scene_;
  fs_servo* servo_;
  const char* rover_;
  std::vector<fs_report> reports_;
  std::map<std::string, Felt> felt_;
  std::vector<fs_tick> ticks_;
  fs_servo_stats stats_ = fs_servo_stats_init();
};
