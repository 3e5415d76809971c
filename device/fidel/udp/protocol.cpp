#include "device/fidel/udp/protocol.h"

#include <array>
#include <cmath>
#include <cstring>

#include "math/pose.h"

namespace fs::udp {
namespace {

constexpr uint32_t magic = 0x4c444946;  // the bytes "FIDL"

constexpr std::array<uint32_t, 256> checksum_table = [] {
  std::array<uint32_t, 256> table{};
  for (uint32_t i = 0; i < 256; ++i) {
    uint32_t value = i;
    for (int bit = 0; bit < 8; ++bit) value = value & 1 ? value >> 1 ^ 0xedb88320u : value >> 1;
    table[i] = value;
  }
  return table;
}();

// Appends numbers, the lowest byte first.
class Writer {
 public:
  explicit Writer(Datagram& out) : out_(out) {}
  void operator()(uint8_t value) noexcept { put(value, 1); }
  void operator()(uint16_t value) noexcept { put(value, 2); }
  void operator()(uint32_t value) noexcept { put(value, 4); }
  void operator()(int32_t value) noexcept { put(static_cast<uint32_t>(value), 4); }
  void operator()(uint64_t value) noexcept { put(value, 8); }
  void operator()(float value) noexcept {
    uint32_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    put(bits, 4);
  }
  void operator()(double value) noexcept { (*this)(to_single(value)); }  // 4 bytes, as all measures are sent
  template <size_t n>
  void operator()(const char (&text)[n]) noexcept {
    for (const char c : text) put(static_cast<uint8_t>(c), 1);
  }
  void skip(size_t count) noexcept {
    for (size_t i = 0; i < count; ++i) put(0, 1);
  }

 private:
  void put(uint64_t value, int bytes) noexcept {
    for (int i = 0; i < bytes; ++i) out_.bytes[out_.size++] = static_cast<uint8_t>(value >> (8 * i));
  }
  Datagram& out_;
};

class Reader {
 public:
  Reader(const void* bytes, size_t size) : at_(static_cast<const uint8_t*>(bytes)), end_(at_ + size) {}
  bool is_good() const noexcept { return is_good_; }  // nothing was missing, and all numbers are finite
  bool is_at_end() const noexcept { return at_ == end_; }

  void operator()(uint8_t& value) noexcept { value = static_cast<uint8_t>(get(1)); }
  void operator()(uint16_t& value) noexcept { value = static_cast<uint16_t>(get(2)); }
  void operator()(uint32_t& value) noexcept { value = static_cast<uint32_t>(get(4)); }
  void operator()(int32_t& value) noexcept { value = static_cast<int32_t>(get(4)); }
  void operator()(uint64_t& value) noexcept { value = get(8); }
  void operator()(float& value) noexcept {
    const uint32_t bits = static_cast<uint32_t>(get(4));
    std::memcpy(&value, &bits, sizeof value);
    if (!std::isfinite(value)) is_good_ = false;
  }
  void operator()(double& value) noexcept {
    float single;
    (*this)(single);
    value = static_cast<double>(single);
  }
  template <size_t n>
  void operator()(char (&text)[n]) noexcept {
    for (char& c : text) c = static_cast<char>(get(1));
    text[n - 1] = 0;
    for (char& c : text) {
      if ((c > 0 && c < ' ') || c == 127) c = '?';  // no control characters in what people read
    }
  }
  void skip(size_t count) noexcept {
    for (size_t i = 0; i < count; ++i) get(1);
  }

