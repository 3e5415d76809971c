#include "device/usb/usbfs.h"

#include <fcntl.h>
#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <time.h>
#include <umockdev-1.0/umockdev.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace scenes {
namespace {

std::atomic<EmulatedBus::Usbfs*> the_present{nullptr};

double now() {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

int refused(int error) {
  errno = error;
  return -1;
}

std::string node_of(int number) {
  char text[64];
  std::snprintf(text, sizeof text, "/dev/bus/usb/001/%03d", number);
  return text;
}

// Not by the close that stands before that of the C library, which asks the bus.
void close_plainly(int descriptor) { syscall(SYS_close, descriptor); }

bool is_in(const usbdevfs_urb& urb) { return urb.endpoint & 0x80; }

}  // namespace

EmulatedBus::Usbfs* EmulatedBus::Usbfs::present() { return the_present; }

void EmulatedBus::Usbfs::start() {
  the_present = this;
  frames_ = std::thread([this] { run(); });
}

void EmulatedBus::Usbfs::end() {
  is_ending_ = true;
  if (frames_.joinable()) frames_.join();
  the_present = nullptr;
}

EmulatedBus::Usbfs::~Usbfs() = default;

// ------------------------------------------------------------------------------------------------------------------ sockets

void EmulatedBus::Usbfs::put(int number_of_socket, int number, std::shared_ptr<UsbModel> model) {
  const std::lock_guard lock(mutex);
  Socket& socket = sockets_[number_of_socket];
  socket.model = std::move(model);
  socket.number = number;
  socket.is_claimed = socket.is_detached = false;
  socket.is_in_sysfs = true;
}

bool EmulatedBus::Usbfs::is_plugged(int socket) {
  const std::lock_guard lock(mutex);
  return sockets_[socket].model != nullptr;
}

void EmulatedBus::Usbfs::set(int socket, const UsbFaults& faults) {
  const std::lock_guard lock(mutex);
  sockets_[socket].faults = faults;
}

UsbCounts EmulatedBus::Usbfs::counts(int socket) {
  const std::lock_guard lock(mutex);
  return sockets_[socket].counts;
}

std::string EmulatedBus::Usbfs::node(int socket) {
  const std::lock_guard lock(mutex);
  return node_of(sockets_[socket].number);
}

void EmulatedBus::Usbfs::take_out(int socket, Unplug how) {
  const std::lock_guard lock(mutex);
  take_out(sockets_[socket], how);
}

void EmulatedBus::Usbfs::take_out_at(int number, UsbMoment moment, uint64_t count, Unplug how) {
  const std::lock_guard lock(mutex);
  Socket& socket = sockets_[number];
  socket.moment = moment;
  socket.rest = count;
  socket.how = how;
}

void EmulatedBus::Usbfs::take_out(Socket& socket, Unplug how) {
  if (!socket.model) return;
  for (auto& [descriptor, file] : files_) {
    if (file.socket == &socket && !file.is_gone) let_go(socket, file, how);
  }
  socket.model = nullptr;
  socket.rest = 0;
}

void EmulatedBus::Usbfs::let_go(Socket& socket, File& file, Unplug how) {
  const std::list<usbdevfs_urb*> pending = file.pending;
  for (usbdevfs_urb* urb : pending) {
    if (how == Unplug::in_flight) finish(file, urb, -ESHUTDOWN, 0);
    else finish(file, urb, 0, is_in(*urb) ? 0 : static_cast<size_t>(urb->buffer_length));
  }
  file.is_gone = true;
  if (file.has_claimed) socket.is_claimed = false;
  if (how == Unplug::between && !file.ended.empty()) return;  // POLLERR comes when these have been reaped
  close_plainly(file.read_end);
  file.read_end = -1;
}

// Outside of the mutex: umockdev waits for others.
void EmulatedBus::Usbfs::forget_taken_out() {
  const std::lock_guard testbed_lock(testbed_mutex);
  std::vector<std::string> gone;
  {
    const std::lock_guard lock(mutex);
    for (auto& [number, socket] : sockets_) {
      if (socket.model || !socket.is_in_sysfs) continue;
      socket.is_in_sysfs = false;
      gone.push_back("/sys/devices/usb1/1-" + std::to_string(number));
    }
  }
  for (const std::string& path : gone) {
    umockdev_testbed_uevent(testbed, path.c_str(), "remove");
    umockdev_testbed_remove_device(testbed, path.c_str());
  }
}

bool EmulatedBus::Usbfs::happens(Socket& socket, UsbMoment moment) {
  if (!socket.model) return false;
  if (socket.rest == 0 || socket.moment != moment || --socket.rest > 0) return true;
  take_out(socket, socket.how);
  return false;
}

// -------------------------------------------------------------------------------------------------------------------- files

int EmulatedBus::Usbfs::open(const char* path) {
  const std::lock_guard lock(mutex);
  for (auto& [number, socket] : sockets_) {
    if (socket.number == 0 || node_of(socket.number) != path) continue;
    if (!socket.model) return refused(ENODEV);
    ++socket.counts.opens;
    if (!happens(socket, UsbMoment::open)) return refused(ENODEV);
    if (socket.faults.is_denied) return refused(EACCES);
    int ends[2];
    if (pipe2(ends, O_NONBLOCK | O_CLOEXEC) != 0) return -1;
    fcntl(ends[1], F_SETPIPE_SZ, 4096);
    File& file = files_[ends[1]];
    is_own_.at(static_cast<size_t>(ends[1])) = true;
    file = {};
    file.socket = &socket;
    file.number = socket.number;
    file.read_end = ends[0];
    ++socket.counts.open_now;
    signal(file);
    return ends[1];
  }
  return -2;
}

bool EmulatedBus::Usbfs::close(int descriptor) {
  const std::lock_guard lock(mutex);
  const auto found = files_.find(descriptor);
  if (found == files_.end()) return false;
  File& file = found->second;
  if (file.read_end >= 0) close_plainly(file.read_end);
  if (file.has_claimed && !file.is_gone) file.socket->is_claimed = false;
  --file.socket->counts.open_now;
  files_.erase(found);
  is_own_.at(static_cast<size_t>(descriptor)) = false;
  return true;
}

// Makes poll say whether there is something to reap.
void EmulatedBus::Usbfs::signal(File& file) {
  const bool wants_byte = file.ended.empty();
  if (wants_byte == file.has_byte || file.read_end < 0) return;
  char byte = 0;
  for (auto& [descriptor, each] : files_) {
    if (&each != &file) continue;
    if (wants_byte) file.has_byte = ::write(descriptor, &byte, 1) == 1;
    else file.has_byte = ::read(file.read_end, &byte, 1) != 1;
  }
}

void EmulatedBus::Usbfs::finish(File& file, usbdevfs_urb* urb, int status, size_t length) {
  file.pending.remove(urb);
  urb->status = status;
  urb->actual_length = static_cast<int>(length);
  file.ended.push_back(urb);
  signal(file);
}

int EmulatedBus::Usbfs::control(int descriptor, unsigned long request, void* argument) {
  const std::lock_guard lock(mutex);
  const auto found = files_.find(descriptor);
  if (found == files_.end()) return -2;
  File& file = found->second;
  Socket& socket = *file.socket;
  if (request == USBDEVFS_REAPURB || request == USBDEVFS_REAPURBNDELAY) return reap(file, static_cast<void**>(argument));
  if (file.is_gone) return refused(ENODEV);
  const bool is_kernels = *socket.faults.kernel_driver && !socket.is_detached;
  switch (request) {
    case USBDEVFS_GET_CAPABILITIES:
      *static_cast<uint32_t*>(argument) = USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION | USBDEVFS_CAP_NO_PACKET_SIZE_LIM |
                                          USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
      return 0;
    case USBDEVFS_GETDRIVER:
      if (!is_kernels) return refused(ENODATA);
      std::snprintf(static_cast<usbdevfs_getdriver*>(argument)->driver, USBDEVFS_MAXDRIVERNAME, "%s", socket.faults.kernel_driver);
      return 0;
    case USBDEVFS_DISCONNECT_CLAIM:
    case USBDEVFS_CLAIMINTERFACE:
      ++socket.counts.claims;
      if (!happens(socket, UsbMoment::claim)) return refused(ENODEV);
      if (is_kernels && request == USBDEVFS_CLAIMINTERFACE) return refused(EBUSY);
      if (is_kernels) {
        ++socket.counts.detached;
        socket.is_detached = true;
      }
      if (socket.faults.is_in_use || socket.is_claimed) return refused(EBUSY);
      file.has_claimed = socket.is_claimed = true;
      return 0;
    case USBDEVFS_RELEASEINTERFACE:
      if (!file.has_claimed) return refused(EINVAL);
      file.has_claimed = socket.is_claimed = false;
      return 0;
    case USBDEVFS_IOCTL: {
      const int code = static_cast<usbdevfs_ioctl*>(argument)->ioctl_code;
      if (code == static_cast<int>(USBDEVFS_DISCONNECT)) {
        if (!is_kernels) return refused(ENODATA);
        ++socket.counts.detached;
        socket.is_detached = true;
      }
      if (code == static_cast<int>(USBDEVFS_CONNECT)) socket.is_detached = false;
      return 0;
    }
    case USBDEVFS_SETINTERFACE:
    case USBDEVFS_SETCONFIGURATION:
    case USBDEVFS_RESET:
    case USBDEVFS_RESETEP: return 0;
    case USBDEVFS_CLEAR_HALT: ++socket.counts.clears; return 0;
    case USBDEVFS_SUBMITURB: return submit(file, static_cast<usbdevfs_urb*>(argument));
    case USBDEVFS_DISCARDURB: {
      const auto urb = std::find(file.pending.begin(), file.pending.end(), static_cast<usbdevfs_urb*>(argument));
      if (urb == file.pending.end()) return refused(EINVAL);
      if (!socket.faults.is_stuck) finish(file, *urb, -ENOENT, 0);
      return 0;
    }
    default: return refused(ENOTTY);
  }
}

int EmulatedBus::Usbfs::reap(File& file, void** out) {
  if (file.ended.empty()) {
    if (file.is_gone && file.read_end >= 0) {
      close_plainly(file.read_end);
      file.read_end = -1;
    }
    return refused(file.is_gone ? ENODEV : EAGAIN);
  }
  *out = file.ended.front();
  file.ended.pop_front();
  signal(file);
  return 0;
}

// ----------------------------------------------------------------------------------------------------------------- transfers

int EmulatedBus::Usbfs::submit(File& file, usbdevfs_urb* urb) {
  Socket& socket = *file.socket;
  const bool is_control = urb->type == USBDEVFS_URB_TYPE_CONTROL;
  if (!file.has_claimed && !is_control) return refused(ENOENT);
  const UsbMoment moment = is_control ? UsbMoment::control : is_in(*urb) ? UsbMoment::in : UsbMoment::out;
  ++(is_control ? socket.counts.controls : is_in(*urb) ? socket.counts.ins : socket.counts.outs);
  file.pending.push_back(urb);  // it is in flight when the device goes
  if (!happens(socket, moment)) {
    // Between: everything had ended before this one, which is refused.
    if (socket.how == Unplug::in_flight) return 0;
    const auto own = std::find(file.ended.begin(), file.ended.end(), urb);
    if (own != file.ended.end()) file.ended.erase(own);
    signal(file);
    return refused(ENODEV);
  }
  if (moment != UsbMoment::in) carry(file, urb);
  return 0;
}

bool EmulatedBus::Usbfs::fail_by(UsbFault fault, File& file, usbdevfs_urb* urb) {
  switch (fault) {
    case UsbFault::stall: finish(file, urb, -EPIPE, 0); return true;
    case UsbFault::error: finish(file, urb, -EPROTO, 0); return true;
    case UsbFault::overlong: finish(file, urb, -EOVERFLOW, static_cast<size_t>(urb->buffer_length)); return true;
    case UsbFault::silence: return true;
    default: return false;
  }
}

void EmulatedBus::Usbfs::carry_control(File& file, usbdevfs_urb* urb) {
  auto* const bytes = static_cast<uint8_t*>(urb->buffer);
  const auto word = [&](size_t i) { return static_cast<uint16_t>(bytes[i] | bytes[i + 1] << 8); };
  const UsbSetup setup{bytes[0], bytes[1], word(2), word(4), word(6)};
  if ((setup.request_type & 0x60) == 0) return finish(file, urb, -EPIPE, 0);  // a standard request that nobody makes here
  const bool is_reading = setup.request_type & 0x80;
  std::vector<uint8_t> answer;
  const UsbModel::Bytes data(bytes + 8, is_reading ? 0 : setup.length);
  const int count = file.socket->model->control(setup, data, answer, now());
  if (count < 0) return finish(file, urb, count, 0);
  if (!is_reading) return finish(file, urb, 0, setup.length);
  answer.resize(std::min<size_t>(answer.size(), setup.length));
  std::copy(answer.begin(), answer.end(), bytes + 8);
  finish(file, urb, 0, answer.size());
}

bool EmulatedBus::Usbfs::carry(File& file, usbdevfs_urb* urb) {
  Socket& socket = *file.socket;
  auto* const bytes = static_cast<uint8_t*>(urb->buffer);
  const auto size = static_cast<size_t>(urb->buffer_length);
  if (urb->type == USBDEVFS_URB_TYPE_CONTROL) {
    if (!fail_by(socket.faults.control, file, urb)) carry_control(file, urb);
    return true;
  }
  if (!is_in(*urb)) {
    if (fail_by(socket.faults.out, file, urb)) return true;
    const int count = socket.model->out(urb->endpoint, {bytes, size}, now());
    if (count == -EAGAIN) return false;
    finish(file, urb, std::min(count, 0), static_cast<size_t>(std::max(count, 0)));
    return true;
  }
  std::vector<uint8_t> data;  // what the device gives is lost where the transfer fails
  const int count = socket.model->in(urb->endpoint, size, data, now());
  if (socket.faults.in != UsbFault::silence && fail_by(socket.faults.in, file, urb)) return true;
  if (count == -EAGAIN || socket.faults.in == UsbFault::silence) return false;
  if (count < 0) {
    finish(file, urb, count, 0);
    return true;
  }
  if (socket.faults.in == UsbFault::shortened) data.resize(data.size() / 2);
  if (socket.faults.in == UsbFault::garbage) {
    for (uint8_t& byte : data) byte = static_cast<uint8_t>(random_());
  }
  std::copy(data.begin(), data.end(), bytes);
  finish(file, urb, 0, data.size());
  return true;
}

// Twice in each frame of 1 ms every endpoint with a transfer in flight has its turn.
void EmulatedBus::Usbfs::run() {
  timespec next{};
  clock_gettime(CLOCK_MONOTONIC, &next);
  while (!is_ending_) {
    next.tv_nsec += 500'000;
    if (next.tv_nsec >= 1'000'000'000) {
      next.tv_nsec -= 1'000'000'000;
      ++next.tv_sec;
    }
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, nullptr);
    bool has_gone = false;
    {
      const std::lock_guard lock(mutex);
      for (auto& [descriptor, file] : files_) {
        if (file.is_gone) continue;
        uint32_t done = 0;  // endpoints that had their turn
        const std::list<usbdevfs_urb*> pending = file.pending;
        for (usbdevfs_urb* urb : pending) {
          const uint32_t bit = 1u << ((urb->endpoint & 0x0f) + (is_in(*urb) ? 16 : 0));
          if ((done & bit) || !file.socket->model) continue;
          done |= bit;
          carry(file, urb);
        }
      }
      for (auto& [number, socket] : sockets_) has_gone = has_gone || (!socket.model && socket.is_in_sysfs);
    }
    if (has_gone) forget_taken_out();
  }
}

}  // namespace scenes
