#include "device/fidel/usb/protocol.h"

#include <algorithm>

namespace fs::fidel_usb {
namespace {

enum Kind : uint8_t { kind_report = 'R', kind_command = 'C', kind_identity = 'I', kind_status = 'S' };

// Numbers are little-endian.
class Reader {
 public:
  explicit Reader(const uint8_t* at) : at_(at) {}
  uint16_t u16() noexcept { return static_cast<uint16_t>(next(2)); }
  int16_t i16() noexcept { return static_cast<int16_t>(u16()); }
  uint32_t u32() noexcept { return next(4); }
  int32_t i32() noexcept { return static_cast<int32_t>(next(4)); }
  uint8_t u8() noexcept { return static_cast<uint8_t>(next(1)); }

 private:
  uint32_t next(int size) noexcept {
    uint32_t value = 0;
    for (int i = 0; i < size; ++i) value |= static_cast<uint32_t>(*at_++) << (8 * i);
    return value;
  }
  const uint8_t* at_;
};

class Writer {
 public:
  Writer(uint8_t* begin, uint8_t kind) : begin_(begin), at_(begin) {
    put(kind, 1);
    put(protocol_version, 1);
  }
  void put(uint32_t value, int size) noexcept {
    for (int i = 0; i < size; ++i) *at_++ = static_cast<uint8_t>(value >> (8 * i));
  }
  void end() noexcept { put(crc16({begin_, at_}), 2); }

 private:
  uint8_t *begin_, *at_;
};

bool is_whole(std::span<const uint8_t> bytes, uint8_t kind, size_t size) noexcept {
  return bytes.size() == size && bytes[0] == kind && bytes[1] == protocol_version &&
         crc16(bytes.first(size - 2)) == Reader(bytes.data() + size - 2).u16();
}

}  // namespace

uint16_t crc16(std::span<const uint8_t> bytes) noexcept {
  uint16_t crc = 0xffff;
  for (const uint8_t byte : bytes) {
    crc = static_cast<uint16_t>(crc ^ byte << 8);
    for (int i = 0; i < 8; ++i) crc = static_cast<uint16_t>(crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1);
  }
  return crc;
}

std::optional<Report> parse_report(std::span<const uint8_t> bytes) noexcept {
  if (!is_whole(bytes, kind_report, report_size)) return std::nullopt;
  Reader reader(bytes.data() + 2);
  Report out{};
  out.number = reader.u16();
  out.time = reader.u32();
  for (int32_t& count : out.joints) count = reader.i32();
  for (int16_t& count : out.wrist) count = reader.i16();
  out.buttons = reader.u16();
  out.status = reader.u16();
  out.command = reader.u16();
  out.command_age = reader.u16();
  out.refused = reader.u16();
  if (reader.u16() != 0 || out.status & ~status_known) return std::nullopt;
  return out;
}

std::optional<Command> parse_command(std::span<const uint8_t> bytes) noexcept {
  if (!is_whole(bytes, kind_command, command_size)) return std::nullopt;
  Reader reader(bytes.data() + 2);
  Command out{};
  out.number = reader.u16();
  for (int32_t& torque : out.joints) torque = reader.i32();
  for (int32_t& torque : out.wrist) torque = reader.i32();
  if (reader.u16() != 0) return std::nullopt;
  return out;
}

std::optional<Identity> parse_identity(std::span<const uint8_t> bytes) noexcept {
  if (!is_whole(bytes, kind_identity, identity_size)) return std::nullopt;
  Reader reader(bytes.data() + 2);
  Identity out{};
  out.firmware = reader.u16();
  for (size_t i = 0; i + 1 < out.serial.size(); ++i) out.serial[i] = static_cast<char>(reader.u8());
  for (uint32_t* field : {&out.base_radius, &out.platform_radius, &out.upper_arm, &out.forearm, &out.centre_depth,
                          &out.joint_counts, &out.wrist_counts, &out.joint_torque, &out.wrist_torque, &out.joint_speed}) {
    *field = reader.u32();
  }
  if (reader.u16() != 0) return std::nullopt;
  return out;
}

std::optional<Status> parse_status(std::span<const uint8_t> bytes) noexcept {
  if (!is_whole(bytes, kind_status, status_size)) return std::nullopt;
  Reader reader(bytes.data() + 2);
  Status out{};
  out.status = reader.u16();
  for (uint32_t* field : {&out.time, &out.reports, &out.accepted, &out.refused, &out.limited, &out.watchdog}) {
    *field = reader.u32();
  }
  if (reader.u16() != 0 || out.status & ~status_known) return std::nullopt;
  return out;
}

std::array<uint8_t, command_size> packed(const Command& command) noexcept {
  std::array<uint8_t, command_size> out{};
  Writer writer(out.data(), kind_command);
  writer.put(command.number, 2);
  for (const int32_t torque : command.joints) writer.put(static_cast<uint32_t>(torque), 4);
  for (const int32_t torque : command.wrist) writer.put(static_cast<uint32_t>(torque), 4);
  writer.put(0, 2);
  writer.end();
  return out;
}

std::array<uint8_t, report_size> packed(const Report& report) noexcept {
  std::array<uint8_t, report_size> out{};
  Writer writer(out.data(), kind_report);
  writer.put(report.number, 2);
  writer.put(report.time, 4);
  for (const int32_t count : report.joints) writer.put(static_cast<uint32_t>(count), 4);
  for (const int16_t count : report.wrist) writer.put(static_cast<uint16_t>(count), 2);
  for (const uint16_t value : {report.buttons, report.status, report.command, report.command_age, report.refused, uint16_t{0}}) {
    writer.put(value, 2);
  }
  writer.end();
  return out;
}

uint8_t version_of_identity(std::span<const uint8_t> bytes) noexcept {
  return bytes.size() >= 2 && bytes[0] == kind_identity ? bytes[1] : 0;
}

}  // namespace fs::fidel_usb
