// From a pose of a Haply Inverse3 to the force that answers it: by a servo with the driver haply, and by the plainest loop, which sends
// a force, reads the state and computes a spring. bench_haply [ROUNDS]
//
// Haply's service is a stand-in in this process. So this measures the software on the way, not the device.
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>

#include <cstdlib>
#include <string>

#include <nlohmann/json.hpp>

#include "device/makers/haply_service.h"
#include "turnarounds.h"

using namespace scenes;
using boost::asio::ip::tcp;

int main(int count, char** arguments) {
  const int rounds = count > 1 ? std::atoi(arguments[1]) : 5;
  makers::HaplyService service;
  makers::Handle& handle = service.devices.front()->handle;
  const auto note = [&](std::vector<double>* times) { handle.note_turnarounds(times); };
  bench::Turnarounds servo("servo and driver"), plain("a plain loop of Beast"), paced("the same at 1000 Hz");
  for (int i = 0; i < rounds; ++i) {
    bench::run_servo(open_device(("haply:0?port=" + std::to_string(service.port())).c_str()).get(), servo, note);

    boost::asio::io_context context;
    boost::beast::websocket::stream<tcp::socket> stream(context);
    stream.next_layer().connect({boost::asio::ip::address_v4::loopback(), service.port()});
    stream.next_layer().set_option(tcp::no_delay(true));
    stream.handshake("localhost", "/");
    boost::beast::flat_buffer buffer;
    stream.read(buffer);
    double x = 0, y = 0, z = 0;
    nlohmann::json force;
    const auto step = [&](bool is_new) {
      if (is_new) force = {{"x", -100 * x}, {"y", -100 * y}, {"z", -100 * z}};
      const nlohmann::json command{{"device_id", "049D"}, {"commands", {{"set_cursor_force", {{"vector", force}}}}}};
      stream.write(boost::asio::buffer(nlohmann::json{{"inverse3", nlohmann::json::array({command})}}.dump()));
      buffer.clear();
      stream.read(buffer);
      const auto message = nlohmann::json::parse(boost::beast::buffers_to_string(buffer.data()));
      const nlohmann::json& position = message["inverse3"][0]["state"]["cursor_position"];
      x = position["x"], y = position["y"], z = position["z"];
    };
    bench::run_plain(plain, note, [&] { step(true); });
    auto next = std::chrono::steady_clock::now();
    bench::run_plain(paced, note, [&] {
      step(true);
      std::this_thread::sleep_until(next = std::max(next + std::chrono::milliseconds(1), std::chrono::steady_clock::now()));
      step(false);  // the answer to the force is old by now
    });
  }
  servo.print();
  plain.print();
  paced.print();
}
