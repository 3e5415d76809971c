// A haptic device that does what a test says: "fake:NAME" moves with the servo's time as a simulator does,
// "fakereal:NAME" runs on the monotonic clock as a real device does; "fakelink:NAME" and "fakereallink:NAME" measure
// their link, too. It can be opened as long as this object exists.
#pragma once

#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include <forceserver/driver.h>

#include "scenes/handles.h"

namespace scenes {

class FakeDevice {
 public:
  explicit FakeDevice(std::string name);  // registers the two drivers, too, once in a process
  ~FakeDevice();
  FakeDevice(const FakeDevice&) = delete;
  FakeDevice& operator=(const FakeDevice&) = delete;

  Device open(bool is_simulated = true) const;

  // What the device does. While a servo thread runs, lock the mutex to change it.
  std::mutex mutex;
  fs_device_info info;                           // 10 N, 1 N m, 1000 Hz, three axes each
  fs_state state{};                              // what read gives; READY unless a test changes it
  fs_status read_status = FS_OK, write_status = FS_OK;
  std::function<void(FakeDevice&, double time)> on_read;  // before each read; time in s
  std::function<void(FakeDevice&)> on_write, on_close;    // on_write: after `written` is set
  std::function<fs_status(FakeDevice&, fs_link& out)> on_link;  // get_link; set before open: else the driver has none

  // What the device was given.
  double time = 0;                               // s, of the last call of advance; fakereal: 0
  fs_wrench written{};                           // the last
  uint64_t reads = 0, writes = 0;
  bool is_open = false;
  std::vector<fs_wrench>* log = nullptr;         // all that is written, if the test wants it

 private:
  std::string name_;
};

}  // namespace scenes
