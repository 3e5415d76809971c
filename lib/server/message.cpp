#include "server/message.h"

#include <cstring>

#include "server/answers.h"
#include "transfer/records.h"

namespace fs {

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

}  // namespace fs
