// The channels of a servo, its own scene's first. A list of them is immutable and reaches the tick through a mailbox, as
// snapshots do.
#pragma once

#include <mutex>
#include <string>
#include <vector>

#include "servo/channel.h"

namespace fs {

class Channels {
 public:
  void start(Ref<Channel> own);  // before the first tick
  void stop() noexcept;          // detaches all scenes; nothing ticks any more

  // Any thread; not [rt].
  void add(const Ref<Channel>& channel);  // which takes over from those that are left to it. STATE: the servo has been stopped
  std::vector<Ref<Channel>> present();    // empty: it has been stopped
  std::vector<Ref<SceneBudget>> budgets();  // of their scenes
  void note(const fs_event& event);         // for all of their scenes
  Wrench own_wrench();                    // what the servo's own scene added at the last tick, device frame
  size_t count();                         // without the servo's own; channels that are fading out count
  void reap();                            // removes the channels that have faded out

  // [rt] The tick's: what all scenes together give; of their proxies the one that is farthest from the hand. begins_anew: the
  // hand was lost for so long that nothing touches it any more. impacts: of the loop. period: s, of the servo, to which the time that each client's
  // scene takes is charged; 0: to none.
  fs_response evaluate(const fs_state& hand, bool has_pose, bool begins_anew, const ImpactLimit& impacts, double now,
                       double period) noexcept;
  // [rt] The same scenes are told what was sent.
  void publish(const Wrench& sent, uint32_t flags, uint64_t tick) noexcept;

 private:
  // The clients of one site, which together push no more than one client may.
  struct Site {
    std::string name;
    Channel::Limits limits;
    fs_response sum;  // the tick's
    double part;  // of the sum that was added; the tick's
  };
  struct List : Counted<List> {
    explicit List(std::vector<Ref<Channel>> those);
    const std::vector<Ref<Channel>> channels;
    std::vector<size_t> site_of;  // of each channel; no_site: it has none. Empty: none has one
    mutable std::vector<Site> sites;  // in the order in which they came
    static constexpr size_t no_site = SIZE_MAX;
    Site* site(size_t channel) const noexcept {
      return site_of.empty() || site_of[channel] == no_site ? nullptr : &sites[site_of[channel]];
    }
  };
  static void add_sites(const List& list, fs_response& out) noexcept;
  std::mutex mutex_;
  Ref<const List> posted_;  // null: the servo has been stopped
  Mailbox<Ref<const List>> mailbox_;
  ImpactBudget impacts_;  // the tick's
};

}  // namespace fs
