// What the clients of this site's server have, on its way to the other sites of the room.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "contents.h"
#include "room.h"
#include "worker.h"

namespace bridge {

using SceneRef = std::shared_ptr<const forceserver::Scene>;

// At most so many bytes a second, after a pause so many at once.
class Pace {
 public:
  Pace(double rate, double most) : rate_(rate), most_(most), allowance_(most) {}
  void advance(double now) {
    allowance_ = std::min(most_, allowance_ + rate_ * std::max(0.0, now - last_));
    last_ = now;
  }
  bool allows() const noexcept { return allowance_ > 0; }
  void spend(double bytes) noexcept { allowance_ -= bytes; }

 private:
  const double rate_, most_;
  double allowance_, last_ = 0;
};

class Outgoing {
 public:
  Outgoing(const Room& room, Worker& worker, std::string site, uint64_t session)
      : room_(room), worker_(worker), site_(std::move(site)), session_(session), contents_(room) {}

  // Looks at what the server's clients have. now: s, this site's clock; shift: the scene's clock minus that. Throws
  // forceserver::Error.
  void look(const SceneRef& scene, const std::string& own_name, double now, double shift);
  // Writes what is due, as far as readers follow. now: as above.
  void write(double now);
  void forget(double now);       // the server is gone: its objects are taken back
  bool is_written() const noexcept { return to_write_.empty() && gone_.empty() && gone_clients_.empty(); }

  // For Status.
  uint32_t objects() const noexcept { return written_; }
  uint64_t digest() const noexcept { return digest_; }
  double motion_rate() const noexcept { return motion_rate_; }  // Hz, of each object that moves
  void write_again();             // some site has missed something
  ContentWriter& contents() noexcept { return contents_; }

 private:
  struct Known {
    forceserver_ForceObject sample{};
    ContentsOfObject contents;
    fs_motion motion{};             // the newest that was seen; its time is on the scene's clock
    double touched = 0;             // s, when it was last changed or moved
    double moved = -1e9;            // s, when it was last moved
    double last_sent = 0;           // s, in a Motions; and where it was then, and when (motion.time)
    fs_motion sent{};
    double lifetime = 0;            // s
    uint64_t written_revision = 0;  // of the Object that was written last; 0: none
    bool is_enabled = true;
    bool is_fetched = false, is_expired = false, is_moving = false, is_queued = false;
  };
  struct Fetched {
    std::string name;  // "client/object"
    forceserver::Object object;
    ContentsOfObject contents;
  };
  struct KnownClient {
    uint32_t objects = 0;  // that are known here
    forceserver_ClientView sample{};
    std::vector<forceserver_Vec3> points;
    bool is_written = false, is_changed = false;
  };

  bool is_sent(const std::string& client) const;  // to other sites
  void note(const fs_motion& motion, double now, std::vector<std::string>& changed);
  void remove_missing(const SceneRef& scene, double now);
  void remove(std::map<std::string, Known>::iterator known, double now, uint64_t change, uint32_t size);
  void fetch(const SceneRef& scene, std::vector<std::string> names);
  void keep(std::vector<Fetched>& fetched);
  void note_views(const forceserver::Scene& scene);
  void look_at_times(double now);
  void queue(const std::string& name, Known& known, uint64_t change, uint32_t size);
  void queue_together(const std::vector<std::string>& names);  // as one change
  bool write_objects();
  bool write_clients();
  void write_motions(double now);
  static forceserver_Moved to_moved(const Known& known);

  const Room& room_;
  Worker& worker_;
  const std::string site_;
  const uint64_t session_;
  ContentWriter contents_;
  std::string own_name_;
  std::map<std::string, Known> known_;  // by "client/object"
  std::map<std::string, KnownClient> clients_;
  std::deque<std::string> to_write_;
  std::deque<forceserver_ForceObject> gone_;
  std::deque<forceserver_ClientView> gone_clients_;
  Pace pace_{25e6 / 8, 256e3};
  double now_ = 0, shift_ = 0;
  uint64_t seen_ = 0;      // motion_revision
  uint64_t revision_ = 0, change_ = 0, number_ = 0;
  uint64_t generation_ = 0;  // grows when the server is lost: what was fetched before does not count
  uint32_t written_ = 0;
  uint64_t digest_ = 0;
  double last_motions_ = 0, last_news_ = 0, next_others_ = 0;  // s
  double motion_rate_ = 25;                    // Hz
  bool has_news_ = false;                      // something has moved since the last sample
  bool are_many_ = false;                      // move
};

}  // namespace bridge
