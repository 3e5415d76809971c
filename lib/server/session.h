// A client's life at the server: it says who it is, sends messages, has a turn in each period, and goes. The session reads
// the messages, applies the changes that it can, and parks those that have to wait. Client holds what the server knows of the
// client, Changes applies changes, Requests answers requests. Nothing that comes is trusted: it is copied, checked, then
// used; what is not good harms this client alone. All of it runs on the server's thread.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>

#include "server/allowance.h"
#include "server/changes.h"
#include "server/client.h"
#include "server/requests.h"
#include "server/syncs.h"

namespace fs {

class Session {
 public:
  static constexpr double slice = 1e-5;  // s of work for one client, before others are looked at

  // refusal: FS_OK, or why the client will be refused when it says who it is.
  Session(Host& host, uint64_t id, Descriptor socket, const Peer& peer, fs_status refusal);

  Client& client() const noexcept { return *client_; }
  const std::shared_ptr<Client>& shared_client() const noexcept { return client_; }
  bool is_refused() const noexcept { return refusal_ != FS_OK; }

  // Handles at most so many of the messages that are there, for about a slice of time.
  void receive(int most) noexcept;
  // Whether the next message can be handled in the middle of long work for `busy` (null: for nobody): the message is short,
  // and not about busy's objects. Where it cannot, it is not looked at again in the same `round`.
  bool is_next_apart(const Client* busy, uint64_t round) noexcept;
  Usage& usage() noexcept { return usage_; }

  // Called each period: takes the moves, and posts the changes to the servo.
  void turn(double now) noexcept;
  // Called after all sessions had their turn: tells the client which of its changes a tick has used.
  void end_turn() noexcept;
  // Applies changes that have waited for shapes, when it is time to look through them.
  void catch_up() noexcept;
  // Called now and then: passes on the scene's events, and looks after the channel.
  void keep_house() noexcept;
  // A worker has finished a job for this client; done: what is left to do here.
  void finish_job(const std::function<void()>& done) noexcept;

  bool is_busy() const noexcept;   // it waits for the servo or a worker
  void set_asleep(bool is_asleep) noexcept;
  bool has_moves() const noexcept { return client_->moves.has_new(); }

 private:
  void handle(std::span<const std::byte> bytes, Descriptor&& data);
  void take_asset(PackedAsset&& packed);
  bool finish_asset(uint64_t id, ClientAssets::Upload&& upload);  // true: parked changes can be looked through now
  ReceivedBatch take_apart(std::span<const std::byte> body, std::shared_ptr<const void> memory, Descriptor&& data);
  void check(const Change& change, Subjects& about) const;
  bool is_ready(const ReceivedBatch& batch) const;
  void submit(ReceivedBatch&& batch);
  void apply(ReceivedBatch&& batch);
  void retry_parked();
  void note_applied() noexcept;
  void regulate() noexcept;

  const std::shared_ptr<Client> client_;
  Syncs syncs_;
  Changes changes_{*client_, syncs_};
  Requests requests_{*client_, syncs_};
  const fs_status refusal_;
  const double since_;
  Usage usage_{1e-3};  // s; a new client does not come first
  uint64_t round_to_wait_ = 0;
  uint64_t last_serial_ = 0;
  bool is_reading_ = true;
  bool are_moves_taken_ = false;  // in this turn
};

}  // namespace fs
