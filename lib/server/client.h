// One client, as the parts of its session and the sessions of others see it: who it is, its scene and its channel, and the
// parts that keep track of its objects, moves, assets and requests. All of it is used on the server's thread alone.
#pragma once

#include <memory>
#include <string>

#include "ipc/socket.h"
#include "server/answers.h"
#include "server/client_assets.h"
#include "server/moves.h"
#include "server/names.h"
#include "server/parked_batches.h"
#include "server/work.h"

namespace fs {

class Claim;

struct Client {
  Client(Host& the_host, uint64_t the_id, Descriptor&& the_socket, const Peer& the_peer);

  Host& host;
  const uint64_t id;
  const Peer peer;
  Descriptor socket, process;  // process: readable when it has ended; may be none
  std::string name;            // empty: it has not said who it is, and has no scene yet
  RecordSizes sizes = own_sizes();  // common with the client
  bool is_gone = false;

  Ref<LocalScene> scene;
  Ref<Channel> channel;
  std::shared_ptr<void> inbox_memory;
  std::shared_ptr<Outbox> outbox;
  double connected = 0;  // s, scene's clock

  Names names;
  Moves moves;
  ClientAssets assets;
  ParkedBatches parked;
  bool is_view_untold = false;  // the client has to be told of its view
  const Answers answers{socket, sizes};
  unsigned jobs = 0;                             // that workers have not finished
  uint64_t moved = 0, changed = 0, refused = 0;  // counts for fs_client

  Work work{host};
  Claim* claim = nullptr;   // of its work; null: none
  bool is_claimed = false;  // its scene is being changed in several steps

  // Takes the moves in the inbox. False: a group of moves is being written there, and all of them come later.
  bool take_moves();
  void bind(std::string_view object, uint32_t slot, uint64_t serial);  // and looks at the slot's move
  void push_event(const fs_event& event) noexcept { fs::push_event(*outbox, event); }
  void push_event(fs_event_kind kind, const std::string& object, const std::string& text = "");
  fs_event what_it_did(fs_status status, const char* text) const noexcept;
  // Tells the server's own scene what this client did: that it came or went.
  void tell_server(fs_status status, const char* text) const noexcept;
  void note_news() noexcept { outbox->news.fetch_add(1, std::memory_order_release); }  // the client has to be told something
  // Notes that another client has changed or removed one of its objects.
  void note_edit_by(const std::string& editor, const std::string& object, bool is_removed);
  // Notes that the client has to be told of a name that it gave itself; unless it gave very many.
  void note_untold(const std::string& object);
  // Notes an object that waits for its shape, or was refused, for reports.
  void note_absent(const wire::Set& set, fs_object_state state);

  fs_report report(const std::string& object) const;  // NOT_FOUND
  fs_client describe() const;

  bool is_alive() const noexcept;  // its process lives, as far as the system tells
  // From now on the client is gone; its objects fade from `lease` s on.
  void drop(double lease) noexcept;
  void drop() noexcept { drop(host.settings().lease); }
};

// The report of an object that is not in the scene.
fs_report report_of(const std::string& name, const Absence& absent);

}  // namespace fs
