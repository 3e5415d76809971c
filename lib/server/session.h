// A client's life at the server: it says who it is, sends messages, has a turn in each period, and goes. The session reads
// the messages, applies what it can and parks what has to wait. What it keeps account of stands in Client, what changes do
// in Changes, what is asked in Requests. Nothing that comes is trusted: it is copied, checked, then used; what is not good
// harms this client alone. All on the server's thread.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>

#include "server/allowance.h"
#include "server/changes.h"
#include "server/client.h"
#include "server/requests.h"

namespace fs {

class Session {
 public:
  static constexpr double slice = 1e-5;  // s of one client's work; then others are looked at

  // refusal: FS_OK, or what it is told when it says who it is.
  Session(Host& host, uint64_t id, Descriptor socket, const Peer& peer, fs_status refusal);

  Client& client() const noexcept { return *client_; }
  const std::shared_ptr<Client>& shared_client() const noexcept { return client_; }
  bool is_refused() const noexcept { return refusal_ != FS_OK; }

  // Handles so many of the messages that are there, or as many as it can within a slice.
  void receive(int most) noexcept;
  // Whether the next message can be handled in the middle of a long one of `busy`'s (null: of nobody's): it is short, and
  // not about busy's objects. `round`: in which it is not looked at again when it cannot.
  bool is_next_apart(const Client* busy, uint64_t round) noexcept;
  Usage& usage() noexcept { return usage_; }

  // Each period: takes the moves, and posts the changes to the servo.
  void turn(double now) noexcept;
  // After all have had their turn: tells what a tick has used.
  void end_turn() noexcept;
  // Applies what has waited for shapes, when it is time for that.
  void catch_up() noexcept;
  // Now and then: passes on the scene's events, and looks after the channel.
  void keep_house() noexcept;
  // A worker has done a job for it; done: what is left to be done here.
  void finish_job(const std::function<void()>& done) noexcept;

  bool is_busy() const noexcept;   // it waits for something that the servo or a worker must do
  bool is_alive() const noexcept;  // its process, as far as the system tells
  // From now on the client is gone; its objects fade from `lease` s on.
  void drop(double lease) noexcept;
  void drop() noexcept { drop(client_->host.settings().lease); }
  void set_asleep(bool is_asleep) noexcept;
  bool has_moves() const noexcept { return client_->moves.has_new(); }

 private:
  void handle(std::span<const std::byte> bytes, Descriptor&& data);
  void take_asset(PackedAsset&& packed);
  void finish_asset(uint64_t id, ClientAssets::Upload&& upload);
  ReceivedBatch take_apart(std::span<const std::byte> body, std::shared_ptr<const void> memory, Descriptor&& data);
  void check(const Change& change, Subjects& about) const;
  bool is_ready(const ReceivedBatch& batch) const;
  void submit(ReceivedBatch&& batch);
  void apply(ReceivedBatch&& batch);
  void retry_parked();
  void note_applied() noexcept;
  void regulate() noexcept;

  const std::shared_ptr<Client> client_;
  Changes changes_{*client_};
  Requests requests_{*client_};
  const fs_status refusal_;
  const double since_;
  Usage usage_{1e-3};  // s; a new client does not come first
  uint64_t round_to_wait_ = 0;
  uint64_t last_serial_ = 0;
  bool is_reading_ = true;
  bool are_moves_taken_ = false;  // in this turn
};

}  // namespace fs
