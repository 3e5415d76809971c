// The simplest device through the real libusb and the kernel's USB stack: that the bench itself does what it should.
#include <libusb.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>

#include "device/kernel/guest.h"
#include "device/kernel/loop_model.h"
#include "device/kernel/serve.h"

#include <check.h>
#undef fail

using namespace scenes;

namespace {

using Context = std::unique_ptr<libusb_context, decltype([](libusb_context* p) { libusb_exit(p); })>;
using Handle = std::unique_ptr<libusb_device_handle, decltype([](libusb_device_handle* p) { libusb_close(p); })>;

Context make_context() {
  libusb_context* raw = nullptr;
  ck_assert_int_eq(libusb_init(&raw), 0);
  return Context(raw);
}

std::string serial_of(libusb_device_handle* handle) {
  libusb_device_descriptor descriptor;
  unsigned char text[64] = "";
  libusb_get_device_descriptor(libusb_get_device(handle), &descriptor);
  const int length = libusb_get_string_descriptor_ascii(handle, descriptor.iSerialNumber, text, sizeof text);
  return length > 0 ? std::string(reinterpret_cast<char*>(text), size_t(length)) : "";
}

// The device of this serial number that is on the bus now; null: none. error: of the last that could not be opened.
Handle find(libusb_context* context, const std::string& serial, int* error = nullptr) {
  libusb_device** list = nullptr;
  const ssize_t count = libusb_get_device_list(context, &list);
  Handle found;
  for (ssize_t i = 0; i < count && !found; ++i) {
    libusb_device_descriptor descriptor;
    libusb_device_handle* raw = nullptr;
    libusb_get_device_descriptor(list[i], &descriptor);
    if (descriptor.idVendor != LoopModel::vendor || descriptor.idProduct != LoopModel::product) continue;
    const int status = libusb_open(list[i], &raw);
    if (status != 0 && error) *error = status;
    if (status != 0) continue;
    Handle handle(raw);
    if (serial_of(raw) == serial) found = std::move(handle);
  }
  libusb_free_device_list(list, 1);
  return found;
}

Handle await(libusb_context* context, const std::string& serial) {
  Handle handle;
  ck_assert_msg(until([&] { return bool(handle = find(context, serial)); }), "%s is not found", serial.c_str());
  ck_assert_int_eq(libusb_claim_interface(handle.get(), 0), 0);
  return handle;
}

int ask(libusb_device_handle* handle, uint8_t request, uint16_t value) {
  unsigned char answer[8];
  const int length = libusb_control_transfer(handle, 0xc0, request, value, 0, answer, sizeof answer, 5000);
  if (length < 0) return length;
  ck_assert_int_eq(length, 2);
  return answer[0] | answer[1] << 8;
}

std::string echo(libusb_device_handle* handle, std::string text) {
  unsigned char answer[64];
  int sent = 0, received = 0;
  ck_assert_int_eq(libusb_bulk_transfer(handle, LoopModel::out_endpoint, reinterpret_cast<unsigned char*>(text.data()),
                                        int(text.size()), &sent, 5000), 0);
  ck_assert_int_eq(sent, int(text.size()));
  ck_assert_int_eq(libusb_bulk_transfer(handle, LoopModel::in_endpoint, answer, sizeof answer, &received, 5000), 0);
  return std::string(reinterpret_cast<char*>(answer), size_t(received));
}

// A transfer that waits at the endpoint IN until something ends it.
struct Waiting {
  std::array<unsigned char, 64> buffer{};
  int is_done = 0;
  libusb_transfer* transfer = libusb_alloc_transfer(0);

  explicit Waiting(libusb_device_handle* handle) {
    libusb_fill_bulk_transfer(transfer, handle, LoopModel::in_endpoint, buffer.data(), int(buffer.size()),
                              [](libusb_transfer* ended) { *static_cast<int*>(ended->user_data) = 1; }, &is_done, 0);
  }
  ~Waiting() { libusb_free_transfer(transfer); }
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;

