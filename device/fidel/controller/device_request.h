// A request to the device behind the controller: it may take seconds, so a thread of its own waits for it, not the loop.
#pragma once

#include <atomic>
#include <cstdint>
#include <semaphore>
#include <string>
#include <thread>

#include <forceserver/device.h>

namespace fs::udp {

class DeviceRequest {
 public:
  explicit DeviceRequest(fs_device* device) : device_(device), thread_([this] { serve(); }) {}
  // Waits for a request that is being done.
  ~DeviceRequest() {
    ends_ = true;
    begun_.release();
    thread_.join();
  }
  DeviceRequest(const DeviceRequest&) = delete;
  DeviceRequest& operator=(const DeviceRequest&) = delete;

  struct Done {
    uint64_t session;  // of the host that asked
    uint32_t number;   // of its request
    fs_status status;
    std::string text;
  };

  // The other functions are the loop's, and do not wait. False: the request before is still being done.
  bool begin(uint64_t session, uint32_t number, const char* text) {
    if (is_running_) return false;
    is_running_ = true;
    request_ = text;
    done_ = {session, number, FS_OK, ""};
    begun_.release();
    return true;
  }
  // True, once: it has been done.
  bool end(Done& out) {
    if (!is_done_.exchange(false)) return false;
    is_running_ = false;
    out = std::move(done_);
    return true;
  }
  // The request that is being done.
  const std::string& text() const noexcept { return request_; }

 private:
  void serve() {
    for (;;) {
      begun_.acquire();
      if (ends_) return;
      fs_answer answer{};
      done_.status = fs_device_control(device_, request_.c_str(), &answer);
      done_.text = done_.status == FS_OK ? answer.text : fs_last_error();
      is_done_ = true;
    }
  }

  fs_device* const device_;
  bool is_running_ = false;  // the loop's own
  std::string request_;      // these two are the thread's from `begin` until is_done_; the text is then only read
  Done done_{};
  std::atomic<bool> is_done_{false}, ends_{false};
  std::counting_semaphore<2> begun_{0};
  std::thread thread_;  // the last, as it uses the others
};

}  // namespace fs::udp
