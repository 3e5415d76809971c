// The controller's end of the protocol of UDP.md, with a device behind it that is given by the public functions of device.h.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <string>

#include "device/fidel/controller/device_request.h"
#include "device/fidel/controller/renderer.h"
#include "device/fidel/udp/arrivals.h"
#include "device/fidel/udp/socket.h"

namespace fs::udp {

class Controller {
 public:
  static constexpr double rate = 1000;  // Hz

  // The device stays the caller's. say: gets a sentence whenever somebody comes, goes or is refused; it must not wait.
  Controller(fs_device* device, Socket& socket, std::function<void(const std::string&)> say);

  // The loop, until ends() is true; then the force is 0 and the host has been told.
  void run(const std::function<bool()>& ends);

 private:
  // The host that has the controller.
  struct Host {
    uint64_t session = 0;  // 0: none
    Endpoint address;
    std::string name;
    int every = 1;          // ticks from one state to the next
    double heard_at = 0;    // s
    Arrivals commands;
    uint64_t command_time = 0;  // ns
    uint32_t states = 0, welcomes = 0, answers = 0;
    uint32_t answered = 0;      // the number of the newest request
    Datagram answer;            // to it
  };

  void tick();
  void render();  // for the newest command, at the present pose
  void send_state();
  void listen(int64_t until);  // ns

  void take(const Datagram& datagram, const Endpoint& from);
  void take_hello(const Datagram& datagram, const Header& header, const Endpoint& from);
  void take_of_host(const Datagram& datagram, const Header& header);
  bool is_stale(const Command& command) const;
  void take_request(const Header& header, const Request& request);
  std::string status() const;
  void answer_of_device();
  void answer(int32_t status, const std::string& text);  // to the newest request
  void refuse_stranger(const Datagram& datagram, const Header& header, const Endpoint& from);
  void begin(const Hello& hello, const Header& header, const Endpoint& from);
  void end(std::optional<Reason> reason, const std::string& why);  // without a reason the host is told nothing
  void reply(const Datagram& datagram, const Endpoint& to);  // to nobody in particular: only some a second
  void welcome(uint32_t hello);
  std::string who() const { return host_.name + " at " + host_.address.text(); }

  fs_device* const device_;
  Socket& socket_;
  const std::function<void(const std::string&)> say_;
  fs_device_info info_;
  Renderer renderer_;
  fs_state state_{};    // the newest of the device
  fs_wrench applied_{};
  uint64_t ticks_ = 0, late_ticks_ = 0;
  uint32_t ignored_ = 0;
  Host host_;
  DeviceRequest device_request_;
  uint64_t ended_session_ = 0;  // late datagrams of it bring nobody back
  double replies_left_ = 0, replied_at_ = 0;
  double refused_at_ = -1e300;  // s, when a stranger was last spoken of
};

}  // namespace fs::udp
