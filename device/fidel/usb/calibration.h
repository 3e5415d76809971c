// The calibration of a FIDEL: worked out from two places, and kept in a file for each serial number.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "device/fidel/usb/arm.h"

namespace fs::fidel_usb {

// The two places at which the handle is put, m, device frame.
constexpr Vec3 first_place{0, 0, 0}, second_place{0.1, 0, 0};

// From the mean counts of the joints there. Throws a Refusal INVALID where that gives offsets or a scale beyond their bounds.
Calibration calibrated(const Arm& arm, const std::array<double, 3>& at_first, const std::array<double, 3>& at_second);

// $XDG_CONFIG_HOME/forceserver/fidel-SERIAL.json; without that variable, in ~/.config. "": this user has no home.
std::string calibration_file(const std::string& serial);

// Nothing where there is no file. Throws a Refusal: IO (it cannot be read), INVALID (it is no calibration of this device).
std::optional<Calibration> read_calibration(const std::string& file, const std::string& serial);

// Replaces the file as a whole, and makes its folder. A file that is no calibration of this device is not replaced. Throws a Refusal.
void write_calibration(const std::string& file, const std::string& serial, const Calibration& calibration);

}  // namespace fs::fidel_usb
