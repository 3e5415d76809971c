#include "device/kernel/serve.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <exception>
#include <fstream>
#include <set>
#include <sstream>
#include <stdexcept>

namespace scenes {
namespace {

const std::string controller = "/sys/devices/platform/vhci_hcd.0/";

// The messages of USB/IP: 48 bytes, of numbers of 4 bytes with the highest first, and then the data.
enum Message : uint32_t { submit = 1, unlink = 2, submitted = 3, unlinked = 4 };
constexpr size_t header_size = 48, setup_at = 40;
constexpr uint32_t short_is_an_error = 1;  // a bit of a transfer's flags
using Header = std::array<uint8_t, header_size>;

uint32_t number_at(const Header& header, size_t index) {
  const uint8_t* p = &header[4 * index];
  return uint32_t(p[0]) << 24 | uint32_t(p[1]) << 16 | uint32_t(p[2]) << 8 | p[3];
}

// A message whose first numbers these are; the others are 0.
std::vector<uint8_t> message(std::initializer_list<uint32_t> numbers) {
  std::vector<uint8_t> bytes;
  for (const uint32_t number : numbers)
    for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(uint8_t(number >> shift));
  bytes.resize(header_size);
  return bytes;
}

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// A port of the controller where no device is; -1: all are taken. A port is free again a moment after its device was unplugged.
int free_port() {
  std::ifstream file(controller + "status");
  if (!file) throw std::runtime_error("there is no " + controller + "status: the module vhci_hcd is not loaded");
  constexpr int available = 4;
  std::string line;
  std::getline(file, line);  // the names of the columns
  while (std::getline(file, line)) {
    std::istringstream columns(line);
    std::string hub;
    int port = 0, state = 0;
    if (columns >> hub >> port >> state && hub == "hs" && state == available) return port;
  }
  return -1;
}

}  // namespace

ServedDevice::ServedDevice(UsbModel& model, Speed speed) : model_(model) {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) throw std::runtime_error("there is no socket");
  socket_ = ends[0];
  try {
    attach(ends[1], speed);
  } catch (...) {
    close(ends[0]);
    close(ends[1]);
    throw;
  }
  close(ends[1]);  // the kernel has it
  thread_ = std::thread([this] { serve(); });
}

