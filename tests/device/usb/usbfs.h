// The files of usbfs (linux/usbdevice_fs.h) that the emulated bus gives to libusb. An open one is the write end of a pipe of one
// page, so that poll answers as it does for the kernel's: with a byte in it nothing can be written: nothing to reap; empty: there
// is something; without a read end: POLLERR, the device is gone.
#pragma once

#include <array>
#include <atomic>
#include <deque>
#include <list>
#include <map>
#include <random>
#include <thread>

#include "device/usb/emulated_bus.h"

struct usbdevfs_urb;
typedef struct _UMockdevTestbed UMockdevTestbed;

namespace scenes {

class EmulatedBus::Usbfs {
 public:
  ~Usbfs();
  void start();
  void end();

  int next_number() { return ++numbers_; }
  void put(int socket, int number, std::shared_ptr<UsbModel> model);
  void take_out(int socket, Unplug how);
  void take_out_at(int socket, UsbMoment moment, uint64_t count, Unplug how);
  void forget_taken_out();  // removes from sysfs what is no longer plugged in
  bool is_plugged(int socket);
  void set(int socket, const UsbFaults& faults);
  UsbCounts counts(int socket);
  std::string node(int socket);

  // What the functions before those of the C library ask. -1 with errno: refused; -2: not a file of this bus.
  int open(const char* path);
  int control(int descriptor, unsigned long request, void* argument);
  bool close(int descriptor);  // true: it was one; the caller closes the descriptor
  // Whether it is a file of this bus. Takes no lock: a sanitizer opens and closes files in the midst of a report.
  bool has(int descriptor) const noexcept {
    return descriptor >= 0 && static_cast<size_t>(descriptor) < is_own_.size() && is_own_[static_cast<size_t>(descriptor)];
  }

  static Usbfs* present();

  std::mutex mutex;
  std::mutex testbed_mutex;  // is taken first
  UMockdevTestbed* testbed = nullptr;

 private:
  struct Socket {
    std::shared_ptr<UsbModel> model;
    int number = 0;
    bool is_claimed = false, is_detached = false, is_in_sysfs = false;
    UsbFaults faults;
    UsbCounts counts;
    UsbMoment moment{};
    uint64_t rest = 0;  // until it is unplugged; 0: never
    Unplug how{};
  };
  struct File {
    Socket* socket = nullptr;
    int number = 0;       // of the device that was opened
    int read_end = -1;
    bool has_claimed = false, is_gone = false, has_byte = false;
    std::list<usbdevfs_urb*> pending;
    std::deque<usbdevfs_urb*> ended;
  };

  bool happens(Socket& socket, UsbMoment moment);  // false: it was unplugged at this moment
  void take_out(Socket& socket, Unplug how);
  void let_go(Socket& socket, File& file, Unplug how);
  int submit(File& file, usbdevfs_urb* urb);
  int reap(File& file, void** out);
  void finish(File& file, usbdevfs_urb* urb, int status, size_t length);
  bool carry(File& file, usbdevfs_urb* urb);  // true: it has ended
  void carry_control(File& file, usbdevfs_urb* urb);
  bool fail_by(UsbFault fault, File& file, usbdevfs_urb* urb);
  void signal(File& file);
  void run();

  std::map<int, Socket> sockets_;
  std::map<int, File> files_;  // by descriptor
  std::array<std::atomic<bool>, 4096> is_own_{};  // by descriptor: it is among the files
  std::atomic<int> numbers_{1};
  std::atomic<bool> is_ending_{false};
  std::thread frames_;
  std::minstd_rand random_{1};
};

}  // namespace scenes
