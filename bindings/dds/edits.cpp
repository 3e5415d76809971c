#include "edits.h"

#include <algorithm>
#include <cstring>

#include "say.h"

namespace bridge {
namespace {

constexpr double patience = 60;  // s: of the owner, for the contents of an edit
constexpr double answer_time = 3;  // s: of who asks; where contents go along the owner's patience comes on top
constexpr double echo = 0.2;    // s from an answer until the owner's object has come, too

bool is_same(const forceserver_Profile& a, const forceserver_Profile& b) {
  return a.kind == b.kind && a.sense == b.sense && a.gain == b.gain && a.shift == b.shift && a.width == b.width &&
         a.limit == b.limit && a.reach == b.reach && text_of(a.curve) == text_of(b.curve);
}
template <class T>
bool is_same(const T& a, const T& b) {  // of numbers without gaps
  return std::memcmp(&a, &b, sizeof a) == 0;
}

// The parts (fs_part) in which two objects differ. Times differ with every move, so they do not count.
uint32_t differing(const forceserver_ForceObject& a, const forceserver_ForceObject& b) {
  uint32_t out = 0;
  if (!is_same(a.place, b.place) || !is_same(a.motion, b.motion)) out |= FS_PART_POSE;
  if (!is_same(a.front, b.front) || !is_same(a.back, b.back) || a.damping != b.damping) out |= FS_PART_PROFILES;
  const forceserver_Contact &c = a.solid, &d = b.solid;
  const bool is_contact_same = c.keep == d.keep && c.stiffness == d.stiffness && c.limit == d.limit && c.damping == d.damping &&
                               c.friction == d.friction && text_of(a.finish) == text_of(b.finish);
  if (!is_contact_same) out |= FS_PART_CONTACT;
  if (a.primitive != b.primitive || text_of(a.form) != text_of(b.form)) out |= FS_PART_SHAPE;
  if (a.tool_points != b.tool_points || a.enabled != b.enabled) out |= FS_PART_OTHER;
  return out;
}

// What both have; `wanted` has no key, since not all vendors describe a type with keys in the same way within another one.
template <class From, class To>
void copy_wanted(const From& from, To& to) {
  to.primitive = from.primitive;
  to.place = from.place;
  to.motion = from.motion;
  to.time = from.time;
  to.start = from.start;
  to.horizon = from.horizon;
  to.front = from.front;
  to.back = from.back;
  to.damping = from.damping;
  to.solid = from.solid;
  put_text(to.form, from.form);
  put_text(to.finish, from.finish);
  to.tool_points = from.tool_points;
  to.enabled = from.enabled;
}

}  // namespace

void Edits::ask(double now) {
  incoming_.take_edits([&](const Incoming::LocalEdit& edit) { ask(edit, now); }, now);
  for (; !to_ask_.empty(); to_ask_.pop_front()) {
    if (!room_.edits.writer.write(to_ask_.front())) break;
  }
  for (; !to_answer_.empty(); to_answer_.pop_front()) {
    if (!room_.answers.writer.write(to_answer_.front())) break;
  }
  for (auto it = asked_.begin(); it != asked_.end();) {
    if (now < it->second.until) {
      ++it;
      continue;
    }
    undo(it->second, "its site does not answer", now);
    it = asked_.erase(it);
  }
}

void Edits::ask(const Incoming::LocalEdit& edit, double now) {
  RemoteObject& object = edit.client.objects.at(edit.object);
  forceserver_Edit sample{};
  Asked asked{edit.site.name, text_of(object.sample.client), edit.object, {}, now + answer_time};
  put_text(sample.site, asked.site);
  put_text(sample.client, asked.client);
  put_text(sample.name, edit.object);
  put_text(sample.asker, site_);
  put_text(sample.editor, edit.editor);
  sample.number = ++number_;
  try {
    const forceserver::Object now_there = edit.client.scene.object_get(edit.object);
    forceserver_ForceObject wanted{};
    const ContentsOfObject contents = ContentsOfObject::of(now_there);
    put_object(wanted, now_there);
    contents.put_keys(wanted);
    forceserver_ForceObject before{};
    put_object(before, incoming_.to_local(edit.site, object, edit.object));
    object.contents.put_keys(before);
    sample.parts = differing(wanted, before);
    if (sample.parts == 0) return;
    wanted.time = edit.site.clock.to_theirs(wanted.time - incoming_.shift());
    wanted.start = edit.site.clock.to_theirs(wanted.start - incoming_.shift());
    for (const fs_motion& motion : edit.client.scene.get_motions_since(edit.client.name.c_str(), edit.client.motions_seen)) {
      edit.client.motions_seen = std::max(edit.client.motions_seen, motion.motion_revision);
      if (edit.object == motion.name) wanted.horizon = motion.horizon;
    }
    copy_wanted(wanted, sample.wanted);
    // The owner has what it gave the object; only what is new goes along.
    const ContentsOfObject& had = object.contents;
    const std::pair<ContentRef, ContentRef> both[] = {
        {contents.shape, had.shape}, {contents.surface, had.surface}, {contents.front, had.front}, {contents.back, had.back}};
    for (const auto& [content, old] : both) {
      if (!content || (old && old->key == content->key)) continue;
      writer_.use(content);
      asked.contents.push_back(content->key);
      asked.until = now + answer_time + patience;
    }
  } catch (const forceserver::Error& error) {
    if (error.status() != FS_ERROR_NOT_FOUND) {
      complain(edit.client.name + "/" + edit.object + " was edited, but cannot be looked at: " + error.what());
      edit.client.due.insert(edit.object);  // as its owner has it
      return;
    }
    sample.removes = true;
    object.is_set = false;
  }
  // What the owner sends meanwhile is older than the edit: an editor that drags the object would feel it spring back.
  object.held_until = asked.until;
  to_ask_.push_back(sample);
  asked_.emplace(sample.number, std::move(asked));
}

void Edits::undo(const Asked& asked, const std::string& why, double now) {
  complain("the edit of " + asked.client + "/" + asked.object + " at site " + asked.site + " was not made: " + why);
  for (const std::string& key : asked.contents) writer_.unuse(key, now);
  hold(asked, now);
}

// Until then what the owner sends does not count, and from then on the object is as its owner has it; unless another edit waits
// for its answer.
void Edits::hold(const Asked& asked, double until) {
  RemoteSite* const site = incoming_.find(asked.site);
  const auto is_same = [&](const auto& other) {
    return &other.second != &asked && other.second.object == asked.object && other.second.client == asked.client;
  };
  if (!site || std::any_of(asked_.begin(), asked_.end(), is_same)) return;
  const auto client = site->clients.find(asked.client);
  if (client == site->clients.end()) return;
  const auto object = client->second.objects.find(asked.object);
  if (object == client->second.objects.end()) return;
  object->second.held_until = until;
  client->second.due.insert(asked.object);
}

void Edits::take_answer(const forceserver_Answer& answer, double now) {
  const auto found = asked_.find(answer.number);
  if (found == asked_.end() || text_of(answer.answerer) != found->second.site) return;
  if (answer.result < 0) {
    undo(found->second, text_of(answer.text), now);
  } else {
    hold(found->second, now + echo);
    for (const std::string& key : found->second.contents) writer_.unuse(key, now);
  }
  asked_.erase(found);
}

void Edits::take(const forceserver::Scene& scene, double now) {
  room_.edits.reader.take([&](const forceserver_Edit& sample, const dds_sample_info_t& info) {
    if (info.valid_data && text_of(sample.site) == site_) waiting_.push_back({sample, now});
  });
  for (size_t left = waiting_.size(); left > 0; --left) {
    const Waiting next = waiting_.front();
    waiting_.pop_front();
    if (try_edit(scene, next.sample, now)) continue;
    if (now - next.since > patience) {
      answer(next.sample, FS_ERROR_TIMEOUT, "the shape, curve or surface of the edit has not come");
    } else {
      waiting_.push_back(next);
    }
  }
}

bool Edits::try_edit(const forceserver::Scene& own, const forceserver_Edit& edit, double now) {
  const std::string client = text_of(edit.client), name = client + "/" + text_of(edit.name), from = text_of(edit.asker);
  if (client.find('@') != std::string::npos) {
    answer(edit, FS_ERROR_NOT_FOUND, "the object belongs to another site");
    return true;
  }
  // By the editor's own connection, so that the owner is told who it was.
  const forceserver::Scene* scene = incoming_.scene_of(from, text_of(edit.editor), true, now);
  if (!scene) scene = &own;
  const RemoteSite* const site = incoming_.find(from);
  try {
    if (edit.removes) {
      scene->object_remove(name);
    } else {
      forceserver::Object object = scene->object_get(name);
      forceserver_ForceObject asked{};
      copy_wanted(edit.wanted, asked);
      const fs_object wanted = to_c(asked, "");
      bool is_whole = true;
      const auto get = [&](const auto& key) -> ContentRef {
        ContentRef content = *key ? writer_.find(text_of(key)) : nullptr;
        if (*key && !content) content = contents_.find(text_of(key), now);
        if (*key && !content) is_whole = false;
        return content;
      };
      // What of the object the edit does not change keeps its handles.
      fs_object change = object;
      ContentsOfObject contents;
      if (edit.parts & FS_PART_SHAPE) {
        contents.shape = get(asked.form);
        change.primitive = wanted.primitive;
        change.shape = contents.shape ? contents.shape->shape.get() : nullptr;
      }
      if (edit.parts & FS_PART_CONTACT) {
        contents.surface = get(asked.finish);
        change.contact = wanted.contact;
        change.surface = contents.surface ? contents.surface->surface.get() : nullptr;
      }
      if (edit.parts & FS_PART_PROFILES) {
        contents.front = get(asked.front.curve);
        contents.back = get(asked.back.curve);
        change.front = wanted.front;
        change.back = wanted.back;
        change.damping = wanted.damping;
        change.front.curve = contents.front ? contents.front->curve.get() : nullptr;
        change.back.curve = contents.back ? contents.back->curve.get() : nullptr;
      }
      if (edit.parts & FS_PART_OTHER) {
        change.tool_points = wanted.tool_points;
        change.enabled = wanted.enabled;
      }
      if (edit.parts & FS_PART_POSE) {
        change.pose = wanted.pose;
        change.twist = {};
        // A motion that ends earlier than all motions of a set would go on for too long.
        constexpr double whole = 0.1;  // s
        if (edit.wanted.horizon >= whole) change.twist = wanted.twist;
        change.time = asked.horizon > 0 && site ? site->clock.to_ours(wanted.time) + incoming_.shift() : FS_NOW;
      }
      if (!is_whole) return false;
      scene->object_change(change,
                           edit.parts & (FS_PART_POSE | FS_PART_PROFILES | FS_PART_CONTACT | FS_PART_SHAPE | FS_PART_OTHER));
    }
    say(name + " was " + (edit.removes ? "removed" : "edited") + " by " + text_of(edit.editor) + " at site " + from);
    answer(edit, FS_OK, "");
  } catch (const forceserver::Error& error) {
    answer(edit, error.status(), error.what());
  }
  return true;
}

void Edits::answer(const forceserver_Edit& edit, fs_status status, const std::string& text) {
  forceserver_Answer out{};
  put_text(out.site, text_of(edit.asker));
  put_text(out.answerer, site_);
  out.number = edit.number;
  out.result = status;
  put_text(out.text, text);
  to_answer_.push_back(out);
}

}  // namespace bridge
