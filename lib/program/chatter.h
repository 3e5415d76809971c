// Finds out from the ticks of a servo whether the hand chatters: swings to and fro faster than a hand does by will,
// because the loop cannot render what it feels.
#pragma once

#include <deque>
#include <optional>
#include <span>
#include <utility>

#include "program.h"

class Chatter {
 public:
  struct Swing {
    double frequency;  // Hz
    double size;       // m, from end to end
    fs_vec3 place;     // device frame, in the middle of it
  };

  // Takes the ticks since the last call. Gives the swing at their end, if that has gone on for half a second.
  std::optional<Swing> add(std::span<const fs_tick> ticks);

 private:
  struct Turn {
    double time, at;  // s, m
  };
  // One coordinate of the hand, and where it turned back in the last half second.
  struct Axis {
    double low = 0, high = 0, last = 0;  // m; low or high since it turned back
    bool rises = true;
    std::deque<Turn> turns;
    void add(double time, double x);
    bool goes_on() const;                    // the swing does not die down
    std::pair<double, double> ends() const;  // m, of the swing
  };

  Axis axes_[3];
  double pushed_ = -1;   // s, when a force was sent last
  double newest_ = -1;   // s
};