void ServedDevice::attach(int socket, Speed speed) {
  constexpr int tries = 3000;
  for (int i = 0; i < tries; ++i) {
    const int port = free_port();
    if (port >= 0) {
      const std::string order = std::to_string(port) + " " + std::to_string(socket) + " 1 " + std::to_string(speed);
      const int file = open((controller + "attach").c_str(), O_WRONLY | O_CLOEXEC);
      if (file < 0) throw std::runtime_error("cannot open " + controller + "attach: " + std::strerror(errno));
      const bool is_done = write(file, order.data(), order.size()) == ssize_t(order.size());
      const int error = errno;
      close(file);
      if (is_done) return;
      if (error != EBUSY) throw std::runtime_error("attach " + order + ": " + std::strerror(error));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  throw std::runtime_error("no port of vhci_hcd has become free");
}

void ServedDevice::unplug() {
  if (socket_ < 0) return;
  shutdown(socket_, SHUT_RDWR);  // wakes the thread
  thread_.join();
  close(socket_);
  socket_ = -1;
}

void ServedDevice::serve() noexcept {
  try {
    for (;;) {
      pollfd events{socket_, POLLIN, 0};
      if (poll(&events, 1, waiting_.empty() ? -1 : 1) < 0 && errno != EINTR) throw std::runtime_error("poll");
      if (events.revents != 0 && !take_command()) return;
      try_transfers();
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "the served device ends: %s\n", error.what());
    shutdown(socket_, SHUT_RDWR);
  }
}

bool ServedDevice::receive(void* data, size_t size) const {
  for (size_t done = 0; done < size;) {
    const ssize_t count = recv(socket_, static_cast<char*>(data) + done, size - done, 0);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    done += size_t(count);
  }
  return true;
}

// An error is left to the next receive, which has it too.
void ServedDevice::send(const std::vector<uint8_t>& bytes) const {
  for (size_t done = 0; done < bytes.size();) {
    const ssize_t count = ::send(socket_, &bytes[done], bytes.size() - done, MSG_NOSIGNAL);
    if (count < 0 && errno != EINTR) return;
    if (count > 0) done += size_t(count);
  }
}

bool ServedDevice::take_command() {
  Header header;
  if (!receive(header.data(), header.size())) return false;
  const uint32_t command = number_at(header, 0), number = number_at(header, 1);
  if (command == unlink) {
    const uint32_t which = number_at(header, 5);
    const bool waits = std::erase_if(waiting_, [&](const Transfer& transfer) { return transfer.number == which; }) > 0;
    send(message({unlinked, number, 0, 0, 0, uint32_t(waits ? -ECONNRESET : 0)}));  // 0: its answer was sent before
    return true;
  }
  if (command != submit) throw std::runtime_error("the kernel sends message " + std::to_string(command));

  const bool reads = number_at(header, 3) != 0;
  const uint8_t* setup = &header[setup_at];
  Transfer transfer{};
  transfer.number = number;
  transfer.endpoint = number_at(header, 4) | (reads ? 0x80 : 0);
  transfer.may_be_short = !(number_at(header, 5) & short_is_an_error);
  transfer.setup = {setup[0], setup[1], uint16_t(setup[2] | setup[3] << 8), uint16_t(setup[4] | setup[5] << 8),
                    uint16_t(setup[6] | setup[7] << 8)};
  const size_t length = number_at(header, 6);
  transfer.capacity = reads ? length : 0;
  transfer.data.resize(reads ? 0 : length);
  if (!receive(transfer.data.data(), transfer.data.size())) return false;
  waiting_.push_back(std::move(transfer));
  return true;
}

// At each endpoint the transfers are carried in their order.
void ServedDevice::try_transfers() {
  std::set<uint32_t> busy;  // endpoints whose first transfer has to wait
  for (auto transfer = waiting_.begin(); transfer != waiting_.end();) {
    Answer answer;
    const int result = busy.contains(transfer->endpoint) ? -EAGAIN : with_model([&] { return carry(*transfer, answer); });
    if (result == -EAGAIN) {
      busy.insert(transfer->endpoint);
      ++transfer;
      continue;
    }
    complete(*transfer, result, answer);
    transfer = waiting_.erase(transfer);
  }
}

int ServedDevice::carry(const Transfer& transfer, Answer& answer) {
  if ((transfer.endpoint & 0x7f) == 0) return control(transfer, answer);
  if (transfer.endpoint & 0x80) return model_.in(uint8_t(transfer.endpoint), transfer.capacity, answer.data, now());
  return model_.out(uint8_t(transfer.endpoint), transfer.data, now());
}

void ServedDevice::complete(const Transfer& transfer, int result, Answer& answer) const {
  const bool reads = transfer.endpoint & 0x80;
  answer.status = std::min(result, 0);
  answer.carried = reads ? answer.data.size() : size_t(std::max(result, 0));
  if (answer.status == 0 && answer.carried > transfer.capacity && reads) answer.status = -EOVERFLOW;
  if (answer.status == 0 && answer.carried < transfer.capacity && reads && !transfer.may_be_short) answer.status = -EREMOTEIO;
  if (reads) {
    answer.carried = std::min(answer.carried, transfer.capacity);
    answer.data.resize(answer.carried);
  } else {
    answer.data.clear();
  }
  std::vector<uint8_t> bytes = message({submitted, transfer.number, 0, 0, 0, uint32_t(answer.status), uint32_t(answer.carried)});
  bytes.insert(bytes.end(), answer.data.begin(), answer.data.end());
  send(bytes);
}

// The requests that every device must know (USB 2.0, 9.4) are answered here.
int ServedDevice::control(const Transfer& transfer, Answer& answer) {
  enum { get_status = 0, clear_feature = 1, set_feature = 3, get_descriptor = 6, get_configuration = 8, set_configuration = 9,
         get_interface = 10, set_interface = 11 };
  const UsbSetup& setup = transfer.setup;
  if ((setup.request_type & 0x60) != 0) {
    const int result = model_.control(setup, transfer.data, answer.data, now());
    if (answer.data.size() > setup.length) answer.data.resize(setup.length);  // the host asked for no more
    return result;
  }
  switch (setup.request) {
    case get_descriptor: return describe(setup, answer);
    case get_status: answer.data = {0, 0}; return 2;
    case get_configuration: answer.data = {configuration_}; return 1;
    case get_interface: answer.data = {0}; return 1;
    case set_configuration: configuration_ = uint8_t(setup.value); return 0;
    case set_interface: return setup.value == 0 ? 0 : -EPIPE;
    case clear_feature:
    case set_feature: return 0;
    default: return -EPIPE;
  }
}

int ServedDevice::describe(const UsbSetup& setup, Answer& answer) const {
  enum { device = 1, configuration = 2, string = 3 };
  std::vector<uint8_t>& data = answer.data;
  const int type = setup.value >> 8, index = setup.value & 0xff;
  if (type == device) {
    data = model_.device_descriptor();
  } else if (type == configuration && index == 0) {
    data = model_.configuration_descriptor();
  } else if (type == string && index == 0) {
    data = {4, string, 0x09, 0x04};  // the languages: English
  } else if (type == string) {
    const std::string text = model_.string(uint8_t(index));  // ASCII
    if (text.empty()) return -EPIPE;
    data = {uint8_t(2 + 2 * text.size()), string};
    for (const char c : text) data.insert(data.end(), {uint8_t(c), 0});
  } else {
    return -EPIPE;
  }
  if (data.size() > setup.length) data.resize(setup.length);
  return int(data.size());
}

}  // namespace scenes
