#include "device/falcon/packet.h"

#include <algorithm>

namespace fs::falcon {
namespace {

constexpr uint8_t base = 'A';
constexpr size_t nibbles = 4;  // of a number

}  // namespace

Packet packet_of(const Command& command) noexcept {
  Packet packet{};
  size_t at = 0;
  packet[at++] = '<';
  for (const int16_t number : command.motors) {
    const auto bits = static_cast<uint16_t>(number);
    for (size_t i = 0; i < nibbles; ++i) packet[at++] = static_cast<uint8_t>(base + (bits >> 4 * i & 15));
  }
  packet[at++] = static_cast<uint8_t>(base + (command.bits & 15));
  packet[at++] = base;
  packet[at] = '>';
  return packet;
}

std::optional<Report> report_of(const Packet& packet) noexcept {
  if (packet.front() != '<' || packet.back() != '>') return std::nullopt;
  Report report;
  size_t at = 1;
  for (int16_t& number : report.encoders) {
    uint32_t bits = 0;
    for (size_t i = 0; i < nibbles; ++i, ++at) {
      const auto nibble = static_cast<uint8_t>(packet[at] - base);
      if (nibble > 15) return std::nullopt;
      bits |= static_cast<uint32_t>(nibble) << 4 * i;
    }
    number = static_cast<int16_t>(static_cast<uint16_t>(bits));
  }
  report.bits = static_cast<uint8_t>(packet[at] - base);
  if (report.bits > (all_homed | all_buttons)) return std::nullopt;
  return report;
}

void Reports::drop_first() noexcept {
  std::copy(bytes_.begin() + 1, bytes_.begin() + static_cast<std::ptrdiff_t>(count_), bytes_.begin());
  --count_;
  ++stray_;
}

void Reports::find_start() noexcept {
  while (count_ > 0 && bytes_[0] != '<') drop_first();
}

}  // namespace fs::falcon
