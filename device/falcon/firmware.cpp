#include "device/falcon/firmware.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <span>
#include <vector>

#include "device/falcon/packet.h"
#include "device/support/clock.h"
#include "device/support/refusal.h"

namespace fs::falcon {
namespace {

using Bytes = std::vector<uint8_t>;

// Requests of an FT232R.
enum : uint8_t { ftdi_reset = 0, ftdi_modem = 1, ftdi_flow = 2, ftdi_baud = 3, ftdi_line = 4, ftdi_latency = 9 };
enum : uint16_t {
  purge_received = 1,
  purge_sent = 2,
  dtr_low = 0x0100,
  dtr_high = 0x0101,
  rts_low = 0x0200,
  baud_greeting = 0x4138,  // 9600
  baud_image = 0x15,       // 3 MHz / 21
  baud_packets = 0x2,      // 1.5 M
  line_8n1 = 8
};

constexpr int most_tries = 3;
constexpr size_t largest_image = 1 << 20;  // bytes

void request(UsbDevice& device, uint8_t request, uint16_t value) { device.control(0x40, request, value, 0); }

void purge(UsbDevice& device) {
  request(device, ftdi_reset, purge_received);
  request(device, ftdi_reset, purge_sent);
}

// The data that comes within a time (s), until there are `count` bytes.
Bytes read(UsbDevice& device, size_t count, double within) {
  const double until = steady_now() + within;
  Bytes data;
  while (data.size() < count) {
    const double rest = until - steady_now();
    if (rest <= 0) break;
    const Bytes packet = device.read(endpoint_in, usb_packet, rest);
    if (packet.size() > modem_bytes) data.insert(data.end(), packet.begin() + modem_bytes, packet.end());
  }
  return data;
}

// A step of loading that went wrong, in words.
struct Trouble {
  std::string text;
};

std::string text_of(const Bytes& bytes) {
  constexpr size_t most = 8;
  if (bytes.empty()) return "nothing came back";
  std::string text;
  for (size_t i = 0; i < std::min(most, bytes.size()); ++i) {
    char byte[4];
    std::snprintf(byte, sizeof byte, "%02x ", bytes[i]);
    text += byte;
  }
  return text + (bytes.size() > most ? "and more came back" : "came back");
}

// The Falcon listens to a greeting after DTR has risen.
void greet(UsbDevice& device) {
  constexpr int most_greetings = 10;
  const Bytes greeting{0x0a, 0x43, 0x0d}, expected{0x0a, 0x44, 0x2c, 0x0d};
  purge(device);
  request(device, ftdi_latency, 16);
  request(device, ftdi_baud, baud_greeting);
  request(device, ftdi_line, line_8n1);
  request(device, ftdi_flow, 0);
  request(device, ftdi_modem, rts_low);
  request(device, ftdi_modem, dtr_low);
  request(device, ftdi_modem, dtr_high);
  Bytes answer;
  for (int i = 0; i < most_greetings; ++i) {
    device.write(endpoint_out, greeting);
    answer = read(device, expected.size(), 0.1);
    if (!answer.empty() && answer.front() == 0) {  // it may come first
      answer.erase(answer.begin());
      const Bytes last = answer.size() < expected.size() ? read(device, 1, 0.05) : Bytes{};
      answer.insert(answer.end(), last.begin(), last.end());
    }
    if (answer == expected) return;
  }
  throw Trouble{"to the greeting 0a 43 0d " + text_of(answer) + ", not 0a 44 2c 0d"};
}

void send_image(UsbDevice& device, const Bytes& image) {
  const Bytes begin{0x41};
  request(device, ftdi_modem, dtr_low);
  request(device, ftdi_baud, baud_image);
  device.write(endpoint_out, begin);
  if (const Bytes answer = read(device, 1, 0.5); answer != begin) {
    throw Trouble{"when the image was announced with 41 " + text_of(answer) + ", not 41"};
  }
  constexpr size_t piece = usb_packet - modem_bytes;  // its echo fits into one packet
  for (size_t at = 0; at < image.size(); at += piece) {
    const std::span<const uint8_t> part(image.data() + at, std::min(piece, image.size() - at));
    device.write(endpoint_out, part);
    const Bytes echo = read(device, part.size(), 1);
    if (echo.size() == part.size() && std::equal(echo.begin(), echo.end(), part.begin())) continue;
    throw Trouble{"of the image, " + std::to_string(image.size()) + " bytes, the piece at byte " + std::to_string(at) +
                  (echo.size() < part.size() ? " was not echoed in full" : " was echoed with other bytes")};
  }
}

Bytes image_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) refuse(FS_ERROR_NOT_FOUND, "the firmware '%s' cannot be read: %s", path.c_str(), std::strerror(errno));
  Bytes image(largest_image + 1);
  file.read(reinterpret_cast<char*>(image.data()), static_cast<std::streamsize>(image.size()));
  image.resize(static_cast<size_t>(file.gcount()));
  if (image.empty() || image.size() > largest_image) {
    refuse(FS_ERROR_INVALID, "the firmware '%s' has %s, must have 1..%zu bytes", path.c_str(), image.empty() ? "no byte" : "more",
           largest_image);
  }
  return image;
}

}  // namespace

void set_up(UsbDevice& device) {
  purge(device);
  request(device, ftdi_latency, 1);
  request(device, ftdi_baud, baud_packets);
  purge(device);
}

bool has_firmware(UsbDevice& device) {
  constexpr int most_packets = 10;
  Reports reports;
  int count = 0;
  for (int i = 0; i < most_packets; ++i) {
    device.write(endpoint_out, packet_of({}));
    const Bytes bytes = read(device, packet_size, 0.02);
    reports.put(bytes.data(), bytes.size(), [&](const Report&) { ++count; });
    if (count >= 2) return true;
  }
  return false;
}

void load_firmware(UsbDevice& device, const std::string& path) {
  const Bytes image = image_of(path);
  std::string story;
  for (int i = 1; i <= most_tries; ++i) {
    std::string trouble;
    try {
      greet(device);
      send_image(device, image);
      set_up(device);
      if (has_firmware(device)) return;
      trouble = "all was echoed, but then it does not answer: the file may not be its firmware";
    } catch (const Trouble& found) {
      trouble = found.text;
    } catch (const Refusal& refusal) {
      if (refusal.status == FS_ERROR_DISCONNECTED) throw;
      trouble = refusal.text;
    }
    const size_t same = story.rfind(trouble);
    if (same != std::string::npos) story += "; try " + std::to_string(i) + ": the same";
    else story += (story.empty() ? "try " : "; try ") + std::to_string(i) + ": " + trouble;
  }
  set_up(device);
  refuse(
      FS_ERROR_IO,
      "the Falcon did not take the firmware '%s' (%s). Take its power away for 5 s and try again; if that does not help, another "
      "socket of the computer, without a hub",
      path.c_str(), story.c_str());
}

}  // namespace fs::falcon
