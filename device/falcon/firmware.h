// What comes before the packets: the Falcon's FT232R (a USB chip for a serial line) is set up, and the Falcon is given its firmware,
// which it loses with its power. The firmware is the maker's and not part of forceserver: the user gives its file.
#pragma once

#include <cstdint>
#include <string>

#include "device/support/usb.h"

namespace fs::falcon {

inline constexpr uint8_t endpoint_in = 0x81, endpoint_out = 0x02;
inline constexpr size_t usb_packet = 64;  // bytes
inline constexpr size_t modem_bytes = 2;  // before the data of each USB packet that comes
inline constexpr UsbKind falcon_kind{"Novint Falcon", 0x0403, 0xcb48, nullptr};

// The line as the firmware uses it. Throws a Refusal.
void set_up(UsbDevice& device);

// Whether it answers a packet without force, as it does with its firmware. Takes 0.2 s when it does not. Throws a Refusal.
bool has_firmware(UsbDevice& device);

// Gives it the firmware of a file, with several tries, and looks whether it answers then: it takes some seconds. Throws a Refusal: NOT_FOUND
// (the file), INVALID (what is in it), IO, with what happened in each try and what to do.
void load_firmware(UsbDevice& device, const std::string& path);

}  // namespace fs::falcon
