// What happened to a scene, until somebody asks. Under the scene's lock.
#pragma once

#include <deque>
#include <string_view>

#include <forceserver/scene.h>

#include "scene/servo_link.h"

namespace fs {

class Events {
 public:
  void push(const fs_event& event);
  void push(fs_event_kind kind, double time, std::string_view name, std::string_view text = {});
  bool take(double now, fs_event& out);  // the oldest; false: none
  void shift(double by) noexcept;        // all times, s

  void attach(const ServoLink& servo) noexcept;
  void collect(const ServoLink& servo);  // what the device did

 private:
  void limit();
  void sort_newest();

  std::deque<fs_event> events_;
  uint64_t lost_ = 0;
  uint64_t next_of_servo_ = 0;
};

}  // namespace fs
