// What a session may do on the thread that serves all: so much work each turn. Who has done more sits out the turns in which
// it would have been done, so a client with very many moves has them taken less often, and nobody else's come late.
#pragma once

#include <cstddef>

namespace fs {

class Allowance {
 public:
  explicit Allowance(size_t each_turn) : each_turn_(each_turn) {}

  // Once a turn, before anything is done: false where this one is to be sat out.
  bool begin_turn() noexcept {
    if (debt_ <= each_turn_) {
      debt_ = 0;
      return true;
    }
    debt_ -= each_turn_;
    return false;
  }
  void spend(size_t work) noexcept { debt_ += work; }

 private:
  const size_t each_turn_;
  size_t debt_ = 0;
};

// How much of that thread one has used lately, in any unit. Who has used least is served first: who asks for little waits
// for one piece of another's work, however much that one has to do. Nobody is left out, as being served makes it more.
class Usage {
 public:
  explicit Usage(double begin) : lately_(begin) {}
  void spend(double work) noexcept { lately_ += work; }
  void fade() noexcept { lately_ /= 2; }  // once a turn
  double lately() const noexcept { return lately_; }

 private:
  double lately_;
};

}  // namespace fs
