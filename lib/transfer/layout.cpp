#include "transfer/layout.h"

#include <cstddef>
#include <type_traits>
#include <vector>

#include "base/hash.h"
#include "transfer/shared_memory.h"

namespace fs::wire {
namespace {

template <class T>
constexpr char kind_of() {
  using Element = std::remove_all_extents_t<T>;
  if constexpr (requires { Element::is_always_lock_free; }) return kind_of<typename Element::value_type>();  // atomic
  else if constexpr (std::is_same_v<Element, char>) return 'c';
  else if constexpr (std::is_floating_point_v<Element>) return 'f';
  else if constexpr (std::is_enum_v<Element>) return 'i';
  else if constexpr (std::is_integral_v<Element>) return std::is_signed_v<Element> ? 'i' : 'u';
  else return 'r';
}

struct Field {
  const char* name;
  size_t offset, size;
  char kind;
};

// A record is its fields, one after the other: a field that is left out, or padding, does not compile.
template <class... Size>
constexpr size_t sum(Size... sizes) {
  return (sizes + ... + 0);
}

class Table {
 public:
  void add(const char* record, std::initializer_list<Field> fields) {
    for (const Field& f : fields) {
      text_ += std::string(record) + ' ' + f.name + ' ' + std::to_string(f.offset) + ' ' + std::to_string(f.size) + ' ' +
               f.kind + '\n';
    }
  }
  std::string text_;
};

#define FIELD(record, field) \
  Field { #field, offsetof(record, field), sizeof(record::field), kind_of<decltype(record::field)>() }
#define SIZE(record, field) sizeof(record::field)

#define EACH_1(m, r, a) m(r, a)
#define EACH_2(m, r, a, ...) m(r, a), EACH_1(m, r, __VA_ARGS__)
#define EACH_3(m, r, a, ...) m(r, a), EACH_2(m, r, __VA_ARGS__)
#define EACH_4(m, r, a, ...) m(r, a), EACH_3(m, r, __VA_ARGS__)
#define EACH_5(m, r, a, ...) m(r, a), EACH_4(m, r, __VA_ARGS__)
#define EACH_6(m, r, a, ...) m(r, a), EACH_5(m, r, __VA_ARGS__)
#define EACH_7(m, r, a, ...) m(r, a), EACH_6(m, r, __VA_ARGS__)
#define EACH_8(m, r, a, ...) m(r, a), EACH_7(m, r, __VA_ARGS__)
#define PICK(_1, _2, _3, _4, _5, _6, _7, _8, name, ...) name
#define EACH(m, r, ...) \
  PICK(__VA_ARGS__, EACH_8, EACH_7, EACH_6, EACH_5, EACH_4, EACH_3, EACH_2, EACH_1)(m, r, __VA_ARGS__)

#define RECORD(record, ...)                                                                                       \
  static_assert(sum(EACH(SIZE, record, __VA_ARGS__)) == sizeof(record) && std::is_trivially_copyable_v<record> && \
                std::is_standard_layout_v<record>);                                                               \
  table.add(#record, {EACH(FIELD, record, __VA_ARGS__)})

// A part of a shared region. It may have padding; but as the structured binding needs a name for each member, a member that is
// left out does not compile.
#define REGION(region, ...)                                                          \
  (void)[](const region& all) { [[maybe_unused]] const auto& [__VA_ARGS__] = all; }; \
  table.add(#region, {EACH(FIELD, region, __VA_ARGS__)})

std::string make_layout_text() {
  Table table;
  RECORD(Header, type, reserved, serial);
  RECORD(Group, bytes);
  RECORD(Welcome, inbox_bytes, outbox_bytes, max_objects, is_virtual, is_locked, rate);
  RECORD(Reply, status, reserved, text);
#define ADD(record, field) table.add(#record, {FIELD(record, field)});
  FORCESERVER_CONTRACT_FIELDS(ADD)
  RECORD(Set, slot, parts, object);
  RECORD(Motion, pose, twist, time, horizon);
  RECORD(Place, name, motion);
  RECORD(Remove, name);
  RECORD(Bind, slot, reserved, name);
  RECORD(Frame, frame);
  RECORD(Clutch, is_held);
  RECORD(Tool, count, points);
  RECORD(Shape, id, primitive, is_closed, point_count, triangle_count);
  RECORD(Curve, id, count, step, expression);
  RECORD(Forget, id);
  RECORD(Target, name);
  RECORD(Fetch, id);
  RECORD(After, number);
  RECORD(Edit, target, parts, object);
  RECORD(MoveOther, target, has_twist, pose, twist, time);
  RECORD(Count, count);
  RECORD(Pulled, state, slot, news, object, motion, frame, tool);
  RECORD(Move, after, motion);
  RECORD(HandSample, state, response, sent);
  RECORD(EventSlot, number, event);
  REGION(Outbox, servo, heartbeat, is_closed, is_asleep, news, applied, events_written, events);
  REGION(ServoOutput, time, tick, used, hand);
  REGION(InboxHead, batch, has_left, summary);
  table.add("Inbox", {{"slot", 0, sizeof(Seqlock<Move>), 'r'}, {"event", 0, sizeof(Seqlock<EventSlot>), 'r'},
                      {"types", 0, type_reply, 'u'}});
  return table.text_;
}

// The lines of a text, one at a time.
std::string_view next_line(std::string_view& rest) {
  const size_t end = rest.find('\n');
  const std::string_view line = rest.substr(0, end);
  rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
  return line;
}

std::string told(std::string_view line) {
  if (line.empty()) return "nothing more";
  std::vector<std::string_view> words;
  while (!line.empty()) {
    const size_t end = line.find(' ');
    words.push_back(line.substr(0, end));
    line.remove_prefix(end == std::string_view::npos ? line.size() : end + 1);
  }
  words.resize(5);
  return "record " + std::string(words[0]) + ", field " + std::string(words[1]) + " of " + std::string(words[3]) +
         " bytes at " + std::string(words[2]);
}

}  // namespace

const std::string& layout_text() {
  static const std::string& text = *new std::string(make_layout_text());  // never destroyed: a server may still run
  return text;
}

uint64_t layout_id() { return hash_of(layout_text()); }

std::string layout_difference(std::string_view client, std::string_view server) {
  while (!client.empty() || !server.empty()) {
    const std::string_view ours = next_line(client), theirs = next_line(server);
    if (ours != theirs) return "the client has " + told(ours) + ", the server " + told(theirs);
  }
  return "";
}

}  // namespace fs::wire
