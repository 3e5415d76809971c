// Records a run: which object pushed how hard, and how punctual the servo's ticks were.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "beat.h"
#include "landscape.h"

class Flight {
 public:
  // rover: the name of the rover's object in the scene.
  Flight(fs_scene* scene, fs_servo* servo, const char* rover) : scene_(scene), servo_(servo), rover_(rover) {}

  // Samples for `seconds`, and prints a line now and then. Returns false if Ctrl-C ended it earlier.
  bool watch(double seconds, Beat& beat);
  void print_table() const;
  void write_ticks(const std::string& path) const;
  void write_samples(const std::string& path) const;
  void require_all_felt() const;  // throws std::runtime_error
  void require_no_fault() const;  // the same

 private:
  void sample(double time, double period);
  void fetch_ticks();
  void print_line(double time) const;

  fs_scene* scene_;
  fs_servo* servo_;
  const char* rover_;
  std::vector<fs_report> reports_;
  std::map<std::string, Felt> felt_;
  struct Sample {
    double time;                          // s since the flight began
    fs_vec3 hand;                         // m, in the landscape
    std::map<std::string, double> force;  // N, of each object
  };
  std::vector<Sample> samples_;
  std::vector<fs_tick> ticks_;
  fs_servo_stats stats_ = fs_servo_stats_init();
};
