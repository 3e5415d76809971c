#include "outgoing.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "say.h"

namespace bridge {
namespace {

constexpr double kept_moving = 0.3;        // s: so long a move is sent again and again
constexpr size_t most_moves = 100;         // in a sample
constexpr double motions_period = 0.04;    // s, from one sample to the next at least, where what moves is new
constexpr double repeat_period = 0.08;     // s, where it is not
constexpr double others_period = 0.04;     // s, between looks at what changes seldom
constexpr double object_bytes = 900;       // of a sample, with what DDS adds, at most

}  // namespace

bool Outgoing::is_sent(const std::string& client) const { return client != own_name_ && client.find('@') == std::string::npos; }

void Outgoing::look(const SceneRef& scene, const std::string& own_name, double now, double shift) {
  shift_ = shift;
  own_name_ = own_name;
  now_ = now;
  std::vector<std::string> changed;
  for (const fs_motion& motion : scene->get_motions_since(nullptr, seen_)) {
    seen_ = std::max(seen_, motion.motion_revision);
    note(motion, now, changed);
  }
  // What is new may take the place of what is gone, so that is told first.
  if (!changed.empty() || now >= next_others_ || now < next_others_ - 1) {
    next_others_ = now + others_period;
    remove_missing(scene, now);
    note_views(*scene);
    look_at_times(now);
  }
  if (!changed.empty()) fetch(scene, std::move(changed));
}

void Outgoing::note(const fs_motion& motion, double now, std::vector<std::string>& changed) {
  std::string client, object;
  if (!split_name(motion.name, client, object) || !is_sent(client)) return;
  const auto [found, is_new] = known_.try_emplace(motion.name);
  Known& known = found->second;
  const bool has_changed = is_new || known.motion.revision != motion.revision;
  const bool has_moved = !is_new && known.motion.motion_revision != motion.motion_revision && !has_changed;
  known.motion = motion;
  known.touched = now;
  if (is_new) ++clients_[client].objects;
  if (is_new) {
    put_text(known.sample.site, site_);
    put_text(known.sample.client, client);
    put_text(known.sample.name, object);
    known.sample.session = session_;
  }
  if (has_changed || known.is_expired) changed.push_back(motion.name);
  known.is_expired = false;
  if (!has_moved || !known.is_fetched) return;
  known.moved = now;
  known.is_moving = has_news_ = true;
  known.sample.place = to_sample(motion.pose);
  known.sample.motion = to_sample(motion.twist);
  known.sample.time = motion.time - shift_;
  known.sample.horizon = motion.horizon;
  known.sample.revision = ++revision_;
}

// What was removed is not told, but how many objects each client has.
void Outgoing::remove_missing(const SceneRef& scene, double now) {
  std::map<std::string, uint32_t> present;
  for (const fs_client& client : scene->get_clients()) {
    if (is_sent(client.name)) present[client.name] = client.objects;
  }
  std::vector<std::string> missing;
  for (const auto& [name, client] : clients_) {
    const auto found = present.find(name);
    if (found != present.end() && found->second == client.objects) continue;
    std::vector<fs_motion> there;
    try {
      if (found != present.end()) there = scene->get_motions(name.c_str());
    } catch (const forceserver::Error& error) {
      if (error.status() != FS_ERROR_NOT_FOUND) throw;  // it has just left
    }
    std::vector<std::string> names;
    for (const fs_motion& motion : there) names.push_back(motion.name);
    std::sort(names.begin(), names.end());
    const std::string prefix = name + "/";
    for (auto known = known_.lower_bound(prefix); known != known_.end() && known->first.starts_with(prefix); ++known) {
      if (!std::binary_search(names.begin(), names.end(), known->first)) missing.push_back(known->first);
    }
  }
  if (missing.empty()) return;
  ++change_;
  for (const std::string& name : missing) remove(known_.find(name), now, change_, static_cast<uint32_t>(missing.size()));
}

void Outgoing::remove(std::map<std::string, Known>::iterator it, double now, uint64_t change, uint32_t size) {
  Known& known = it->second;
  const std::string client = text_of(known.sample.client);
  if (known.written_revision) {
    digest_ -= digest_of(client, text_of(known.sample.name), known.written_revision);
    --written_;
    known.sample.revision = ++revision_;
    known.sample.change = change;
    known.sample.change_size = size;
    gone_.push_back(known.sample);
  }
  for (const std::string& key : {text_of(known.sample.form), text_of(known.sample.finish), text_of(known.sample.front.curve),
                                 text_of(known.sample.back.curve)}) {
    contents_.unuse(key, now);
  }
  known_.erase(it);
  const auto owner = clients_.find(client);
  if (--owner->second.objects > 0) return;
  if (owner->second.is_written) gone_clients_.push_back(owner->second.sample);
  clients_.erase(owner);
}

void Outgoing::fetch(const SceneRef& scene, std::vector<std::string> names) {
  worker_.start([this, scene, names = std::move(names), generation = generation_]() -> Worker::Done {
    auto fetched = std::make_shared<std::vector<Fetched>>();
    std::vector<std::string> late;
    for (const std::string& name : names) {
      try {
        Fetched one{name, scene->object_get(name), {}};
        one.contents = ContentsOfObject::of(one.object);
        fetched->push_back(std::move(one));
      } catch (const forceserver::Error& error) {
        if (error.status() == FS_ERROR_DISCONNECTED) break;
        if (error.status() == FS_ERROR_TIMEOUT) {  // nothing would tell again that it has changed
          late.push_back(name);
          continue;
        }
        // NOT_FOUND: it was removed meanwhile, which the next look sees.
        if (error.status() != FS_ERROR_NOT_FOUND) complain(name + ": " + error.what());
      }
    }
    return [this, scene, fetched, late = std::move(late), generation] {
      if (generation != generation_) return;
      if (!late.empty()) fetch(scene, late);
      keep(*fetched);
    };
  });
}

void Outgoing::keep(std::vector<Fetched>& fetched) {
  std::vector<std::string> names;
  for (Fetched& one : fetched) {
    const auto found = known_.find(one.name);
    if (found == known_.end()) continue;
    Known& known = found->second;
    forceserver_ForceObject& sample = known.sample;
    const ContentsOfObject before = std::move(known.contents);
    known.contents = std::move(one.contents);
    for (const ContentRef& content : {known.contents.shape, known.contents.surface, known.contents.front, known.contents.back}) {
      contents_.use(content);
    }
    for (const ContentRef& content : {before.shape, before.surface, before.front, before.back}) {
      if (content) contents_.unuse(content->key, now_);
    }
    const bool is_older = one.object.time < known.motion.time;
    const bool is_newest = one.object.time == known.motion.time;
    const fs_twist& twist = one.object.twist;
    const bool stands = twist.linear.x == 0 && twist.linear.y == 0 && twist.linear.z == 0 && twist.angular.x == 0 &&
                        twist.angular.y == 0 && twist.angular.z == 0;
    one.object.time -= shift_;
    one.object.start -= shift_;
    put_object(sample, one.object);
    known.contents.put_keys(sample);
    sample.horizon = stands ? 0 : is_newest ? known.motion.horizon : 0.1;
    if (is_older) {
      sample.place = to_sample(known.motion.pose);
      sample.motion = to_sample(known.motion.twist);
      sample.time = known.motion.time - shift_;
      sample.horizon = known.motion.horizon;
    }
    known.lifetime = one.object.lifetime;
    known.is_enabled = one.object.enabled;
    known.is_fetched = true;
    names.push_back(one.name);
  }
  queue_together(names);
}

void Outgoing::queue_together(const std::vector<std::string>& names) {
  ++change_;
  for (const std::string& name : names) queue(name, known_.at(name), change_, static_cast<uint32_t>(names.size()));
}

void Outgoing::queue(const std::string& name, Known& known, uint64_t change, uint32_t size) {
  known.sample.enabled = known.is_enabled && !known.is_expired;
  known.sample.revision = ++revision_;
  known.sample.change = change;
  known.sample.change_size = size;
  if (!known.is_queued) to_write_.push_back(name);
  known.is_queued = true;
}

// What has come to rest is written as an object, and what is older than its lifetime as one that is not enabled.
void Outgoing::look_at_times(double now) {
  std::vector<std::string> names;
  for (auto& [name, known] : known_) {
    if (!known.is_fetched) continue;
    const bool rests = known.is_moving && now - known.moved > kept_moving;
    const bool expires = known.lifetime > 0 && !known.is_expired && now - known.touched > known.lifetime;
    if (rests) known.is_moving = false;
    if (expires) known.is_expired = true;
    if (rests || expires) names.push_back(name);
  }
  if (!names.empty()) queue_together(names);
}

void Outgoing::note_views(const forceserver::Scene& scene) {
  if (clients_.empty()) return;
  for (const fs_client_view& each : scene.get_views()) {
    const auto found = clients_.find(each.name);
    if (found == clients_.end()) continue;
    KnownClient& client = found->second;
    forceserver_ClientView sample{};
    put_text(sample.site, site_);
    put_text(sample.client, each.name);
    sample.session = session_;
    put_view(sample, each.view);
    std::vector<forceserver_Vec3> points;
    for (uint32_t i = 0; i < each.view.point_count; ++i) points.push_back(to_sample(each.view.points[i]));
    forceserver_ClientView before = client.sample;
    before.tool = {};
    const bool is_same = client.is_written && std::memcmp(&before, &sample, sizeof sample) == 0 &&
                         points.size() == client.points.size() &&
                         std::memcmp(points.data(), client.points.data(), points.size() * sizeof points[0]) == 0;
    if (is_same) continue;
    client.sample = sample;
    client.points = std::move(points);
    lend(client.sample.tool, client.points);
    client.is_changed = true;
  }
}

bool Outgoing::write_clients() {
  for (; !gone_clients_.empty(); gone_clients_.pop_front()) {
    forceserver_ClientView& sample = gone_clients_.front();
    sample.tool = {};
    if (!room_.clients.writer.dispose(sample)) return false;
  }
  for (auto& [name, client] : clients_) {
    if (!client.is_changed) continue;
    if (!room_.clients.writer.write(client.sample)) return false;
    client.is_changed = false;
    client.is_written = true;
  }
  return true;
}

bool Outgoing::write_objects() {
  for (; !gone_.empty() && pace_.allows(); gone_.pop_front()) {
    if (!room_.objects.writer.dispose(gone_.front())) return false;
    pace_.spend(object_bytes);
  }
  for (; !to_write_.empty() && pace_.allows(); to_write_.pop_front()) {
    const auto found = known_.find(to_write_.front());
    if (found == known_.end() || !found->second.is_queued) continue;  // removed meanwhile, or even set anew
    Known& known = found->second;
    if (!room_.objects.writer.write(known.sample)) return false;
    pace_.spend(object_bytes);
    const std::string client = text_of(known.sample.client), name = text_of(known.sample.name);
    if (known.written_revision) digest_ -= digest_of(client, name, known.written_revision);
    else ++written_;
    known.written_revision = known.sample.revision;
    digest_ += digest_of(client, name, known.written_revision);
    known.is_queued = false;
  }
  return true;
}

// Its place is extrapolated until the next sample. Where it swings faster than samples are sent, its velocity at one instant would
// carry it far away; there the mean velocity since the last sample counts.
forceserver_Moved Outgoing::to_moved(const Known& known) {
  constexpr double tolerated = 5e-4;  // m, by which the two may lead to different places
  forceserver_Moved out = bridge::to_moved(known.sample);
  const double passed = known.motion.time - known.sent.time;
  if (!(passed > 0) || passed > 3 * motions_period) return out;
  const auto difference = [](const fs_vec3& a, const fs_vec3& b) { return fs_vec3{a.x - b.x, a.y - b.y, a.z - b.z}; };
  const auto length = [](const fs_vec3& v) { return std::hypot(v.x, v.y, v.z); };
  const fs_vec3 way = difference(known.motion.pose.position, known.sent.pose.position);
  const fs_vec3 mean = {way.x / passed, way.y / passed, way.z / passed};
  const double apart = length(difference(known.motion.twist.linear, mean));
  if (known.motion.horizon > 0 && (apart <= length(mean) || apart * motions_period <= tolerated)) return out;
  if (known.motion.horizon == 0) return out;  // it stands still
  const double twist[] = {mean.x, mean.y, mean.z};
  for (int i = 0; i < 3; ++i) out.twist[i] = static_cast<float>(twist[i]);
  return out;
}

// What has moved is sent at once where the last sample is old enough, so that it does not wait for its turn; and again, where
// nothing new has come, because samples may be lost.
void Outgoing::write_motions(double now) {
  const double least = are_many_ ? motions_period / 2 : motions_period;
  constexpr double early = 0.1;  // of the period: what moves with the same period must not wait for the next
  const bool is_news_due = has_news_ && std::fabs(now - last_news_) >= (1 - early) * least;
  if (!is_news_due && std::fabs(now - last_motions_) < repeat_period) return;
  if (has_news_) last_news_ = now;
  std::vector<Known*> moving;
  for (auto& [name, known] : known_) {
    if (known.is_moving && known.written_revision) moving.push_back(&known);
  }
  are_many_ = moving.size() > most_moves;
  motion_rate_ = are_many_ ? most_moves / (motions_period / 2 * static_cast<double>(moving.size())) : 1 / motions_period;
  last_motions_ = now;
  has_news_ = false;
  if (moving.empty()) return;
  const auto is_older = [](const Known* a, const Known* b) { return a->last_sent < b->last_sent; };
  if (are_many_) {
    has_news_ = true;  // not all of them are told
    std::nth_element(moving.begin(), moving.begin() + most_moves, moving.end(), is_older);
    moving.resize(most_moves);
  }
  std::sort(moving.begin(), moving.end(), is_older);
  std::vector<forceserver_Moved> moves;
  for (Known* known : moving) {
    moves.push_back(to_moved(*known));
    known->last_sent = now;
    known->sent = known->motion;
  }
  forceserver_Motions sample{};
  put_text(sample.site, site_);
  sample.session = session_;
  sample.number = ++number_;
  sample.sent = now;
  lend(sample.moves, moves);
  room_.motions.writer.write(sample);
}

void Outgoing::write(double now) {
  now_ = now;
  write_motions(now);
  pace_.advance(now);
  if (!write_clients() || !write_objects()) return;
  contents_.write(now);
}

void Outgoing::forget(double now) {
  ++generation_;
  ++change_;
  const auto size = static_cast<uint32_t>(known_.size());
  while (!known_.empty()) remove(known_.begin(), now, change_, size);
  to_write_.clear();
  clients_.clear();
  seen_ = 0;
}

void Outgoing::write_again() {
  std::vector<std::string> names;
  for (const auto& [name, known] : known_) {
    if (known.is_fetched && !known.is_queued) names.push_back(name);
  }
  for (auto& [name, client] : clients_) client.is_changed = true;
  queue_together(names);
}

}  // namespace bridge
