// What a client asks for that may be long, of all objects of some scenes: a sealed file of records. A worker writes a long
// one: on the server's thread all others would wait.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ipc/blob.h"
#include "server/client.h"

namespace fs {

class List {
 public:
  virtual ~List() = default;
  virtual size_t most() const = 0;  // records

  void make() noexcept;  // any thread, once

  // Then:
  Descriptor data;
  wire::Count count{0};
  fs_status status = FS_OK;
  std::string text;

 protected:
  virtual void write() = 0;   // calls add_record for each; may throw
  virtual void release() {}   // lets go of the scenes
  template <class Record>
  void add_record(const Record& record) {
    const std::span<const std::byte> bytes = bytes_of(&record, 1);
    piece_.insert(piece_.end(), bytes.begin(), bytes.end());
    ++count.count;
    if (piece_.size() >= 65536) flush();
  }

 private:
  void flush();
  std::vector<std::byte> piece_;
  BlobWriter* blob_ = nullptr;
};

// Each answers the request of this serial, now or when a worker has made the list. Of all scenes that the client can see,
// each at one instant: no other message is looked at meanwhile, so no group is there half.
void answer_reports(Client& client, uint64_t serial);                            // its own first
void answer_motions(Client& client, uint64_t serial, const std::string& whose);  // empty: all but its own. NOT_FOUND
void answer_clients(Client& client, uint64_t serial);                            // IO, FULL

// A report as another scene sees it: the place in that scene's frame, the force in newtons at the device along its axes.
fs_report seen_from(const fs_report& report, const fs_frame& owner, const fs_frame& viewer);

// The client of that name; null: the server. NOT_FOUND.
std::shared_ptr<Client> find_client(const Client& asking, const std::string& name);

}  // namespace fs
