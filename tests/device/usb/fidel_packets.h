// What the tests of FIDEL without a bus share.
#pragma once

#include <span>

#include "api/support.h"
#include "device/fidel/usb/protocol.h"
#include "device/usb/fidel_model.h"

namespace scenes {

using namespace fs::fidel_usb;
using Bytes = std::vector<uint8_t>;

inline Bytes bytes_of(const char* hex) {
  Bytes bytes;
  for (const char* at = hex; *at; at += at[2] ? 3 : 2)
    bytes.push_back(static_cast<uint8_t>(std::strtol(std::string(at, 2).c_str(), nullptr, 16)));
  return bytes;
}

// Of section 7 of the page.
inline const Bytes identity_vector = bytes_of(
    "49 01 00 01 46 30 30 30 31 00 00 00 00 00 00 00 00 00 00 00 10 98 02 00 50 c3 00 00 40 0d 03 00 "
    "10 09 05 00 c0 45 04 00 80 38 01 00 20 4e 00 00 80 3a 54 00 20 a1 07 00 e0 2e 00 00 00 00 75 5f");

inline Report report_of(FidelModel& model) {
  uint8_t bytes[FIDEL_REPORT_SIZE];
  fidel_firmware_report(&model.body().firmware, bytes);
  const auto report = parse_report(bytes);
  ck_assert(report);
  return *report;
}
inline void command(FidelModel& model, const Command& command) {
  const auto bytes = packed(command);
  model.out(0x01, bytes, model.body().time);
}

}  // namespace scenes
