// What a run was like: who pushed how hard, and how well the servo kept its time.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <forceserver/forceserver.h>

class Flight {
 public:
  Flight(fs_scene* scene, fs_servo* servo) : scene_(scene), servo_(servo) {}

  void watch(double seconds);  // samples for that long, with a line to look at meanwhile
  void print_table() const;
  void write_csv(const std::string& path) const;
  void require_all_felt() const;  // throws std::runtime_error, also after a fault

 private:
  struct Felt { double seconds = 0, sum = 0, max = 0; };  // s; N s; N

  void sample(double period);
  void fetch_ticks();
  void print_line(double time) const;

  fs_scene* scene_;
  fs_servo* servo_;
  std::vector<fs_report> reports_;
  std::map<std::string, Felt> felt_;
  std::vector<fs_tick> ticks_;
  fs_servo_stats stats_ = fs_servo_stats_init();
};
