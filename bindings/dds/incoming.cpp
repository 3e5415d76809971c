#include "incoming.h"

#include <algorithm>
#include <cmath>

#include "say.h"

namespace bridge {
namespace {

constexpr double together = 0.05;   // s: so long the objects of a change wait for each other
constexpr double settling = 0.3;    // s: a new site's objects are set when its motions have come, too
constexpr double retry = 1;         // s
constexpr double phase_error = 0.01;  // s: so far the start of an f(d, t) may be off; when it is changed the force jumps
constexpr double kept_empty = 5;    // s: so long the connection of a client without objects is kept
constexpr size_t most_objects = 65536, most_clients = 4096, most_sites = 64;

// The numbers of a status that are used.
bool makes_sense(const forceserver_Status& s) {
  for (const double value : {s.workspace_radius, s.workspace_height, s.workspace_angle, s.force_max, s.torque_max,
                             s.device_damping, s.mass, s.rate, s.max_stiffness, s.damping, s.delay, s.motion_rate}) {
    if (!(value >= 0 && value <= 1e12)) return false;
  }
  return true;
}

bool is_finite(const forceserver_Moved& moved) {
  const auto& [position, q] = moved.place;
  double sum = position.x + position.y + position.z + q.w + q.x + q.y + q.z + moved.time + moved.horizon;
  for (const float value : moved.twist) sum += value;
  return std::isfinite(sum);
}

bool is_of_other_site(const std::string& client) { return client.find('@') != std::string::npos; }

fs_twist twist_of(const forceserver_Moved& moved) {
  const float* const t = moved.twist;
  if (!(moved.horizon > 0)) return {};
  return {{t[0], t[1], t[2]}, {t[3], t[4], t[5]}};
}

}  // namespace

RemoteSite& Incoming::site(const std::string& name, double now) {
  const auto [found, is_new] = sites_.try_emplace(name);
  if (is_new) {
    found->second.name = name;
    found->second.first_seen = now;
  }
  return found->second;
}

RemoteSite* Incoming::find(const std::string& name) {
  const auto found = sites_.find(name);
  return found == sites_.end() ? nullptr : &found->second;
}

void Incoming::take(double now) {
  take_status(now);
  take_clients(now);
  take_objects(now);
  take_motions(now);
  contents_.take(now);
}

void Incoming::take_status(double now) {
  room_.status.reader.take([&](const forceserver_Status& sample, const dds_sample_info_t& info) {
    const std::string name = text_of(sample.site);
    if (name == settings_.site) return note_twin(sample, info, now);
    if (!is_site_name(name) || (!sites_.count(name) && sites_.size() >= most_sites)) return;
    if (info.instance_state != DDS_ALIVE_INSTANCE_STATE) {
      if (RemoteSite* const lost = find(name)) {
        lose(*lost, info.instance_state == DDS_NOT_ALIVE_DISPOSED_INSTANCE_STATE ? "has left" : "was lost");
      }
      return;
    }
    if (!info.valid_data || !makes_sense(sample)) return;
    RemoteSite& here = site(name, now);
    tell_of(here, sample);
    const bool has_other_device = here.is_known && here.status.workspace_radius != sample.workspace_radius;
    here.is_known = true;
    here.status = sample;
    here.status.held = {};
    here.status.wanted = {};
    here.status_time = now;
    here.held = {};
    for (uint32_t i = 0; i < sample.held._length; ++i) {
      if (text_of(sample.held._buffer[i].site) == settings_.site) here.held = sample.held._buffer[i];
    }
    for (uint32_t i = 0; i < sample.wanted._length; ++i) here.wanted.push_back(text_of(sample.wanted._buffer[i]));
    if (has_other_device) {
      for (auto& [client_name, client] : here.clients) client.is_view_due = true;
    }
  });
}

// Another bridge of this site's name counts when it says so again and again: one that has just been killed may still be heard.
void Incoming::note_twin(const forceserver_Status& sample, const dds_sample_info_t& info, double now) {
  constexpr double certain = 1.5;  // s
  const bool is_there = info.instance_state == DDS_ALIVE_INSTANCE_STATE && info.valid_data;
  if (!is_there || sample.session != twin_seen_) twin_since_ = now;
  twin_seen_ = is_there ? sample.session : 0;
  twin_ = is_there && now - twin_since_ >= certain ? sample.session : 0;
}

// What people should know of another site, when it is new.
void Incoming::tell_of(const RemoteSite& site, const forceserver_Status& sample) {
  const std::string name = "site " + site.name, stopped = "its force is stopped, and returns there only";
  const bool is_on = sample.enabled, is_new = !site.is_known;
  if (is_new) {
    say(name + " is here" + (*sample.device ? " with " + text_of(sample.device) : "") +
        (!sample.has_server ? ", without a server"
         : is_on            ? ""
                            : "; " + stopped));
  } else if (site.status.has_server != sample.has_server) {
    say(name + (sample.has_server ? " has a server" : " has lost its server: its objects fade"));
  } else if (sample.has_server && site.status.enabled != sample.enabled) {
    say(name + ": " + (is_on ? "its force returns" : stopped));
  }
}

void Incoming::lose(RemoteSite& site, const char* how) {
  say("site " + site.name + " " + how + ": its objects fade");
  sites_.erase(site.name);  // its connections end with it
}

void Incoming::take_clients(double now) {
  room_.clients.reader.take([&](const forceserver_ClientView& sample, const dds_sample_info_t& info) {
    const std::string name = text_of(sample.site);
    if (!is_site_name(name) || name == settings_.site) return;
    if (info.instance_state != DDS_ALIVE_INSTANCE_STATE) {
      RemoteSite* const there = find(name);
      const auto gone = there ? there->clients.find(text_of(sample.client)) : std::map<std::string, RemoteClient>::iterator{};
      if (there && gone != there->clients.end()) gone->second.view.reset();
      return;
    }
    if (!info.valid_data || (!sites_.count(name) && sites_.size() >= most_sites)) return;
    RemoteSite& here = site(name, now);
    const bool is_full = here.clients.size() >= most_clients && !here.clients.count(text_of(sample.client));
    if (is_full || is_of_other_site(text_of(sample.client))) return;
    RemoteClient& client = here.clients[text_of(sample.client)];
    client.view = sample;
    client.view->tool = {};
    client.tool.clear();
    for (uint32_t i = 0; i < sample.tool._length; ++i) client.tool.push_back(to_c(sample.tool._buffer[i]));
    client.is_view_due = true;
  });
}

void Incoming::take_objects(double now) {
  room_.objects.reader.take([&](const forceserver_ForceObject& sample, const dds_sample_info_t& info) {
    const bool is_gone = info.instance_state != DDS_ALIVE_INSTANCE_STATE;
    const std::string name = text_of(sample.site);
    if (!is_site_name(name) || name == settings_.site || !(info.valid_data || is_gone)) return;
    if (is_gone && !sites_.count(name)) return;
    if (!sites_.count(name) && sites_.size() >= most_sites) return;
    if (info.valid_data) return take_object(sample, is_gone, now);
    forceserver_ForceObject key = sample;  // only the keys are there
    key.change_size = 1;
    key.revision = ~uint64_t{0};
    take_object(key, true, now);
  });
}

void Incoming::take_object(const forceserver_ForceObject& sample, bool is_gone, double now) {
  RemoteSite& here = site(text_of(sample.site), now);
  const std::string client_name = text_of(sample.client), name = text_of(sample.name);
  if (is_of_other_site(client_name)) return;
  if (!here.clients.count(client_name) && (is_gone || here.clients.size() >= most_clients)) return;
  RemoteClient& client = here.clients[client_name];
  if (!client.objects.count(name) && (is_gone || here.objects >= most_objects)) return;
  RemoteObject& object = client.objects[name];
  if (object.object_revision && !is_gone && sample.session == object.sample.session &&
      sample.revision <= object.object_revision) {
    return;  // an older one, or the same again
  }
  if (object.object_revision) {
    here.digest -= digest_of(client_name, name, object.object_revision);
    --here.objects;
  }
  object.is_gone = is_gone;
  if (is_gone) {
    object.object_revision = 0;
  } else {
    const bool is_place_older = sample.session == object.sample.session && sample.revision < object.motion_revision;
    const forceserver_Moved newest = to_moved(object.sample);
    object.sample = sample;
    if (is_place_older) put_moved(object.sample, newest);
    object.object_revision = sample.revision;
    object.motion_revision = is_place_older ? object.motion_revision : sample.revision;
    here.digest += digest_of(client_name, name, sample.revision);
    ++here.objects;
  }
  RemoteSite::Change& change = here.changes[is_gone && sample.revision == ~uint64_t{0} ? 0 : sample.change];
  if (change.objects.empty()) change.since = now;
  change.size = sample.change_size;
  change.objects.emplace(client_name, name);
}

void Incoming::take_motions(double now) {
  room_.motions.reader.take([&](const forceserver_Motions& sample, const dds_sample_info_t& info) {
    RemoteSite* const here = info.valid_data ? find(text_of(sample.site)) : nullptr;
    if (!here || !std::isfinite(sample.sent)) return;
    here->clock.note_arrival(sample.sent, now);
    move(*here, sample, now);
  });
}

// All moves of a sample that belong to one client are felt from one tick on.
void Incoming::move(RemoteSite& site, const forceserver_Motions& sample, double now) {
  std::map<RemoteClient*, std::vector<const forceserver_Moved*>> by_client;
  for (uint32_t i = 0; i < sample.moves._length; ++i) {
    const forceserver_Moved& moved = sample.moves._buffer[i];
    const auto client = site.clients.find(text_of(moved.client));
    if (client == site.clients.end()) continue;
    const auto object = client->second.objects.find(text_of(moved.name));
    if (object == client->second.objects.end() || object->second.is_gone) continue;
    if (!is_finite(moved)) continue;
    if (sample.session != object->second.sample.session || moved.revision <= object->second.motion_revision) continue;
    object->second.motion_revision = moved.revision;
    put_moved(object->second.sample, moved);
    client->second.moving.insert(object->first);
    if (now < object->second.held_until) client->second.due.insert(object->first);
    else if (object->second.is_set && client->second.scene) by_client[&client->second].push_back(&moved);
  }
  for (const auto& [client, moves] : by_client) {
    try {
      forceserver::Group group(client->scene);
      for (const forceserver_Moved* moved : moves) {
        const fs_pose pose = to_c(moved->place);
        const fs_twist twist = twist_of(*moved);
        const fs_status status =
            fs_object_move(client->scene.get(), text_of(moved->name).c_str(), &pose, &twist, to_server(site, moved->time));
        if (status == FS_ERROR_DISCONNECTED) has_lost_server_ = true;
      }
      group.commit();
    } catch (const forceserver::Error& error) {
      if (error.status() == FS_ERROR_DISCONNECTED) has_lost_server_ = true;
    }
  }
}

void Incoming::apply(double now) {
  const bool has_news = news_ != contents_.news();
  news_ = contents_.news();
  for (auto& [name, site] : sites_) {
    collect(site, now);
    keep_phase(site, now);
    const bool is_settled = now - site.first_seen >= settling && (site.clock.is_known() || now - site.first_seen >= 3 * settling);
    if (!is_settled) continue;
    for (auto it = site.clients.begin(); it != site.clients.end();) {
      RemoteClient& client = it->second;
      if (client.name.empty()) client.name = name_at_site(it->first, name);
      if (has_news) {
        for (auto& [object_name, object] : client.objects) {
          if (object.waits) client.due.insert(object_name);
        }
      }
      if (!client.refused.empty() && now >= client.next_retry) {
        client.due.merge(client.refused);
        client.next_retry = now + 2 * retry;
      }
      apply(site, client, now);
      end_motions(site, client, now);
      if (!client.objects.empty()) client.empty_since = now;
      if (client.objects.empty() && now - client.empty_since > kept_empty) client.scene = {};
      const bool is_over = client.objects.empty() && !client.scene && !client.view;
      it = is_over ? site.clients.erase(it) : std::next(it);
    }
  }
}

void Incoming::forget_gone(double now) {
  for (auto& [name, site] : sites_) {
    collect(site, now);
    for (auto& [client_name, client] : site.clients) {
      std::erase_if(client.objects, [](const auto& object) { return object.second.is_gone; });
      std::erase_if(client.due, [&](const std::string& object) { return !client.objects.count(object); });
    }
    std::erase_if(site.clients, [](const auto& client) { return client.second.objects.empty() && !client.second.view; });
  }
}

// What was set before the clocks were known well, or before one of them jumped, is set again.
void Incoming::keep_phase(RemoteSite& site, double now) {
  if (std::fabs(now - site.phase_time) < 1) return;
  site.phase_time = now;
  for (auto& [client_name, client] : site.clients) {
    for (const auto& [name, object] : client.objects) {
      const bool has_curve = object.contents.front || object.contents.back;
      if (has_curve && object.is_set && std::fabs(object.offset - site.clock.offset()) > phase_error) client.due.insert(name);
    }
  }
}

// Objects that belong to a change that is complete, or old, are due.
void Incoming::collect(RemoteSite& site, double now) {
  std::erase_if(site.changes, [&](const auto& entry) {
    const RemoteSite::Change& change = entry.second;
    if (change.objects.size() < change.size && now - change.since < together) return false;
    for (const auto& [client, name] : change.objects) {
      const auto found = site.clients.find(client);
      if (found != site.clients.end()) found->second.due.insert(name);
    }
    return true;
  });
}

bool Incoming::connect(RemoteClient& client, double now) {
  if (client.scene) return true;
  try {
    client.scene = forceserver::Scene::connect(settings_.endpoint, client.name);
    client.is_view_due = client.view.has_value();
    client.is_refused = false;
    return true;
  } catch (const forceserver::Error& error) {
    if (!client.is_refused) complain("client " + client.name + ": " + error.what());
    client.is_refused = true;
    client.next_try = now + retry;
    if (error.status() == FS_ERROR_NOT_FOUND) has_lost_server_ = true;
    return false;
  }
}

const forceserver::Scene* Incoming::scene_of(const std::string& site_name, const std::string& client_name, bool may_connect,
                                             double now) {
  constexpr int most_without_objects = 8;
  RemoteSite* const site = find(site_name);
  if (!site) return nullptr;
  const auto found = site->clients.find(client_name);
  if (found != site->clients.end() && found->second.scene) return &found->second.scene;
  const auto only_asks = [](const auto& entry) { return entry.second.objects.empty(); };
  const bool is_full = std::count_if(site->clients.begin(), site->clients.end(), only_asks) >= most_without_objects;
  if (!may_connect || client_name.empty() || is_full) return nullptr;
  RemoteClient& client = site->clients[client_name];
  if (client.name.empty()) client.name = name_at_site(client_name, site_name);
  if (client.objects.empty()) client.empty_since = now;
  return now >= client.next_try && connect(client, now) ? &client.scene : nullptr;
}

void Incoming::apply(RemoteSite& site, RemoteClient& client, double now) {
  if (now < client.next_try || (client.due.empty() && !(client.is_view_due && client.scene))) return;
  const bool has_any = std::any_of(client.objects.begin(), client.objects.end(), [](const auto& o) { return !o.second.is_gone; });
  if (!client.scene && !has_any) {
    for (const std::string& name : client.due) client.objects.erase(name);
    client.due.clear();
    return;
  }
  if (!connect(client, now)) return;
  const std::set<std::string> due = std::exchange(client.due, {});
  try {
    change_together(site, client, due, now);
  } catch (const forceserver::Error& error) {
    if (error.status() == FS_ERROR_DISCONNECTED) {
      has_lost_server_ = true;
      return;
    }
    complain("changes of " + client.name + ": " + error.what());
    client.due.insert(due.begin(), due.end());
    client.is_view_due = client.view.has_value();
    client.next_try = now + retry;
  }
}

// Removals come first, as they make room. All else is felt from one tick on. A solid mesh and a radius exclude each other, so the
// one that gives way comes before the other.
void Incoming::change_together(RemoteSite& site, RemoteClient& client, const std::set<std::string>& due, double now) {
  const auto apply_those = [&](bool are_gone) {
    std::optional<forceserver::Group> group;
    if (now > client.alone_until) group.emplace(client.scene);
    bool has_view = false, has_radius = true;
    if (!are_gone) {
      has_view = std::exchange(client.is_view_due, false) && client.view;
      if (has_view) apply_view(site, client);
      if (has_view) has_radius = apply_radius(client);
    }
    for (const std::string& name : due) {
      const auto object = client.objects.find(name);
      if (object != client.objects.end() && object->second.is_gone == are_gone) apply_object(site, client, name, now);
    }
    if (!has_radius && !apply_radius(client)) {
      complain("the radius of the tool of " + client.name + ": " + fs_last_error());
      client.is_view_due = true;
      client.next_try = now + retry;
    }
    if (group) group->commit();
  };
  const auto is_gone = [&](const std::string& name) {
    const auto object = client.objects.find(name);
    return object != client.objects.end() && object->second.is_gone;
  };
  if (std::any_of(due.begin(), due.end(), is_gone)) apply_those(true);
  apply_those(false);
}

// The frame of another site's client leads to that site's device, and on to ours.
fs_frame Incoming::frame_at(const RemoteSite& site, const forceserver_ClientView& view) const {
  fs_frame out = frame_of(view);
  const auto given = settings_.frames.find(site.name);
  fs_frame between = fs_frame_init();
  if (given != settings_.frames.end()) {
    between = given->second;
  } else if (site.is_known && site.status.workspace_radius > 0 && device_.workspace_radius > 0) {
    between.scale = site.status.workspace_radius / device_.workspace_radius;
  }
  // x_ours = between.pose * ((frame.pose * (x_scene / scale)) / between.scale)
  const fs_pose there = out.pose;
  forceserver::throw_on_error(fs_frame_to_device(&between, &there, &out.pose));
  out.scale *= between.scale;
  return out;
}

void Incoming::apply_view(RemoteSite& site, RemoteClient& client) {
  fs_scene* const scene = client.scene.get();
  const auto tell = [&](fs_status status, const char* what) {
    if (status == FS_ERROR_DISCONNECTED) throw forceserver::Error(status);
    if (status < 0) complain(std::string(what) + " of " + client.name + ": " + fs_last_error());
  };
  tell(fs_scene_set_clutch(scene, client.view->clutch_held), "the clutch");
  try {
    const fs_frame frame = frame_at(site, *client.view);
    tell(fs_scene_set_frame(scene, &frame), "the frame");
  } catch (const forceserver::Error& error) {
    tell(error.status(), "the frame");
  }
  if (!client.tool.empty()) tell(fs_scene_set_tool(scene, client.tool.data(), client.tool.size()), "the tool");
}

bool Incoming::apply_radius(RemoteClient& client) {
  const fs_status status = fs_scene_set_tool_radius(client.scene.get(), client.view->tool_radius);
  if (status == FS_ERROR_DISCONNECTED) throw forceserver::Error(status);
  return status == FS_OK;
}

// What does not fit in now may later. It is told once.
void Incoming::refuse(RemoteClient& client, const std::string& name, const char* why) {
  if (client.told.insert(name).second) complain(client.name + "/" + name + ": " + why);
  client.refused.insert(name);
}

// A motion lasts for its horizon, which the server does not know: then the object stands where it has come. True: it stands now.
bool Incoming::end_motion(const RemoteSite& site, RemoteObject& object, double now) const {
  forceserver_ForceObject& sample = object.sample;
  if (!(sample.horizon > 0) || now < site.clock.to_ours(sample.time) + sample.horizon) return false;
  fs_motion motion{};
  motion.pose = to_c(sample.place);
  motion.twist = to_c(sample.motion);
  motion.horizon = std::fmin(sample.horizon, 0.1);
  fs_pose end;
  if (fs_motion_at(&motion, 1, &end) == FS_OK) sample.place = to_sample(end);
  // Its time stays: a later one would make the server take the next move for an older one.
  sample.motion = {};
  sample.horizon = 0;
  return true;
}

void Incoming::end_motions(RemoteSite& site, RemoteClient& client, double now) {
  std::erase_if(client.moving, [&](const std::string& name) {
    const auto found = client.objects.find(name);
    if (found == client.objects.end() || !(found->second.sample.horizon > 0)) return true;
    RemoteObject& object = found->second;
    if (!end_motion(site, object, now)) return false;
    if (now < object.held_until) client.due.insert(name);
    if (now < object.held_until || !object.is_set || !client.scene) return true;
    const fs_pose pose = to_c(object.sample.place);
    const fs_twist rest{};
    const fs_status status = fs_object_move(client.scene.get(), name.c_str(), &pose, &rest, to_server(site, object.sample.time));
    if (status == FS_ERROR_DISCONNECTED) has_lost_server_ = true;
    return true;
  });
}

fs_object Incoming::to_local(const RemoteSite& site, RemoteObject& object, const std::string& name) const {
  fs_object out = to_c(object.sample, name);
  if (!object.is_set || std::fabs(object.offset - site.clock.offset()) > phase_error) object.offset = site.clock.offset();
  out.start += object.offset + shift_;
  out.time = to_server(site, out.time);
  object.contents.put_handles(out);
  return out;
}

void Incoming::apply_object(RemoteSite& site, RemoteClient& client, const std::string& name, double now) {
  const auto found = client.objects.find(name);
  if (found == client.objects.end()) return;
  RemoteObject& object = found->second;
  if (now < object.held_until) {
    client.due.insert(name);
    return;
  }
  if (object.is_gone) {
    const fs_status status = object.is_set ? fs_object_remove(client.scene.get(), name.c_str()) : FS_OK;
    if (status == FS_ERROR_DISCONNECTED) throw forceserver::Error(status);
    client.objects.erase(found);
    return;
  }
  bool is_whole = true;
  const auto get = [&](const std::string& key) -> ContentRef {
    if (key.empty()) return nullptr;
    ContentRef content = contents_.find(key, now);
    if (!content) is_whole = false;
    return content;
  };
  end_motion(site, object, now);
  if (object.sample.horizon > 0) client.moving.insert(name);
  const forceserver_ForceObject& sample = object.sample;
  ContentsOfObject contents{get(text_of(sample.form)), get(text_of(sample.finish)), get(text_of(sample.front.curve)),
                            get(text_of(sample.back.curve))};
  object.waits = !is_whole;
  if (!is_whole) return;  // what it had stays, until its contents have come
  const bool is_right = (!contents.shape || contents.shape->shape) && (!contents.surface || contents.surface->surface) &&
                        (!contents.front || contents.front->curve) && (!contents.back || contents.back->curve);
  if (!is_right) {
    complain(client.name + "/" + name + " has a key of another kind of content");
    return;
  }
  object.contents = std::move(contents);
  const fs_object local = to_local(site, object, name);
  const fs_status status = fs_object_set(client.scene.get(), &local);
  if (status == FS_ERROR_DISCONNECTED) throw forceserver::Error(status);
  object.is_set = object.is_set || status == FS_OK;
  if (status == FS_OK) client.told.erase(name);
  if (status == FS_ERROR_FULL || status == FS_ERROR_UNSUPPORTED) refuse(client, name, fs_last_error());
  else if (status < 0) complain(client.name + "/" + name + ": " + fs_last_error());
}

void Incoming::forget_server() {
  has_lost_server_ = false;
  for (auto& [name, site] : sites_) {
    for (auto& [client_name, client] : site.clients) {
      client.scene = {};
      client.next_try = 0;
      for (auto& [object_name, object] : client.objects) {
        object.is_set = false;
        client.due.insert(object_name);
      }
    }
  }
}

void Incoming::forget_sites() {
  sites_.clear();
  twin_ = twin_seen_ = 0;
}

void Incoming::take_edits(const std::function<void(const LocalEdit&)>& f, double now) {
  for (auto& [site_name, site] : sites_) {
    for (auto& [client_name, client] : site.clients) {
      fs_event event{};
      while (client.scene && fs_scene_next_event(client.scene.get(), 0, &event) == FS_OK && event.kind != FS_EVENT_NONE) {
        if (event.kind == FS_EVENT_DISCONNECTED) {
          has_lost_server_ = true;
          break;
        }
        if (event.kind == FS_EVENT_REFUSED) {
          // With a group it has refused all that was in it.
          refuse(client, event.name, event.text);
          for (const auto& [object_name, object] : client.objects) client.refused.insert(object_name);
          client.next_retry = now + 2 * retry;
          client.alone_until = client.next_retry + 10 * retry;
        }
        const auto object = client.objects.find(event.name);
        if (event.kind != FS_EVENT_EDITED || object == client.objects.end() || object->second.is_gone) continue;
        f({site, client, event.name, event.text});
      }
    }
  }
}

}  // namespace bridge
