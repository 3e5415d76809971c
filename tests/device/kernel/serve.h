// Serves a device model to the kernel's own USB stack: the kernel's driver vhci_hcd has one end of a pair of sockets, and a server at
// the other end answers as a USB/IP server does. Needs root and the module vhci_hcd.
//
// The server is a process of its own, as a device is one thing and its host another: a program that is killed while it waits for
// the device waits in the kernel until the device has answered that the transfer is taken back.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "device/usb/usb_model.h"

namespace scenes {

// The server itself, within its process.
class UsbServer {
 public:
  explicit UsbServer(UsbModel& model) : model_(model) {}
  void plug();    // throws std::runtime_error
  void unplug();  // closes the socket, whatever is under way
  // Serves until a message can be read from this descriptor.
  void serve_until(int descriptor);

 private:
  // A transfer that waits for the device.
  struct Transfer {
    uint32_t number, endpoint;  // number: the kernel's, of this transfer; endpoint: with 0x80 where the host reads
    bool may_be_short;
    UsbSetup setup;
    size_t capacity;            // bytes, of an answer
    std::vector<uint8_t> data;  // what the host sends
  };
  struct Answer {
    int status = 0;  // 0 or a negative error number of the kernel
    size_t carried = 0;
    std::vector<uint8_t> data;
  };

  void attach(int socket) const;
  bool take_command();  // false: the socket was closed
  bool receive(void* data, size_t size) const;
  void send(const std::vector<uint8_t>& bytes) const;
  void try_transfers();
  int carry(const Transfer& transfer, Answer& answer);  // as the functions of UsbModel
  int control(const Transfer& transfer, Answer& answer);
  int describe(const UsbSetup& setup, Answer& answer) const;
  void complete(const Transfer& transfer, int result, Answer& answer) const;

  UsbModel& model_;
  int socket_ = -1;  // -1: not plugged in
  uint8_t configuration_ = 0;
  std::deque<Transfer> waiting_;
};

// The process of a server, as a test sees it. It has what this process had when it was made, functions at the same addresses.
class ServerProcess {
 public:
  // Made before the test has any threads. make: called there. Throws std::runtime_error.
  explicit ServerProcess(const std::function<std::shared_ptr<UsbModel>()>& make);
  ~ServerProcess();  // unplugs
  ServerProcess(const ServerProcess&) = delete;
  ServerProcess& operator=(const ServerProcess&) = delete;

  // Pulls the device out at whatever moment, and plugs it in.
  void plug();
  void unplug();

 protected:
  static constexpr size_t room = 200;  // bytes
  using Call = void (*)(UsbModel& model, const uint8_t* function, uint8_t* result);
  using Bytes = std::array<uint8_t, room>;
  Bytes call(Call function, const void* closure, size_t size);

 private:
  enum Kind : uint32_t { plug_in, pull_out, call_function };
  struct Order {
    Kind kind;
    Call call;
    Bytes closure;
  };
  struct Reply {
    Bytes result;
    char error[room];  // "": none
  };
  [[noreturn]] static void run(int orders, const std::function<std::shared_ptr<UsbModel>()>& make);
  static Reply obey(const Order& order, UsbServer& server, UsbModel& model);
  Reply ask(const Order& order);

  int orders_ = -1, process_ = -1;
};

// The same for one kind of model.
template <class Model>
class Served : public ServerProcess {
 public:
  template <class... Arguments>
  explicit Served(const Arguments&... arguments) : ServerProcess([&] { return std::make_shared<Model>(arguments...); }) {}

  // Calls f(model) in the server, between two transfers, and returns its result. What f holds is copied there: numbers, no
  // pointers.
  template <class Function>
  auto see(Function f) {
    using Result = std::invoke_result_t<Function, Model&>;
    static_assert(std::is_trivially_copyable_v<Function> && std::is_trivially_copyable_v<Result>);
    static_assert(sizeof(Function) <= room && sizeof(Result) <= room);
    const Bytes bytes = call(
        [](UsbModel& model, const uint8_t* function, uint8_t* result) {
          const Result value = (*reinterpret_cast<const Function*>(function))(static_cast<Model&>(model));
          std::memcpy(result, &value, sizeof value);
        },
        &f, sizeof f);
    Result result;
    std::memcpy(&result, bytes.data(), sizeof result);
    return result;
  }
  template <class Function>
  void change(Function f) {
    see([f](Model& model) {
      f(model);
      return 0;
    });
  }
};

}  // namespace scenes
