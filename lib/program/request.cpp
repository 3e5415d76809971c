// forceserver request: asks a device for something that only its kind knows, and prints the answer.
#include <cstdio>

#include "program.h"
#include "words.h"

int request(const RequestOptions& options) {
  load_driver(options.driver);
  const Device device = Device::open(options.device);
  std::printf("%s\n", device.control(options.request).text);
  write_out();
  return exit_fine;
}
