// The simplest device: what is sent to bulk endpoint 0x02 comes back at 0x81, and a vendor's request adds one to a number.
#pragma once

#include <algorithm>
#include <cerrno>
#include <string>
#include <utility>
#include <vector>

#include "device/usb/usb_model.h"

namespace scenes {

class LoopModel final : public UsbModel {
 public:
  static constexpr uint16_t vendor = 0x1209, product = 0x0001;
  static constexpr uint8_t in_endpoint = 0x81, out_endpoint = 0x02, add_one = 7, refuse = 8;

  explicit LoopModel(std::string serial) : serial_(std::move(serial)) {}

  std::vector<uint8_t> device_descriptor() const override {
    return {18, 1, 0x00, 0x02, 0xff, 0, 0, 64, vendor & 0xff, vendor >> 8, product & 0xff, product >> 8, 0x00, 0x01, 1, 2, 3, 1};
  }
  std::vector<uint8_t> configuration_descriptor() const override {
    return {9, 2, 32, 0, 1, 1, 0, 0x80, 50,         // one interface
            9, 4, 0, 0, 2, 0xff, 0, 0, 0,           // two endpoints
            7, 5, in_endpoint, 2, 64, 0, 0,         // bulk, 64 bytes
            7, 5, out_endpoint, 2, 64, 0, 0};
  }
  std::string string(uint8_t index) const override { return index == 1 ? "Nobody" : index == 2 ? "Loop" : index == 3 ? serial_ : ""; }

  int control(const UsbSetup& setup, Bytes, std::vector<uint8_t>& answer, double) override {
    if (setup.request != add_one) return -EPIPE;
    answer = {uint8_t(setup.value + 1), uint8_t((setup.value + 1) >> 8)};
    return 2;
  }
  int out(uint8_t, Bytes data, double) override {
    held_.emplace_back(data.begin(), data.end());
    return int(data.size());
  }
  int in(uint8_t, size_t, std::vector<uint8_t>& data, double) override {
    if (held_.empty()) return -EAGAIN;
    data = held_.front();
    held_.erase(held_.begin());
    return int(data.size());
  }

 private:
  const std::string serial_;
  std::vector<std::vector<uint8_t>> held_;
};

}  // namespace scenes
