#include "client/pulls.h"

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "base/text.h"
#include "transfer/records.h"

namespace fs {

constexpr int most_tries = 4;  // to get an object that others change again and again

bool Pulls::is_current() const noexcept {
  return !asked_ && !pulled_ && connection_.outbox()->news.load(std::memory_order_acquire) == news_seen_;
}

// The question of a pull is closed when the replica has taken in the answer, or could not.
void Pulls::look() {
  while (!groups_.mine()) {
    if (asked_) {
      take_answer();
      if (asked_) return;
    }
    if (pulled_) {
      try {
        news_seen_ = pulled_->news;
        adopt(*pulled_, question_);
      } catch (const Error&) {  // the replica cannot take it in
        pulled_.reset();
        questions_.close();
        throw;
      }
      pulled_.reset();
      questions_.close();
    }
    if (is_current() || !start_pull()) break;
  }
  if (!groups_.mine()) sent_.forget_unused(is_current());
}

void Pulls::take_answer() {
  Answer answer;
  try {
    if (!connection_.take_answer(*asked_, answer)) return;
    pulled_ = answer.as<wire::PullAnswer>();
  } catch (const Error&) {
    if (!connection_.is_awaited(*asked_)) {  // the next look asks again
      asked_.reset();
      questions_.close();
    }
    throw;
  }
  asked_.reset();
}

// False: there is no room.
bool Pulls::start_pull() {
  const wire::Target next{};
  const uint64_t serial = connection_.ask(wire::type_pull, bytes_of(&next, 1));
  if (!serial) return false;
  asked_ = serial;
  question_ = questions_.open();
  return true;
}

void Pulls::catch_up(Call& call, const char* name) {
  // Bounded, so a client that edits continuously cannot hold this call.
  const uint64_t wanted = connection_.outbox()->news.load(std::memory_order_acquire);
  size_t fetches = 2 * size_t{connection_.welcome().max_objects} + 1;
  for (;;) {
    look();
    if (groups_.mine()) return;
    const bool is_known = is_current() || (news_seen_ >= wanted && !pulled_);
    if (!is_known) {
      line_.pause(call, !asked_);
      continue;
    }
    const auto next = name ? behind_.find(std::string_view(name)) : behind_.begin();
    if (next == behind_.end() || fetches-- == 0) return;
    fetch_behind(call, std::string(*next));
  }
}

void Pulls::catch_up_in_time(Call& call) {
  for (;;) {
    look();
    if (groups_.mine() || is_current() || !line_.try_pause(call, !asked_)) return;
  }
}

// Asks for one object, and fetches its shape and curves.
void Pulls::fetch_behind(Call& call, const std::string& name) {
  const wire::Target target = to_target(name.c_str(), "name");
  for (int i = 0; i < most_tries; ++i) {
    const Questions::OpenQuestion asking(questions_);
    const auto pulled = line_.request(call, wire::type_pull, target).as<wire::PullAnswer>();
    if (groups_.mine()) return;
    if (pulled.state != wire::pulled_present || questions_.is_object_changed(name, asking.number) ||
        fetched_.is_here(pulled.object)) {
      return adopt(pulled, asking.number);
    }
    try {
      const LinkedObject received = fetched_.receive(call, pulled.object);
      if (groups_.mine() || questions_.is_object_changed(name, asking.number)) return;
      take_over(pulled, received, asking.number);
      behind_.erase(name);
      return replica_.post();
    } catch (const Error& error) {  // the object was changed again meanwhile
      if (error.status != FS_ERROR_NOT_FOUND) throw;
    }
  }
}

// Changes the replica to what the server has, unless this client has changed the same since it asked.
void Pulls::adopt(const wire::PullAnswer& pulled, uint64_t question) {
  replica_.catch_up_with_moves();
  const std::string name = text_of(pulled.object.name);
  OwnObject* const own = replica_.objects.find(name);
  const bool is_of_object = pulled.state >= wire::pulled_present && pulled.state <= wire::pulled_refused;
  const bool is_here = pulled.state != wire::pulled_present || fetched_.is_here(pulled.object);
  if (is_of_object && (questions_.is_object_changed(name, question) || !is_here)) {
    behind_.insert(name);  // it is asked for again; or its assets are fetched by a call that needs it
    return;
  }
  switch (pulled.state) {
    case wire::pulled_present: take_over(pulled, fetched_.link(pulled.object), question); break;
    case wire::pulled_absent:
      if (!own) break;
      replica_.scene->remove(name.c_str());
      replica_.objects.numbers.give(own->slot);
      replica_.objects.drop(name);
      break;
    case wire::pulled_refused:
      if (!own) break;
      replica_.objects.numbers.give(std::exchange(own->slot, wire::no_slot));
      replica_.objects.note_refused(*own, true);
      break;
    case wire::pulled_asset: sent_.note_refused(pulled.object.shape); break;
    case wire::pulled_view:
      if (!questions_.is_changed(Questions::frame, question)) replica_.scene->set_frame(pulled.frame.frame);
      if (!questions_.is_changed(Questions::tool, question)) {
        replica_.scene->set_tool(pulled.tool.points, std::min<size_t>(pulled.tool.count, FS_TOOL_POINTS_MAX));
        try {
          replica_.scene->set_tool_radius(pulled.tool_radius.radius);
        } catch (const Error&) {  // it still has a solid mesh, which the server has no more
        }
      }
      break;
    default: break;
  }
  if (is_of_object || pulled.state == wire::pulled_waiting) behind_.erase(name);
  replica_.post();
}

// Puts an own object into the replica as the server has it; but moves that this client has made since it asked count.
void Pulls::take_over(const wire::PullAnswer& pulled, LinkedObject received, uint64_t question) {
  replica_.catch_up_with_moves();
  const std::string name = text_of(pulled.object.name);
  LocalScene& scene = *replica_.scene;
  const OwnObject* const before = replica_.objects.find(name);
  const bool was_moved = before && before->moved_in >= question;
  const Movement newest = was_moved ? scene.movement(name.c_str()) : Movement{};
  // The group that sent it wrote the least number for the first instant of a virtual clock. Another start counts as given if it
  // is not the one that the replica has.
  if (received.object.start == std::numeric_limits<double>::min()) received.object.start = 0;
  scene.set(received.object);
  if (was_moved) {
    scene.set_movement(name.c_str(), newest);
  } else {
    scene.set_motion(name, from_record(pulled.motion));
  }
  OwnObject& own = replica_.objects.add(name);
  fs_object object;
  replica_.objects.note_object(own, scene.get(name.c_str(), object).get());
  replica_.objects.note_refused(own, false);
  if (own.slot != wire::no_slot && own.slot == pulled.slot) return;
  // Tells the server through which slot the object is moved from now on.
  SlotNumbers& numbers = replica_.objects.numbers;
  if (own.slot == wire::no_slot) own.slot = numbers.take();
  if (own.slot == wire::no_slot) return;  // it is moved by messages
  wire::Bind bind{own.slot, 0, {}};
  put_text(bind.name, name);
  own.after = connection_.send(wire::type_bind, bytes_of(&bind, 1));
  if (own.after == 0) numbers.give(std::exchange(own.slot, wire::no_slot));
}

}  // namespace fs