 private:
  uint64_t get(size_t bytes) noexcept {
    uint64_t value = 0;
    if (static_cast<size_t>(end_ - at_) < bytes) {
      is_good_ = false;
      at_ = end_;
      return 0;
    }
    for (size_t i = 0; i < bytes; ++i) value |= static_cast<uint64_t>(*at_++) << (8 * i);
    return value;
  }
  const uint8_t* at_;
  const uint8_t* end_;
  bool is_good_ = true;
};

// ------------------------------------------------------------------- the fields of each message, in the order of its bytes

template <class Io, class V>
void vector(Io& io, V& v) noexcept {
  io(v.x), io(v.y), io(v.z);
}
template <class Io, class W>
void wrench(Io& io, W& w) noexcept {
  vector(io, w.force), vector(io, w.torque);
}
template <class Io, class P>
void pose(Io& io, P& p) noexcept {
  vector(io, p.position);
  io(p.orientation.w), io(p.orientation.x), io(p.orientation.y), io(p.orientation.z);
}
template <class Io, class M>
void symmetric(Io& io, M& m) noexcept {
  io(m.xx), io(m.yy), io(m.zz), io(m.xy), io(m.xz), io(m.yz);
}

// The pointer is not looked at: its type chooses the function, as M itself is const for a Writer and not for a Reader.
template <class Io, class M>
void fields(Io& io, M& m, const Hello*) noexcept {
  io(m.rate), io.skip(4), io(m.name);
}
template <class Io, class M>
void fields(Io& io, M& m, const Welcome*) noexcept {
  io(m.time), io(m.hello), io(m.rate), io(m.force_axes), io(m.torque_axes);
  io(m.workspace_radius), io(m.workspace_height), io(m.workspace_angle), io(m.force_max), io(m.torque_max);
  io(m.resolution), io(m.damping), io(m.mass), io(m.controller_rate), io(m.controller_delay), io(m.controller_damping);
  io.skip(4), io(m.name), io(m.serial);
}
template <class Io, class M>
void fields(Io& io, M& m, const Busy*) noexcept {
  io(m.answers), io.skip(4), io(m.holder);
}
template <class Io, class M>
void fields(Io& io, M& m, const State*) noexcept {
  io(m.time), io(m.sent), io(m.command_time), io(m.command), io(m.came), io(m.ignored), io(m.flags), io(m.buttons), io(m.grip);
  pose(io, m.pose), vector(io, m.twist.linear), vector(io, m.twist.angular), wrench(io, m.applied), io.skip(4);
}
template <class Io, class M>
void fields(Io& io, M& m, const Request*) noexcept {
  io(m.text);
}
template <class Io, class M>
void fields(Io& io, M& m, const Answer*) noexcept {
  io(m.request), io(m.status), io(m.text);
}
template <class Io, class M>
void plain_fields(Io& io, M& m) noexcept {
  io(m.state), io.skip(4), wrench(io, m.force);
}
template <class Io, class M>
void model_fields(Io& io, M& m) noexcept {
  io(m.state), io(m.hold), wrench(io, m.force), pose(io, m.pose), symmetric(io, m.dfdx), symmetric(io, m.dtdr), io.skip(4);
}

void begin(Datagram& out, Type type, const Header& header) noexcept {
  Writer io(out);
  io(magic), io(protocol_version), io(static_cast<uint8_t>(type)), io(uint16_t{0}), io(header.session), io(header.number),
      io.skip(4);
}
void end(Datagram& out) noexcept {
  const size_t size = out.size + checksum_size;
  out.bytes[6] = static_cast<uint8_t>(size);
  out.bytes[7] = static_cast<uint8_t>(size >> 8);
  const uint32_t sum = checksum(out.bytes, out.size);
  Writer{out}(sum);
}

template <class Message>
Datagram encoded(Type type, const Header& header, const Message& message) noexcept {
  Datagram out;
  begin(out, type, header);
  Writer io(out);
  fields(io, message, &message);
  end(out);
  return out;
}

Reader payload_of(const void* bytes, size_t size) noexcept {
  const size_t around = header_size + checksum_size;
  return {static_cast<const uint8_t*>(bytes) + header_size, size < around ? 0 : size - around};
}
bool is_whole(const Reader& io) noexcept { return io.is_good() && io.is_at_end(); }

template <class Message>
bool decoded(const void* bytes, size_t size, Message& out) noexcept {
  Reader io = payload_of(bytes, size);
  fields(io, out, &out);
  return is_whole(io);
}

bool is_unit(const fs_quat& q) noexcept { return std::fabs(norm(q) - 1) <= 1e-3; }

void mirror(fs_mat3& m) noexcept {
  m.yx = m.xy;
  m.zx = m.xz;
  m.zy = m.yz;
}

}  // namespace

uint32_t checksum(const void* bytes, size_t size) noexcept {
  uint32_t value = 0xffffffffu;
  for (size_t i = 0; i < size; ++i) value = checksum_table[(value ^ static_cast<const uint8_t*>(bytes)[i]) & 0xff] ^ value >> 8;
  return ~value;
}

Datagram encode(const Header& header, const Hello& message) noexcept { return encoded(Type::hello, header, message); }
Datagram encode(const Header& header, const Welcome& message) noexcept { return encoded(Type::welcome, header, message); }
Datagram encode(const Header& header, const Busy& message) noexcept { return encoded(Type::busy, header, message); }
Datagram encode(const Header& header, const State& message) noexcept { return encoded(Type::state, header, message); }
Datagram encode(const Header& header, const Request& message) noexcept { return encoded(Type::request, header, message); }
Datagram encode(const Header& header, const Answer& message) noexcept { return encoded(Type::answer, header, message); }

Datagram encode(const Header& header, const Command& message) noexcept {
  Datagram out;
  begin(out, message.is_model ? Type::model : Type::command, header);
  Writer io(out);
  if (message.is_model) model_fields(io, message);
  else plain_fields(io, message);
  end(out);
  return out;
}

Datagram encode(const Header& header, const Bye& message) noexcept {
  Datagram out;
  begin(out, Type::bye, header);
  Writer io(out);
  io(static_cast<uint32_t>(message.reason)), io.skip(4);
  end(out);
  return out;
}

Opened open(const void* bytes, size_t size, Header& out) noexcept {
  if (size < header_size + checksum_size || size > largest_datagram) return Opened::garbage;
  Reader io(bytes, size);
  uint32_t begins = 0, sum = 0;
  uint8_t version = 0, type = 0;
  uint16_t length = 0;
  io(begins), io(version), io(type), io(length), io(out.session), io(out.number);
  if (begins != magic || length != size || out.session == 0) return Opened::garbage;
  Reader{static_cast<const uint8_t*>(bytes) + size - checksum_size, checksum_size}(sum);
  if (sum != checksum(bytes, size - checksum_size)) return Opened::garbage;
  out.type = static_cast<Type>(type);
  if (version != protocol_version) return Opened::other_version;
  return type >= static_cast<uint8_t>(Type::hello) && type <= static_cast<uint8_t>(Type::bye) ? Opened::good : Opened::garbage;
}

bool decode(const void* bytes, size_t size, Hello& out) noexcept { return decoded(bytes, size, out); }
bool decode(const void* bytes, size_t size, Welcome& out) noexcept { return decoded(bytes, size, out); }
bool decode(const void* bytes, size_t size, Busy& out) noexcept { return decoded(bytes, size, out); }
bool decode(const void* bytes, size_t size, Request& out) noexcept { return decoded(bytes, size, out); }
bool decode(const void* bytes, size_t size, Answer& out) noexcept { return decoded(bytes, size, out); }

bool decode(const void* bytes, size_t size, State& out) noexcept {
  return decoded(bytes, size, out) && is_unit(out.pose.orientation);
}

bool decode(const void* bytes, size_t size, Command& out) noexcept {
  out.is_model = static_cast<const uint8_t*>(bytes)[5] == static_cast<uint8_t>(Type::model);
  Reader io = payload_of(bytes, size);
  if (!out.is_model) {
    plain_fields(io, out);
    return is_whole(io);
  }
  model_fields(io, out);
  mirror(out.dfdx);
  mirror(out.dtdr);
  return is_whole(io) && is_unit(out.pose.orientation) && out.hold >= 0;
}

bool decode(const void* bytes, size_t size, Bye& out) noexcept {
  Reader io = payload_of(bytes, size);
  uint32_t reason = 0;
  io(reason), io.skip(4);
  out.reason = static_cast<Reason>(reason);
  return is_whole(io);
}

}  // namespace fs::udp
