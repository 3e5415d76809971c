// The packets of a Novint Falcon that has its firmware: 16 bytes each way, '<' .. '>'. Each nibble of three 16-bit numbers is a byte
// of its own, lowest first, counted from 'A' on.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace fs::falcon {

inline constexpr size_t packet_size = 16;
using Packet = std::array<uint8_t, packet_size>;

// Bits of a command.
enum : uint8_t { bit_homing = 1, light_red = 2, light_green = 4, light_blue = 8 };
inline constexpr uint8_t all_lights = light_red | light_green | light_blue;

// Bits of a report, of its buttons as they lie on the grip.
enum : uint8_t { button_plus = 1, button_forward = 2, button_centre = 4, button_minus = 8, homed_first = 16 };
inline constexpr uint8_t all_buttons = 15, all_homed = 7 * homed_first;

struct Command {
  std::array<int16_t, 3> motors{};
  uint8_t bits = 0;
};

struct Report {
  std::array<int16_t, 3> encoders{};
  uint8_t bits = 0;
};

Packet packet_of(const Command& command) noexcept;
// nullopt: a byte is none that a report has at its place.
std::optional<Report> report_of(const Packet& packet) noexcept;

// Finds reports in a stream of bytes, of which some may be lost or wrong.
class Reports {
 public:
  // Calls take(report) for each that ends with these bytes.
  template <class Take>
  void put(const uint8_t* data, size_t size, Take take) noexcept {
    for (size_t i = 0; i < size; ++i) {
      bytes_[count_++] = data[i];
      find_start();
      if (count_ < packet_size) continue;
      const std::optional<Report> report = bytes_.back() == '>' ? report_of(bytes_) : std::nullopt;
      if (report) {
        take(*report);
        count_ = 0;
      } else {
        drop_first();
      }
    }
  }
  void clear() noexcept { count_ = 0; }
  uint64_t stray() const noexcept { return stray_; }  // bytes so far that belong to no report

 private:
  void drop_first() noexcept;
  void find_start() noexcept;  // drops what stands before the first '<'

  Packet bytes_{};
  size_t count_ = 0;
  uint64_t stray_ = 0;
};

}  // namespace fs::falcon
