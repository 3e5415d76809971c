// Answers that may be long, about all objects of some scenes: a list is a sealed file of records. A worker writes a long
// list, because all other clients would wait for the server's thread.
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

  void make() noexcept;  // once, in any thread

  // What it has made:
  Descriptor data;
  wire::Count count{0, 0};
  fs_status status = FS_OK;
  std::string text;

 protected:
  virtual void write() = 0;   // calls add_record for each; may throw
  virtual void release() {}   // lets go of the scenes
  template <class Record>
  void add_record(const Record& record) {
    const std::span<const std::byte> bytes = bytes_of(&record, 1);
    count.stride = sizeof record;
    piece_.insert(piece_.end(), bytes.begin(), bytes.end());
    ++count.count;
    if (piece_.size() >= 65536) flush();
  }

 private:
  void flush();
  std::vector<std::byte> piece_;
  BlobWriter* blob_ = nullptr;
};

// Each answers the request of this serial, now or when a worker has made the list, for all scenes that the client can see.
// The scenes are taken at one instant, between two messages, so no half of a group is seen.
void answer_reports(Client& client, uint64_t serial);                            // its own objects first
void answer_motions(Client& client, uint64_t serial, const std::string& whose);  // of a client; "": of all others. NOT_FOUND
void answer_motions_since(Client& client, uint64_t serial, const wire::Since& since);
void answer_clients(Client& client, uint64_t serial);                            // IO, FULL
void answer_views(Client& client, uint64_t serial);                              // of all clients, in that order. IO, FULL

// Answers with the servo's recorded ticks that have a number above `after`. IO, FULL.
void answer_record(Client& client, uint64_t serial, uint64_t after);

// The view of a client, null: of the server. Of the asking client's own, changes that are parked count as done.
fs_view view_seen_by(const Client& asking, const Client* owner);

// A report as another scene sees it: the place in that scene's frame; the force in newtons at the device, along its axes.
fs_report seen_from(const fs_report& report, const fs_frame& owner, const fs_frame& viewer);

// The client of that name; null: the server. NOT_FOUND.
std::shared_ptr<Client> find_client(const Client& asking, const std::string& name);

}  // namespace fs
