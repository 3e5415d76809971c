#include "server/message.h"

#include <cstring>

#include "server/answers.h"
#include "transfer/records.h"

namespace fs {
namespace {

// Checks the change, and adds what it is about. Throws BadClient.
void check(const Client& client, const Change& change, Subjects& about) {
  uint32_t slot = wire::no_slot;
  if (change.type == wire::type_set || change.type == wire::type_change) slot = change.as<wire::Set>().slot;
  if (change.type == wire::type_bind) slot = change.as<wire::Bind>().slot;
  if (!client.names.is_slot(slot) || !about.add(change)) throw BadClient{};
}

}  // namespace

Transfer receive(const Descriptor& socket, std::span<std::byte> buffer, uint64_t last_serial, const RecordSizes& sizes,
                 Message& out) {
  size_t size;
  bool is_cut;
  const Transfer transfer = receive_message(socket, buffer, size, {&out.data, 1}, is_cut);
  if (transfer != Transfer::done) return transfer;
  wire::Header header;
  if (size < sizeof header) throw BadClient{};
  std::memcpy(&header, buffer.data(), sizeof header);
  const std::span<const std::byte> record = buffer.first(size).subspan(sizeof header);
  const bool is_size_good =
      header.type == wire::type_group ? record.size() >= sizeof(wire::Group) : record_size(header.type, sizes) == record.size();
  if (!is_size_good || header.serial <= last_serial) throw BadClient{};
  out.type = static_cast<wire::Type>(header.type);
  out.serial = header.serial;
  if (record.empty()) return transfer;
  out.memory = std::make_shared_for_overwrite<std::byte[]>(record.size());
  std::memcpy(out.memory.get(), record.data(), record.size());
  out.record = {out.memory.get(), record.size()};
  return transfer;
}

ReceivedBatch batch_of(const Client& client, const Message& message) {
  ReceivedBatch out{message.serial, Batch::Reader::read(message.type, message.record, message.memory, client.sizes), {}, false};
  check(client, out.changes[0], out.about);
  out.is_request = out.changes[0].is_foreign();
  return out;
}

Task take_apart(Client& client, Message& message, ReceivedBatch& out) {
  const size_t most = wire::most_changes(client.host.settings().max_objects);
  Batch::Reader reader(message.record, message.memory, std::move(message.data), most, client.sizes);
  while (!reader.is_done()) {
    const std::optional<Change> change = reader.next();
    if (!change) break;
    if (change->comes_alone()) throw BadClient{};
    check(client, *change, out.about);
    co_await client.work.step();
  }
  if (!reader.is_good()) throw BadClient{};
  out.changes = reader.take();
  out.serial = message.serial;
}

}  // namespace fs
