// The datagrams between a host and a FIDEL's controller: what UDP.md describes, as structures, and their bytes. A message is
// valid when it comes out of `decode`: all of its numbers are finite, and its texts end.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <limits>

#include <forceserver/driver.h>

namespace fs::udp {

constexpr uint16_t usual_port = 47811;
constexpr uint8_t protocol_version = 1;
constexpr size_t header_size = 24, checksum_size = 4, largest_datagram = 600;  // bytes

// Times of the protocol, s.
constexpr double hold = 0.05;  // for which a command counts at the controller, at most
constexpr double fade = 0.05;  // in which its force goes afterwards, and comes back
constexpr double stale_after = 0.25;  // after a state, a command that answers it is of no use
constexpr double host_lost_after = 0.5;  // of silence the controller is free for another host
constexpr double lost_after = 0.25;  // of silence the controller counts as lost
constexpr double hello_interval = 0.1;  // from one HELLO to the next, until a WELCOME comes
constexpr double connect_within = 1.5;
constexpr double request_interval = 0.2;  // from one REQUEST to the next, until an ANSWER that is final comes
constexpr double answer_within = 2;  // of silence the host takes a request for not answered
constexpr double done_within = 30;  // a request is done, or the host gives up

// The text, cut where it is longer.
template <size_t n>
void copy_text(char (&out)[n], const char* text) {
  std::snprintf(out, n, "%s", text);
}

enum class Type : uint8_t { hello = 1, welcome, busy, state, command, model, request, answer, bye };
enum class Reason : uint32_t { ends = 0, silent = 1, unknown_session = 2, controller_ends = 3, version = 4 };

struct Header {
  Type type;
  uint64_t session;  // drawn by the host for each connection; never 0
  uint32_t number;  // counts this sender's datagrams of this kind within the session, from 1
};

struct Hello {
  float rate = 0;  // Hz, how many states the host wants
  char name[32] = {};  // of the host, for people
};
struct Welcome {
  uint64_t time = 0;  // ns, the controller's clock
  uint32_t hello = 0;  // the number of the HELLO that it answers
  float rate = 0;  // Hz, how many states will come
  uint32_t force_axes = 0, torque_axes = 0;
  float workspace_radius = 0, workspace_height = 0, workspace_angle = 0, force_max = 0, torque_max = 0;  // as fs_device_info
  float resolution = 0, damping = 0, mass = 0, controller_rate = 0, controller_delay = 0, controller_damping = 0;
  char name[64] = {}, serial[64] = {};
};
struct Busy {
  uint32_t answers = 0;  // the number of the datagram that it answers, of any type
  char holder[64] = {};  // who has the controller
};
struct State {
  uint64_t time = 0, sent = 0;  // ns, the controller's clock: of the pose, and when this datagram was sent
  uint64_t command_time = 0;  // ns, the controller's clock, when the newest command came; 0: none has
  uint32_t command = 0;  // its number
  uint32_t came = 0;  // how many commands have come, each counted once
  uint32_t ignored = 0;  // datagrams that the controller could not use since it was started
  uint32_t flags = 0, buttons = 0;
  float grip = 0;
  fs_pose pose{{0, 0, 0}, {1, 0, 0, 0}};
  fs_twist twist{};
  fs_wrench applied{};  // what the motors give at present
};
// A plain force where is_model is false; of a model as fs_model.
struct Command {
  bool is_model = false;
  uint32_t state = 0;  // the number of the state that it answers; 0: none
  fs_wrench force{};
  float hold = 0;  // s
  fs_pose pose{{0, 0, 0}, {1, 0, 0, 0}};
  fs_mat3 dfdx{}, dtdr{};
};
struct Request {
  char text[256] = {};
};
constexpr int32_t still_being_done = 1;
struct Answer {
  uint32_t request = 0;
  int32_t status = 0;  // an fs_status, or still_being_done: the final one follows
  char text[512] = {};
};
struct Bye {
  Reason reason = Reason::ends;
};

struct Datagram {
  uint8_t bytes[largest_datagram];
  size_t size = 0;
};

// A measure as it is sent, in 4 bytes: what is beyond the largest float becomes that. What is not finite stays so, and is refused
// by who reads it.
inline float to_single(double value) noexcept {
  constexpr double most = static_cast<double>(std::numeric_limits<float>::max());
  return static_cast<float>(std::isfinite(value) ? std::clamp(value, -most, most) : value);
}

// Each gives the bytes of a message. Nothing throws or allocates.
Datagram encode(const Header& header, const Hello& message) noexcept;
Datagram encode(const Header& header, const Welcome& message) noexcept;
Datagram encode(const Header& header, const Busy& message) noexcept;
Datagram encode(const Header& header, const State& message) noexcept;
Datagram encode(const Header& header, const Command& message) noexcept;  // header.type follows from is_model
Datagram encode(const Header& header, const Request& message) noexcept;
Datagram encode(const Header& header, const Answer& message) noexcept;
Datagram encode(const Header& header, const Bye& message) noexcept;

enum class Opened { good, garbage, other_version };
// Whether the bytes are a datagram of this protocol, whole and undamaged; of another version only the header is known.
Opened open(const void* bytes, size_t size, Header& out) noexcept;

// The message of a datagram that `open` found good and of this type; false: it is not valid.
bool decode(const void* bytes, size_t size, Hello& out) noexcept;
bool decode(const void* bytes, size_t size, Welcome& out) noexcept;
bool decode(const void* bytes, size_t size, Busy& out) noexcept;
bool decode(const void* bytes, size_t size, State& out) noexcept;
bool decode(const void* bytes, size_t size, Command& out) noexcept;
bool decode(const void* bytes, size_t size, Request& out) noexcept;
bool decode(const void* bytes, size_t size, Answer& out) noexcept;
bool decode(const void* bytes, size_t size, Bye& out) noexcept;

uint32_t checksum(const void* bytes, size_t size) noexcept;  // CRC-32 of IEEE 802.3

}  // namespace fs::udp
