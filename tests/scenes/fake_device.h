// A haptic device that does what a test says: "fake:NAME" moves with the servo's time as a simulator does,
// "fakereal:NAME" runs on the monotonic clock as a real device does; "fakelink:NAME" and "fakereallink:NAME" measure
// their link, too, and "fakemodel:NAME" takes local models. It can be opened as long as this object exists.
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
  explicit FakeDevice(std::string name);  // registers the drivers, too, once in a process
  ~FakeDevice();
  FakeDevice(const FakeDevice&) = delete;
  FakeDevice& operator=(const FakeDevice&) = delete;

  Device open(bool is_simulated = true) const;

  // What the device does. While a servo thread runs, lock the mutex to change it.
  std::mutex mutex;
  fs_device_info info;                           // 10 N, 1 N m, 1000 Hz, three axes each
  fs_state state{};                              // what read gives; READY unless a test changes it
  fs_status open_status = FS_OK, info_status = FS_OK, advance_status = FS_OK, read_status = FS_OK, write_status = FS_OK;
  const char* sentence = nullptr;                // of an open that fails; null: none
  std::function<void(FakeDevice&, double time)> on_read;  // before each read; time in s
  std::function<void(FakeDevice&)> on_write, on_close;    // on_write: after `written` is set
  std::function<fs_status(FakeDevice&, fs_link& out)> on_link;  // get_link; set before open: else the driver has none

  // write_model; set before open: else the driver has none. get_link is there, too, and not supported where on_link is not set.
  std::function<fs_status(FakeDevice&, const fs_model&)> on_model;

  // What the device was given.
  std::string address;                           // of the last open, which is found by what is before a '?'
  double time = 0;                               // s, of the last call of advance; fakereal: 0
  fs_wrench written{};                           // the last
  uint64_t reads = 0, writes = 0;
  bool is_open = false, has_clean_reads = true;  // has_clean_reads: what read was to fill in was always zeros
  std::vector<fs_wrench>* log = nullptr;         // all that is written, if the test wants it

 private:
  std::string name_;
};

// The table of "fake", for a scheme that a test registers itself. The scheme is kept by the caller.
fs_driver fake_driver(const char* scheme);

}  // namespace scenes
