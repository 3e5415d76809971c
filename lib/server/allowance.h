// Limits one client's work per turn. One that overspends skips as many turns as it overspent.
#pragma once

#include <cstddef>

namespace fs {

class Allowance {
 public:
  explicit Allowance(size_t each_turn) : each_turn_(each_turn) {}

  // Called once a turn, before anything is done. False: the client sits this turn out.
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

// How much of the server's thread a client has used lately, in any unit. The one that has used least is served first: a client that
// asks for little waits for one piece of another's work at most, however much work that one has. Nobody is left out, because
// being served adds to what a client has used.
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