  int submit() { return libusb_submit_transfer(transfer); }
  libusb_transfer_status await_end(libusb_context* context) {
    ck_assert(until([&] {
      timeval moment{0, 10'000};
      libusb_handle_events_timeout_completed(context, &moment, &is_done);
      return is_done != 0;
    }));
    return transfer->status;
  }
};

START_TEST(a_device_answers) {
  Served<LoopModel> served("L1");
  served.plug();
  const Context context = make_context();
  const Handle handle = await(context.get(), "L1");
  ck_assert_int_eq(ask(handle.get(), LoopModel::add_one, 41), 42);
  ck_assert_int_eq(ask(handle.get(), LoopModel::refuse, 0), LIBUSB_ERROR_PIPE);
  ck_assert_int_eq(ask(handle.get(), LoopModel::add_one, 42), 43);
  for (int i = 0; i < 100; ++i) ck_assert_str_eq(echo(handle.get(), "number " + std::to_string(i)).c_str(),
                                                 ("number " + std::to_string(i)).c_str());
}
END_TEST

START_TEST(a_wait_can_be_cancelled) {
  Served<LoopModel> served("L1");
  served.plug();
  const Context context = make_context();
  const Handle handle = await(context.get(), "L1");
  Waiting waiting(handle.get());
  ck_assert_int_eq(waiting.submit(), 0);
  ck_assert_int_eq(libusb_cancel_transfer(waiting.transfer), 0);
  ck_assert_int_eq(waiting.await_end(context.get()), LIBUSB_TRANSFER_CANCELLED);
  unsigned char answer[64];
  int received = 0;
  ck_assert_int_eq(libusb_bulk_transfer(handle.get(), LoopModel::in_endpoint, answer, sizeof answer, &received, 50), LIBUSB_ERROR_TIMEOUT);
  ck_assert_str_eq(echo(handle.get(), "still there").c_str(), "still there");
}
END_TEST

START_TEST(two_devices_at_once) {
  Served<LoopModel> first("L1"), second("L2");
  first.plug();
  second.plug();
  const Context context = make_context();
  const Handle a = await(context.get(), "L1"), b = await(context.get(), "L2");
  int sent = 0;
  unsigned char text[] = {'a'};
  ck_assert_int_eq(libusb_bulk_transfer(a.get(), LoopModel::out_endpoint, text, 1, &sent, 5000), 0);
  ck_assert_str_eq(echo(b.get(), "b").c_str(), "b");
  first.unplug();
  ck_assert_str_eq(echo(b.get(), "b alone").c_str(), "b alone");
}
END_TEST

START_TEST(an_unplug_shows_in_both_ways) {
  Served<LoopModel> served("L1");
  served.plug();
  const Context context = make_context();
  const Handle handle = await(context.get(), "L1");
  Waiting waiting(handle.get());
  ck_assert_int_eq(waiting.submit(), 0);
  served.unplug();
  ck_assert_int_eq(waiting.await_end(context.get()), LIBUSB_TRANSFER_NO_DEVICE);
  ck_assert_int_eq(waiting.submit(), LIBUSB_ERROR_NO_DEVICE);
  ck_assert_int_eq(ask(handle.get(), LoopModel::add_one, 1), LIBUSB_ERROR_NO_DEVICE);

  served.plug();  // the model has kept its serial number
  const Handle other = await(context.get(), "L1");
  served.unplug();
  Waiting nothing(other.get());
  int status = nothing.submit();  // nothing was under way: it shows now, or as soon as the kernel has noticed
  if (status == 0 && nothing.await_end(context.get()) == LIBUSB_TRANSFER_NO_DEVICE) status = LIBUSB_ERROR_NO_DEVICE;
  ck_assert_int_eq(status, LIBUSB_ERROR_NO_DEVICE);
}
END_TEST

START_TEST(hot_plug) {
  Served<LoopModel> served("L1");
  struct Seen {
    int arrived = 0, left = 0;
  } seen;
  const Context context = make_context();
  ck_assert(libusb_has_capability(LIBUSB_CAP_HAS_HOTPLUG));
  const auto note = [](libusb_context*, libusb_device*, libusb_hotplug_event event, void* data) {
    ++(event == LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED ? static_cast<Seen*>(data)->arrived : static_cast<Seen*>(data)->left);
    return 0;
  };
  ck_assert_int_eq(libusb_hotplug_register_callback(context.get(), LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED | LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT,
                                                    0, LoopModel::vendor, LoopModel::product, LIBUSB_HOTPLUG_MATCH_ANY, note, &seen, nullptr), 0);
  const auto comes = [&](int arrived, int left) {
    return until([&] {
      timeval moment{0, 10'000};
      libusb_handle_events_timeout_completed(context.get(), &moment, nullptr);
      return seen.arrived == arrived && seen.left == left;
    });
  };
  for (int i = 1; i <= 3; ++i) {
    served.plug();
    ck_assert_msg(comes(i, i - 1), "%d have come, %d gone", seen.arrived, seen.left);
    const Handle handle = await(context.get(), "L1");
    ck_assert_str_eq(echo(handle.get(), "again").c_str(), "again");
    served.unplug();
    ck_assert_msg(comes(i, i), "%d have come, %d gone", seen.arrived, seen.left);
  }
}
END_TEST

// The node belongs to root, with the mode 0600: another user sees the device and may not open it.
START_TEST(another_user_is_refused) {
  Served<LoopModel> served("L1");
  served.plug();
  ck_assert_int_eq(chmod(await_node("L1").c_str(), 0600), 0);
  ck_assert(as_user([] {
    const Context own = make_context();
    int error = 0;
    ck_assert(!find(own.get(), "L1", &error));
    ck_assert_int_eq(error, LIBUSB_ERROR_ACCESS);
  }));
}
END_TEST

}  // namespace

int main() {
  return run_cases("usbfs", {a_device_answers, a_wait_can_be_cancelled, two_devices_at_once, an_unplug_shows_in_both_ways, hot_plug,
                             another_user_is_refused});
}
