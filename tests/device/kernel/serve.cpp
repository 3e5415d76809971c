#include "device/kernel/serve.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
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
#include <thread>

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

void UsbServer::plug() {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) throw std::runtime_error("there is no socket");
  unplug();
  socket_ = ends[0];
  try {
    attach(ends[1]);
  } catch (...) {
    close(ends[1]);
    unplug();
    throw;
  }
  close(ends[1]);  // the kernel has it
}

void UsbServer::attach(int socket) const {
  constexpr int tries = 3000;
  constexpr int full_speed = 2;  // as the kernel numbers it
  for (int i = 0; i < tries; ++i) {
    const int port = free_port();
    if (port >= 0) {
      const std::string order = std::to_string(port) + " " + std::to_string(socket) + " 1 " + std::to_string(full_speed);
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

void UsbServer::unplug() {
  if (socket_ >= 0) close(socket_);
  socket_ = -1;
  waiting_.clear();
}

void UsbServer::serve_until(int descriptor) {
  for (;;) {
    pollfd events[] = {{descriptor, POLLIN, 0}, {socket_, POLLIN, 0}};  // a negative descriptor is passed over
    if (poll(events, 2, waiting_.empty() ? -1 : 1) < 0 && errno != EINTR) throw std::runtime_error("poll");
    if (events[0].revents != 0) return;
    if (events[1].revents != 0 && !take_command()) unplug();
    try_transfers();
  }
}

bool UsbServer::receive(void* data, size_t size) const {
  for (size_t done = 0; done < size;) {
    const ssize_t count = recv(socket_, static_cast<char*>(data) + done, size - done, 0);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    done += size_t(count);
  }
  return true;
}

// An error is left to the next receive, which has it too.
void UsbServer::send(const std::vector<uint8_t>& bytes) const {
  for (size_t done = 0; done < bytes.size();) {
    const ssize_t count = ::send(socket_, &bytes[done], bytes.size() - done, MSG_NOSIGNAL);
    if (count < 0 && errno != EINTR) return;
    if (count > 0) done += size_t(count);
  }
}

bool UsbServer::take_command() {
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
void UsbServer::try_transfers() {
  std::set<uint32_t> busy;  // endpoints whose first transfer has to wait
  for (auto transfer = waiting_.begin(); transfer != waiting_.end();) {
    Answer answer;
    const int result = busy.contains(transfer->endpoint) ? -EAGAIN : carry(*transfer, answer);
    if (result == -EAGAIN) {
      busy.insert(transfer->endpoint);
      ++transfer;
      continue;
    }
    complete(*transfer, result, answer);
    transfer = waiting_.erase(transfer);
  }
}

int UsbServer::carry(const Transfer& transfer, Answer& answer) {
  if ((transfer.endpoint & 0x7f) == 0) return control(transfer, answer);
  if (transfer.endpoint & 0x80) return model_.in(uint8_t(transfer.endpoint), transfer.capacity, answer.data, now());
  return model_.out(uint8_t(transfer.endpoint), transfer.data, now());
}

void UsbServer::complete(const Transfer& transfer, int result, Answer& answer) const {
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
int UsbServer::control(const Transfer& transfer, Answer& answer) {
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

int UsbServer::describe(const UsbSetup& setup, Answer& answer) const {
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

// ---------------------------------------------------------------------------------------------------------- its process

ServerProcess::ServerProcess(const std::function<std::shared_ptr<UsbModel>()>& make) {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) throw std::runtime_error("there is no socket");
  process_ = fork();
  if (process_ < 0) throw std::runtime_error("there is no process for the server");
  if (process_ == 0) {
    close(ends[0]);
    run(ends[1], make);
  }
  close(ends[1]);
  orders_ = ends[0];
}

ServerProcess::~ServerProcess() {
  close(orders_);
  kill(process_, SIGKILL);
  waitpid(process_, nullptr, 0);
}

void ServerProcess::run(int orders, const std::function<std::shared_ptr<UsbModel>()>& make) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  try {
    const std::shared_ptr<UsbModel> model = make();
    UsbServer server(*model);
    for (;;) {
      server.serve_until(orders);
      Order order{};
      if (recv(orders, &order, sizeof order, 0) != ssize_t(sizeof order)) _exit(0);  // the test has ended
      const Reply reply = obey(order, server, *model);
      if (::send(orders, &reply, sizeof reply, MSG_NOSIGNAL) != ssize_t(sizeof reply)) _exit(0);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "the server ends: %s\n", error.what());
  }
  _exit(1);
}

ServerProcess::Reply ServerProcess::obey(const Order& order, UsbServer& server, UsbModel& model) {
  Reply reply{};
  try {
    switch (order.kind) {
      case plug_in: server.plug(); break;
      case pull_out: server.unplug(); break;
      case call_function: order.call(model, order.closure.data(), reply.result.data());
    }
  } catch (const std::exception& error) {
    std::snprintf(reply.error, sizeof reply.error, "%s", error.what());
  }
  return reply;
}

ServerProcess::Reply ServerProcess::ask(const Order& order) {
  Reply reply{};
  if (::send(orders_, &order, sizeof order, MSG_NOSIGNAL) != ssize_t(sizeof order) ||
      recv(orders_, &reply, sizeof reply, 0) != ssize_t(sizeof reply)) throw std::runtime_error("the server has ended");
  if (reply.error[0]) throw std::runtime_error(reply.error);
  return reply;
}

void ServerProcess::plug() { ask({plug_in, nullptr, {}}); }
void ServerProcess::unplug() { ask({pull_out, nullptr, {}}); }

ServerProcess::Bytes ServerProcess::call(Call function, const void* closure, size_t size) {
  Order order{call_function, function, {}};
  std::memcpy(order.closure.data(), closure, size);
  return ask(order).result;
}

}  // namespace scenes
