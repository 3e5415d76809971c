// Which clients' scenes are in use by work that takes several steps. A claim waits until it can begin, and ends when it is
// destroyed. Claims begin in the order in which they came as far as they conflict, so none waits without end.
#pragma once

#include <coroutine>
#include <list>
#include <optional>
#include <set>
#include <string>

namespace fs {

struct Client;
class Claims;

class Claim {
 public:
  Claim(Claims& claims, Client& client) : claims_(claims), client_(client) {}
  ~Claim();
  Claim(const Claim&) = delete;
  Claim& operator=(const Claim&) = delete;

  // What it is about:
  bool is_own = false;                        // the client's own scene is changed in several steps
  std::set<std::string, std::less<>> others;  // clients whose objects are looked at, or changed in one step
  bool is_about_all = false;                  // those of all clients are

  // co_await begins it.
  bool await_ready();
  void await_suspend(std::coroutine_handle<> place) noexcept;
  void await_resume() const noexcept {}

 private:
  friend Claims;
  bool conflicts_with(const Claim& other) const;
  bool needs_whole(const Client& client) const;  // no half of a change of its scene

  Claims& claims_;
  Client& client_;
  bool has_begun_ = false;
  std::optional<std::list<Claim*>::iterator> place_;
};

class Claims {
 public:
  bool is_empty() const noexcept { return all_.empty(); }
  bool may_begin(const Claim& claim) const;  // now
  void end(Claim& claim) noexcept;           // does nothing if it was never awaited, or has ended

 private:
  friend Claim;
  void begin(Claim& claim) noexcept;

  std::list<Claim*> all_;  // in the order in which they came
};

}  // namespace fs
