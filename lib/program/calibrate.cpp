// forceserver calibrate: leads a person through the calibration of a device, whose driver says what to do next.
#include <cstdio>
#include <cstring>
#include <iostream>
#include <string>

#include "program.h"
#include "words.h"

namespace {

// What is asked again after a mistake, such as a hand that moved; anything else ends the calibration.
bool may_be_repeated(const Error& error) { return error.status() == FS_ERROR_STATE || error.status() == FS_ERROR_TIMEOUT; }

// The person has done it: Enter. False: there is no more input.
bool await_person() {
  std::printf("Press Enter when that is so; Ctrl-D gives up.\n");
  write_out();
  std::string line;
  return static_cast<bool>(std::getline(std::cin, line));
}

}  // namespace

int calibrate(const CalibrateOptions& options) {
  load_driver(options.driver);
  const Device device = Device::open(options.device);
  for (bool is_first = true;; is_first = false) {
    std::string answer;
    try {
      answer = device.control("calibrate").text;
    } catch (const Error& error) {
      if (is_first && error.status() == FS_ERROR_UNSUPPORTED) {
        throw Error(error.status(), format("%s cannot be calibrated: %s", options.device.c_str(), error.what()));
      }
      if (is_first || !may_be_repeated(error)) throw;
      answer = error.what();
    }
    std::printf("%s\n", answer.c_str());
    write_out();
    if (answer.rfind("done", 0) == 0) return exit_fine;
    if (await_person()) continue;
    std::printf("%s\n", device.control("calibrate=cancel").text);
    return exit_odd;
  }
}
