// What the client asks of the server: requests, and what there is now where others have changed its objects or a change
// of its own was refused. Nobody waits with the lock.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <thread>
#include <utility>

#include "base/error.h"
#include "client/remote_scene.h"

namespace fs {
namespace {

constexpr double answer_limit = 1;     // s, that a call waits for the server
constexpr double longest_wait = 2e-3;  // s: another thread may take in the answer
constexpr size_t most_fetched = 8;     // shapes, and curves, that are kept for the next who asks

// What the fetched list has under the server's number; null: nothing.
template <class List>
auto find_fetched(const List& list, uint64_t id) {
  const auto found = std::find_if(list.begin(), list.end(), [id](const auto& entry) { return entry.first == id; });
  return found == list.end() ? nullptr : found->second;
}

template <class List, class Thing>
void keep_fetched(List& list, uint64_t id, const Thing& thing) {
  list.emplace_back(id, thing);
  if (list.size() > most_fetched) list.pop_front();
}

}  // namespace

// Not after a loss; and in a forked child not even to the lock, which nobody there may ever give back.
RemoteScene::Call RemoteScene::enter(double* steady) const {
  if (connection_.is_forked()) connection_.check();
  Lock lock(mutex_);
  const double now = steady_now();
  connection_.check(now);
  if (steady) *steady = now;
  return {std::move(lock), answer_limit, now + answer_limit};
}

bool RemoteScene::try_pause(Call& call, bool is_for_room) {
  const double rest = std::fmin(call.end - steady_now(), longest_wait);
  if (!(rest > 0)) return false;
  call.lock.unlock();
  if (is_for_room) {
    connection_.wait_for_room(rest);
    // Room alone is not enough where too many descriptors are on their way.
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  } else {
    connection_.wait(rest);
  }
  call.lock.lock();
  connection_.check();
  return true;
}

void RemoteScene::pause(Call& call, bool is_for_room) {
  if (try_pause(call, is_for_room)) return;
  fail(FS_ERROR_TIMEOUT, is_for_room ? "the server has not taken earlier changes within %g s"
                                     : "the server has not answered within %g s", call.limit);
}

Answer RemoteScene::request(Call& call, wire::Type type, std::span<const std::byte> body) {
  uint64_t serial;
  while (!(serial = connection_.ask(type, body))) pause(call, true);
  try {
    Answer answer;
    while (!connection_.take_answer(serial, answer)) pause(call, false);
    return answer;
  } catch (...) {
    connection_.give_up(serial);
    throw;
  }
}

// ------------------------------------------------------------------------------------------------ what there is now

// While there is one, changes of own objects are noted.
struct RemoteScene::Asking {
  explicit Asking(RemoteScene& the_scene) : scene(the_scene), number(++scene.question_) { ++scene.open_questions_; }
  ~Asking() { scene.end_question(); }
  RemoteScene& scene;
  const uint64_t number;
};

void RemoteScene::end_question() noexcept {
  if (--open_questions_ == 0) touched_.clear();
}

void RemoteScene::touch(const Change& change) {
  if (open_questions_ == 0) return;
  if (change.type == wire::type_clear) all_touched_ = question_;
  const bool is_view = change.type == wire::type_frame || change.type == wire::type_tool;
  touched_[is_view ? change.type == wire::type_frame ? "/frame" : "/tool" : change.name] = question_;
}

bool RemoteScene::is_touched(std::string_view name, uint64_t question) const {
  const auto found = touched_.find(name);
  return found != touched_.end() && found->second >= question;
}

bool RemoteScene::is_current() const noexcept {
  return !pull_ && !pulled_ && connection_.outbox()->edits.load(std::memory_order_acquire) == edits_seen_;
}

// Takes in what has come, and asks for the next; never waits. Not while a group is open: it began without.
void RemoteScene::look() {
  while (!group_) {
    if (pull_) {
      Answer answer;
      try {
        if (!connection_.take_answer(*pull_, answer)) return;
        pulled_ = answer.as<wire::Pulled>();
      } catch (const Error&) {
        if (!connection_.is_awaited(*pull_)) {  // it will be asked again
          pull_.reset();
          end_question();
        }
        throw;
      }
      pull_.reset();
    }
    if (pulled_) {
      try {
        edits_seen_ = pulled_->edits;
        adopt(*pulled_, pull_question_);
      } catch (const Error&) {  // it cannot be had as it is
        pulled_.reset();
        end_question();
        throw;
      }
      pulled_.reset();
      end_question();
    }
    if (is_current() || !start_pull()) break;
  }
  if (!group_) forget_unused();
}

// False: there is no room.
bool RemoteScene::start_pull() {
  const wire::Target next{};
  const uint64_t serial = connection_.ask(wire::type_pull, bytes_of(&next, 1));
  if (!serial) return false;
  pull_ = serial;
  pull_question_ = ++question_;
  ++open_questions_;
  return true;
}

// Waits until the client knows what the server has. What has to be fetched for it: name: of that object; null: of all;
// "": nothing.
void RemoteScene::catch_up(Call& call, const char* name) {
  // Who edits without a pause is not waited for.
  const uint64_t wanted = connection_.outbox()->edits.load(std::memory_order_acquire);
  size_t fetches = 2 * size_t{connection_.welcome().max_objects} + 1;
  for (;;) {
    look();
    if (group_) return;
    const bool is_known = edits_seen_ >= wanted && !pulled_;
    if (!is_known) {
      pause(call, !pull_);
      continue;
    }
    const auto next = name ? behind_.find(std::string_view(name)) : behind_.begin();
    if (next == behind_.end() || fetches-- == 0) return;
    fetch_behind(call, std::string(*next));
  }
}

// Asks for one object and fetches what it consists of.
void RemoteScene::fetch_behind(Call& call, const std::string& name) {
  const wire::Target target = to_target(name.c_str(), "name");
  for (int i = 0; i < most_tries; ++i) {
    const Asking asking(*this);
    const auto pulled = request(call, wire::type_pull, bytes_of(&target, 1)).as<wire::Pulled>();
    if (group_) return;
    if (pulled.state != wire::pulled_present || is_touched(name, asking.number) || all_touched_ >= asking.number ||
        is_here(pulled.object)) {
      return adopt(pulled, asking.number);
    }
    try {
      const Received received = receive(call, pulled.object);
      if (group_ || is_touched(name, asking.number) || all_touched_ >= asking.number) return;
      take_over(pulled, received, asking.number);
      behind_.erase(name);
      return publish();
    } catch (const Error& error) {  // it was changed again before it was fetched
      if (error.status != FS_ERROR_NOT_FOUND) throw;
    }
  }
}

// The replica becomes what the server has, unless this client has changed that since it asked.
void RemoteScene::adopt(const wire::Pulled& pulled, uint64_t question) {
  flush_ahead();
  const std::string name = text_of(pulled.object.name);
  const auto slot = slots_.find(name);
  const bool is_of_object = pulled.state >= wire::pulled_present && pulled.state <= wire::pulled_refused;
  const bool is_newer_here = is_touched(name, question) || all_touched_ >= question;
  if (is_of_object && (is_newer_here || (pulled.state == wire::pulled_present && !is_here(pulled.object)))) {
    behind_.insert(name);  // to be asked again; or its shape has to be fetched first, by whoever needs it
    return;
  }
  switch (pulled.state) {
    case wire::pulled_present: {
      Received received{from_record(pulled.object), find_shape(pulled.object.shape), find_curve(pulled.object.front.curve),
                        find_curve(pulled.object.back.curve)};
      received.link();
      take_over(pulled, received, question);
      break;
    }
    case wire::pulled_absent:
      if (slot == slots_.end()) break;
      replica_->remove(name.c_str());
      release_index(slot->second);
      drop_slot(slot);
      break;
    case wire::pulled_refused:
      if (slot == slots_.end()) break;
      release_index(slot->second);
      note_refused(slot->second, true);
      break;
    case wire::pulled_data:
      if (const auto data = data_.find(pulled.object.shape); data != data_.end()) data->second.is_refused = true;
      break;
    case wire::pulled_view:
      if (!is_touched("/frame", question)) replica_->set_frame(pulled.frame.frame);
      if (!is_touched("/tool", question)) {
        replica_->set_tool(pulled.tool.points, std::min<size_t>(pulled.tool.count, FS_TOOL_POINTS_MAX));
      }
      break;
    default: break;
  }
  if (is_of_object || pulled.state == wire::pulled_waiting) behind_.erase(name);
  publish();
}

// An own object as the server has it. Where this client did not know of it, it gets a slot and the server is told.
void RemoteScene::take_over(const wire::Pulled& pulled, const Received& received, uint64_t question) {
  flush_ahead();
  const std::string name = text_of(pulled.object.name);
  auto slot = slots_.find(name);
  const bool is_new = slot == slots_.end();
  const bool was_moved = !is_new && slot->second.moved_in >= question;
  const Movement newest = was_moved ? replica_->movement(name.c_str()) : Movement{};
  replica_->set(received.object);
  if (was_moved) {
    replica_->set_movement(name.c_str(), newest);
  } else {
    replica_->set_motion(name.c_str(), from_record(pulled.movement));
  }
  if (is_new) slot = slots_.emplace(name, Slot{}).first;
  fs_object object;
  note_object(slot->second, replica_->get(name.c_str(), object).get());
  note_refused(slot->second, false);
  Slot& known = slot->second;
  if (known.index != wire::no_slot && known.index == pulled.slot) return;
  if (known.index == wire::no_slot) known.index = take_index();
  if (known.index == wire::no_slot) return;  // it is moved by messages
  wire::Bind bind{known.index, 0, {}};
  put_text(bind.name, name);
  known.after = connection_.send(wire::type_bind, bytes_of(&bind, 1));
  if (known.after == 0) release_index(known);
}

// ------------------------------------------------------------------------------------------------- shapes and curves

// Whether nothing has to be fetched for it.
bool RemoteScene::is_here(const wire::Object& record) const {
  return (!record.shape || find_shape(record.shape)) && (!record.front.curve || find_curve(record.front.curve)) &&
         (!record.back.curve || find_curve(record.back.curve));
}

// By the number that the server gives them: this client's own, or its own. Null: not here.
Ref<const Shape> RemoteScene::find_shape(uint64_t id) const {
  if (id & wire::of_server) return find_fetched(fetched_shapes_, id);
  const auto own = data_.find(id);
  return own == data_.end() ? nullptr : own->second.shape;
}

Ref<const Curve> RemoteScene::find_curve(uint64_t id) const {
  if (id & wire::of_server) return find_fetched(fetched_curves_, id);
  const auto own = data_.find(id);
  return own == data_.end() ? nullptr : own->second.curve;
}

void RemoteScene::Received::link() {
  object.shape = const_cast<fs_shape*>(shape.get());
  object.front.curve = const_cast<fs_curve*>(front.get());
  object.back.curve = const_cast<fs_curve*>(back.get());
}

// The handles of a record; what is not here is fetched. NOT_FOUND: the server offers it no more.
RemoteScene::Received RemoteScene::receive(Call& call, const wire::Object& record) {
  Received out{from_record(record), receive_shape(call, record.shape), receive_curve(call, record.front.curve),
               receive_curve(call, record.back.curve)};
  out.link();
  return out;
}

Answer RemoteScene::fetch(Call& call, uint64_t id) {
  if (!(id & wire::of_server)) fail(FS_ERROR_NOT_FOUND, "the shape or curve is not there any more");
  call.end = std::fmax(call.end, steady_now() + answer_limit);  // each may be large
  const wire::Fetch fetch{id};
  return request(call, wire::type_fetch, bytes_of(&fetch, 1));
}

Ref<const Shape> RemoteScene::receive_shape(Call& call, uint64_t id) {
  if (id == 0) return nullptr;
  if (Ref<const Shape> known = find_shape(id)) return known;
  Answer answer = fetch(call, id);
  answer.require_data();
  Wanted wanted;
  const Ref<const Shape> shape = unpack({wire::type_shape, answer.as<wire::Shape>(), {}, std::move(answer.data)}, wanted).shape;
  keep_fetched(fetched_shapes_, id, shape);
  return shape;
}

Ref<const Curve> RemoteScene::receive_curve(Call& call, uint64_t id) {
  if (id == 0) return nullptr;
  if (Ref<const Curve> known = find_curve(id)) return known;
  Answer answer = fetch(call, id);
  const auto record = answer.as<wire::Curve>();
  if (record.count) answer.require_data();
  Wanted wanted;
  const Ref<const Curve> curve = unpack({wire::type_curve, {}, record, std::move(answer.data)}, wanted).curve;
  keep_fetched(fetched_curves_, id, curve);
  return curve;
}

}  // namespace fs
