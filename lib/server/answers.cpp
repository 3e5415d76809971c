#include "server/answers.h"

#include "base/text.h"

namespace fs {

void Answers::send(uint64_t serial, std::span<const std::byte> body, int descriptor) const {
  if (socket_) send(serial, {FS_OK, wire::reason_none, {}}, body, descriptor);
}

void Answers::refuse(uint64_t serial, fs_status status, const std::string& text, wire::ReplyReason reason) const {
  wire::Reply reply{status, reason, {}};
  put_text(reply.text, text);
  if (socket_) send(serial, reply, {}, -1);
}

void Answers::send(uint64_t serial, const wire::Reply& reply, std::span<const std::byte> body, int descriptor) const {
  const wire::Header header{wire::type_reply, 0, serial};
  const std::span<const std::byte> parts[] = {bytes_of(&header, 1), bytes_of(&reply, 1), body};
  const std::span<const int> descriptors(&descriptor, descriptor >= 0 ? 1 : 0);
  // A descriptor in transit costs memory: a client that does not read gets few of them.
  constexpr size_t most_unread = 16384;
  if (descriptor >= 0 && unread(socket_) > most_unread) {
    return refuse(serial, FS_ERROR_FULL, "this client has not read its earlier answers");
  }
  const Transfer transfer = send_message(socket_, parts, descriptors);
  if (transfer == Transfer::again && descriptor >= 0) {  // perhaps the processes of this user have too many in transit
    return refuse(serial, FS_ERROR_FULL, "the system allows no more descriptors in transit now");
  }
  if (transfer != Transfer::done) throw BadClient{};
}

}  // namespace fs
