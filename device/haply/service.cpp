#include "device/haply/service.h"

#include <boost/asio/connect.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>

#include <algorithm>
#include <chrono>

#include "device/support/clock.h"
#include "device/support/refusal.h"

namespace fs::haply {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using boost::system::error_code;

constexpr double connect_within = 2, answer_within = 2;  // s
// Bytes: a larger one could not be read within the time of receive. An arm takes about 1000.
constexpr size_t largest_message = 1 << 16;

// An operation that asio does beside the caller.
struct Operation {
  bool is_under_way = false;
  error_code error;

  auto begin() {
    is_under_way = true;
    return [this](error_code result, auto&&...) {
      error = result;
      is_under_way = false;
    };
  }
};

// Lets the operations go on until this one has ended; false: it has not within that time (s).
bool await(asio::io_context& context, const Operation& operation, double within) {
  const double until = steady_now() + within;
  while (operation.is_under_way) {
    const double left = until - steady_now();
    if (context.stopped()) context.restart();
    if (left <= 0) context.poll_one();
    else context.run_one_for(std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::duration<double>(left)));
    if (left <= 0) break;
  }
  return !operation.is_under_way;
}

[[noreturn]] void refuse_connection(const std::string& host, const std::string& port, const char* why) {
  refuse(FS_ERROR_NOT_FOUND,
         "nothing answers at %.100s:%.10s (%.200s): install Haply's package haply-inverse-service, then run "
         "'systemctl start haply-inverse-service'",
         host.c_str(), port.c_str(), why);
}

void connect(asio::io_context& context, tcp::socket& socket, const std::string& host, const std::string& port) {
  error_code error;
  tcp::resolver resolver(context);
  const auto places = resolver.resolve(host, port, error);
  if (error) refuse_connection(host, port, error.message().c_str());
  Operation connecting;
  asio::async_connect(socket, places, connecting.begin());
  if (!await(context, connecting, connect_within)) {
    socket.close(error);
    await(context, connecting, connect_within);
    refuse_connection(host, port, "no answer within 2 s");
  }
  if (connecting.error) refuse_connection(host, port, connecting.error.message().c_str());
  socket.set_option(tcp::no_delay(true), error);
}

}  // namespace

std::string version_answer(const std::string& host, const std::string& port) {
  asio::io_context context(1);
  beast::flat_buffer buffer(largest_message);
  http::request<http::empty_body> request(http::verb::get, "/version", 11);
  request.set(http::field::host, host);
  request.keep_alive(false);
  http::response<http::string_body> answer;
  Operation writing, reading;
  tcp::socket socket(context);
  connect(context, socket, host, port);
  http::async_write(socket, request, writing.begin());
  bool is_done = await(context, writing, answer_within) && !writing.error;
  if (is_done) {
    http::async_read(socket, buffer, answer, reading.begin());
    is_done = await(context, reading, answer_within) && !reading.error;
  }
  error_code ignored;
  socket.close(ignored);
  await(context, writing, answer_within);
  await(context, reading, answer_within);
  return is_done && answer.result() == http::status::ok ? answer.body() : "";
}

struct Service::Connection {
  asio::io_context context{1};
  Operation reading, writing;
  beast::flat_buffer buffer{largest_message};
  std::string written;
  bool is_taken = true;  // the caller has had the message in the buffer
  error_code failure;
  beast::websocket::stream<tcp::socket> stream{context};

  fs_status lost(error_code error) {
    failure = error;
    return FS_ERROR_DISCONNECTED;
  }
};

Service::Service(const std::string& host, const std::string& port) : connection_(std::make_unique<Connection>()) {
  Connection& c = *connection_;
  connect(c.context, c.stream.next_layer(), host, port);
  Operation greeting;
  c.stream.read_message_max(largest_message);
  c.stream.async_handshake(host + ":" + port, "/", greeting.begin());
  if (!await(c.context, greeting, answer_within)) {
    error_code ignored;
    c.stream.next_layer().close(ignored);
    await(c.context, greeting, answer_within);
    refuse(FS_ERROR_IO, "what listens at %.100s:%.10s does not answer within 2 s", host.c_str(), port.c_str());
  }
  if (greeting.error) {
    refuse(FS_ERROR_IO, "what listens at %.100s:%.10s is no Haply Inverse Service: %.200s", host.c_str(), port.c_str(),
           greeting.error.message().c_str());
  }
}

Service::~Service() = default;

fs_status Service::send(std::string_view text, double within) {
  Connection& c = *connection_;
  const double until = steady_now() + within;
  if (c.failure) return FS_ERROR_DISCONNECTED;
  if (!await(c.context, c.writing, within)) return FS_ERROR_TIMEOUT;  // the message before
  if (c.writing.error) return c.lost(c.writing.error);
  c.written = text;
  c.stream.async_write(asio::buffer(c.written), c.writing.begin());
  await(c.context, c.writing, std::max(0.0, until - steady_now()));
  return c.writing.error ? c.lost(c.writing.error) : FS_OK;
}

fs_status Service::receive(double within, std::string_view& text) {
  Connection& c = *connection_;
  if (c.failure) return FS_ERROR_DISCONNECTED;
  if (c.is_taken) {
    c.buffer.clear();
    c.is_taken = false;
    c.stream.async_read(c.buffer, c.reading.begin());
  }
  if (!await(c.context, c.reading, within)) return FS_ERROR_TIMEOUT;
  if (c.reading.error) return c.lost(c.reading.error);
  c.is_taken = true;
  text = {static_cast<const char*>(c.buffer.data().data()), c.buffer.size()};
  return FS_OK;
}

std::string Service::trouble() const { return connection_->failure.message(); }

}  // namespace fs::haply
