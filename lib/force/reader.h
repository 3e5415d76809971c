// A reader is a thread's place in everything that needs memory for each evaluating thread (the parser of an expression
// holds state). The servo and each tool hold one id as long as they live; ids are small and used again.
#pragma once

namespace fs {

class ReaderId {
 public:
  ReaderId();  // the smallest free id of the process
  ~ReaderId();
  ReaderId(const ReaderId&) = delete;
  ReaderId& operator=(const ReaderId&) = delete;
  unsigned get() const noexcept { return id_; }

 private:
  unsigned id_;
};

}  // namespace fs
