// The packets between a FIDEL and its host, as device/fidel/USB.md describes them. Nothing here allocates or throws.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace fs::fidel_usb {

constexpr uint16_t vendor = 0x1209, product = 0x0001;
constexpr const char* product_text = "FIDEL";
constexpr uint8_t protocol_version = 1;
constexpr uint8_t report_endpoint = 0x81, command_endpoint = 0x01;
constexpr size_t report_size = 40, command_size = 32, identity_size = 64, status_size = 32;

// bRequest of the control transfers, vendor requests to the device.
enum Request : uint8_t { request_identity = 1, request_home = 2, request_clear_fault = 3, request_status = 4 };
constexpr uint8_t to_host = 0xc0, to_device = 0x40;  // bmRequestType

// Bits of the status.
enum : uint16_t {
  status_homed = 1 << 0,
  status_mark_1 = 1 << 1,  // and the next two bits: the reference mark of this joint has been passed
  status_motors = 1 << 4,
  status_emergency_stop = 1 << 5,
  status_over_speed = 1 << 6,
  status_watchdog = 1 << 7,
  status_limited = 1 << 8,
  status_in_holder = 1 << 9,
  status_encoder = 1 << 10,
  status_over_heated = 1 << 11,
  status_no_supply = 1 << 12,
  status_no_firmware = 1 << 13,
  status_known = (1 << 14) - 1
};

// CRC-16/IBM-3740, also called CRC-16/CCITT-FALSE. Of "123456789": 0x29b1.
uint16_t crc16(std::span<const uint8_t> bytes) noexcept;

struct Report {
  uint16_t number;  // one more than the report before, modulo 65536
  uint32_t time;    // us of the device's clock, modulo 2^32
  std::array<int32_t, 3> joints;
  std::array<int16_t, 3> wrist;  // counts
  uint16_t buttons, status;
  uint16_t command;      // the number of the newest command that was accepted
  uint16_t command_age;  // us from when that command came until this report was made; 65535: or more
  uint16_t refused;      // commands that were damaged or out of turn, modulo 65536
};

struct Command {
  uint16_t number;
  std::array<int32_t, 3> joints, wrist;  // uN m
};

struct Identity {
  uint16_t firmware;             // 256 times the major number, and the minor number
  std::array<char, 17> serial;   // ends with 0
  uint32_t base_radius, platform_radius, upper_arm, forearm, centre_depth;  // um
  uint32_t joint_counts, wrist_counts;                                      // a revolution
  uint32_t joint_torque, wrist_torque;                                      // uN m; a passive wrist has 0
  uint32_t joint_speed;                                                     // mrad/s
};

struct Status {
  uint16_t status;
  uint32_t time;  // us
  uint32_t reports, accepted, refused, limited, watchdog;  // counts since power was switched on
};

// Nothing: the packet is damaged: of another length, kind or version, with a wrong checksum, or with bits that are always 0.
std::optional<Report> parse_report(std::span<const uint8_t> bytes) noexcept;
std::optional<Command> parse_command(std::span<const uint8_t> bytes) noexcept;
std::optional<Identity> parse_identity(std::span<const uint8_t> bytes) noexcept;
std::optional<Status> parse_status(std::span<const uint8_t> bytes) noexcept;
std::array<uint8_t, command_size> packed(const Command& command) noexcept;
std::array<uint8_t, report_size> packed(const Report& report) noexcept;  // for tests

// The version that the first bytes of an identity name, whatever follows; 0: they are no identity.
uint8_t version_of_identity(std::span<const uint8_t> bytes) noexcept;

}  // namespace fs::fidel_usb
