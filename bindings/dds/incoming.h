// What other sites have, on its way to this site's server: each of their clients has a connection of its own there.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "contents.h"
#include "room.h"
#include "site_clock.h"

namespace bridge {

// An object of another site.
struct RemoteObject {
  forceserver_ForceObject sample{};     // with the newest place
  ContentsOfObject contents;
  uint64_t object_revision = 0, motion_revision = 0;
  bool is_gone = false;            // it has to be removed
  bool is_set = false;             // the server has it
  double offset = 0;               // s, with which its start was mapped to our clock
  bool waits = false;              // for a content that has not come
  double held_until = -1e300;      // s: somebody here edits it, and until the owner has answered it stays as it is here
};

// A client of another site, and its connection.
struct RemoteClient {
  std::string name;                // at this server
  forceserver::Scene scene;        // empty: not connected
  std::map<std::string, RemoteObject> objects;
  std::set<std::string> due;       // objects that are to be set or removed
  std::set<std::string> refused;   // objects that did not fit in; they are tried again
  std::set<std::string> told;      // objects of which that was said
  std::set<std::string> moving;    // objects that move; they are stopped when their horizon is over
  std::optional<forceserver_ClientView> view;
  std::vector<fs_vec3> tool;
  bool is_view_due = false;
  double next_try = 0, next_retry = 0, empty_since = 0;  // s
  uint64_t motions_seen = 0;       // as of fs_scene_get_motions_since
  double alone_until = -1e300;     // s: until then objects are set one by one, as the server has refused a group
  bool is_refused = false;         // the server does not let it in, which was told
};

struct RemoteSite {
  std::string name;
  SiteClock clock;
  bool is_known = false;           // it has a Status
  forceserver_Status status{};     // without sequences
  double first_seen = 0;           // s
  double status_time = 0;          // s, when the newest Status came
  forceserver_HeldObjects held{};         // what it has of this site
  std::vector<std::string> wanted; // contents that it misses
  std::map<std::string, RemoteClient> clients;
  struct Change {
    uint32_t size = 0;
    double since = 0;              // s
    std::set<std::pair<std::string, std::string>> objects;  // client, name
  };
  std::map<uint64_t, Change> changes;  // that are not complete
  uint32_t objects = 0;            // and their digest, as in Held
  uint64_t digest = 0;
  double phase_time = 0;           // s, when the starts of its f(d, t) were looked at
};

class Incoming {
 public:
  struct Settings {
    std::string endpoint;                  // of the server
    std::string site;                      // this one
    std::map<std::string, fs_frame> frames;  // of sites: their device in ours; the others' workspaces are made to fit
  };
  // An edit of another site's object, made at this server.
  struct LocalEdit {
    RemoteSite& site;
    RemoteClient& client;
    std::string object, editor;
  };

  Incoming(const Room& room, ContentReader& contents, Settings settings)
      : room_(room), contents_(contents), settings_(std::move(settings)) {}

  void take(double now);   // the samples that have come
  void apply(double now);  // what is due, at the server
  void forget_server();    // it is gone: all has to be set again
  void forget_sites();     // their objects fade
  void forget_gone(double now);  // instead of apply, while there is no server
  // The connection of another site's client, for what it asks for here. may_connect: it is made where there is none, for a few
  // clients of each site. Null: there is none.
  const forceserver::Scene* scene_of(const std::string& site, const std::string& client, bool may_connect, double now);
  // The server's clock minus that of this site, s: not 0 where its servo is virtual.
  void set_shift(double shift) noexcept { shift_ = shift; }
  double shift() const noexcept { return shift_; }
  void set_device(const fs_device_info& device) { device_ = device; }

  std::map<std::string, RemoteSite>& sites() noexcept { return sites_; }
  RemoteSite* find(const std::string& site);
  bool has_lost_server() const noexcept { return has_lost_server_; }
  uint64_t twin() const noexcept { return twin_; }  // the session of another bridge with this site's name; 0: there is none
  // Calls f for each edit of other sites' objects by somebody else at this server.
  void take_edits(const std::function<void(const LocalEdit&)>& f, double now);
  // The object as it is set at this server, with its handles. It lives as long as `object`.
  fs_object to_local(const RemoteSite& site, RemoteObject& object, const std::string& name) const;

 private:
  RemoteSite& site(const std::string& name, double now);
  void take_status(double now);
  void take_objects(double now);
  void take_clients(double now);
  void take_motions(double now);
  void take_object(const forceserver_ForceObject& sample, bool is_gone, double now);
  void note_twin(const forceserver_Status& sample, const dds_sample_info_t& info, double now);
  static void tell_of(const RemoteSite& site, const forceserver_Status& sample);
  void lose(RemoteSite& site, const char* how);
  void collect(RemoteSite& site, double now);
  void keep_phase(RemoteSite& site, double now);
  void apply(RemoteSite& site, RemoteClient& client, double now);
  bool connect(RemoteClient& client, double now);
  void apply_view(RemoteSite& site, RemoteClient& client);
  bool apply_radius(RemoteClient& client);
  void end_motions(RemoteSite& site, RemoteClient& client, double now);
  bool end_motion(const RemoteSite& site, RemoteObject& object, double now) const;
  double to_server(const RemoteSite& site, double time) const { return site.clock.to_ours(time) + shift_; }
  void refuse(RemoteClient& client, const std::string& name, const char* why);
  void change_together(RemoteSite& site, RemoteClient& client, const std::set<std::string>& due, double now);
  void apply_object(RemoteSite& site, RemoteClient& client, const std::string& name, double now);
  void move(RemoteSite& site, const forceserver_Motions& sample, double now);
  fs_frame frame_at(const RemoteSite& site, const forceserver_ClientView& view) const;

  const Room& room_;
  ContentReader& contents_;
  const Settings settings_;
  fs_device_info device_ = fs_device_info_init();
  std::map<std::string, RemoteSite> sites_;
  double shift_ = 0;
  bool has_lost_server_ = false;
  uint64_t twin_ = 0, twin_seen_ = 0;
  double twin_since_ = 0;  // s
  uint64_t news_ = 0;  // of contents
};

}  // namespace bridge
